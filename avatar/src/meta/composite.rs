//! Surfaces in poses that nobody took: the legs, an arm or both of other frames of the same person.
//!
//! What cloth does at a limb depends on the joints nearby. A network that is told all joints at once and sees some dozens of
//! poses of each person takes whatever comes together in these for cause: a bent knee for what a raised arm does. Here limbs
//! come together as they like. At the border of a limb and the rest, where both matter, nothing is said of the surface, neither
//! by points on it nor by points that are taken to be off it. (Hems that raised arms lift below the hips are not counted as border.)

use std::borrow::Cow;

use effigy_registration::smpl::JOINT_COUNT;
use glam::Vec3;
use rand::{Rng, RngExt as _};

use super::task::Prepared;
use crate::{
    PoseInput,
    fine_tune::sampling::{KeyframePoints, SurfacePoint},
    sdf::loss::{Known, LossPoint},
};

const HEAD: usize = 15;
const LEGS: [usize; 8] = [1, 2, 4, 5, 7, 8, 10, 11];
const LEFT_ARM: [usize; 5] = [13, 16, 18, 20, 22];
const RIGHT_ARM: [usize; 5] = [14, 17, 19, 21, 23];

/// Of a thigh's length below the hips, straight down: there legs begin, and trunks are left of arms no more.
const LEGS_BEGIN: f32 = 0.3;
/// From the lowest spine joint to the middle one: there trunks end that legs have no part in.
const TRUNK_ENDS: f32 = 0.5;
/// Of an upper arm's length from the shoulder: there arms begin that trunks have no part in.
const ARM_BEGINS: f32 = 0.35;
/// Of a shoulder's distance from the middle, on its other side: so far an arm pulls at what the trunk wears.
const ARM_REACHES: f32 = 0.25;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Limb {
    Legs,
    LeftArm,
    RightArm,
}

/// Whose a point is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Part {
    Limb,
    Rest,
    /// Nobody's: both move it.
    Border,
}

impl Limb {
    fn joints(self) -> &'static [usize] {
        match self {
            Self::Legs => &LEGS,
            Self::LeftArm => &LEFT_ARM,
            Self::RightArm => &RIGHT_ARM,
        }
    }

    /// Of a point of the star pose in unit space; `joints`: the zero pose's, where hips and arms are as in star pose.
    fn part(self, point: Vec3, joints: &[Vec3; JOINT_COUNT]) -> Part {
        let hips_y = 0.5 * (joints[1].y + joints[2].y);
        let legs_y = hips_y - LEGS_BEGIN * joints[1].distance(joints[4]);
        if self == Self::Legs {
            let trunk_y = joints[3].lerp(joints[6], TRUNK_ENDS).y;
            return match point.y {
                y if y < legs_y => Part::Limb,
                y if y > trunk_y => Part::Rest,
                _ => Part::Border,
            };
        }
        let [_, shoulder, elbow, ..] = *self.joints() else {
            unreachable!("arms have five joints")
        };
        let middle = joints[HEAD].x;
        let aside = (joints[shoulder].x - middle).abs();
        let outwards = |x: f32| (x - middle) * (joints[shoulder].x - middle).signum();
        let arm = outwards(joints[shoulder].lerp(joints[elbow], ARM_BEGINS).x);
        let is_leg = point.y < legs_y;
        let is_head = outwards(point.x) < aside && point.y > joints[HEAD].y;
        if is_leg || is_head || outwards(point.x) < -ARM_REACHES * aside {
            Part::Rest
        } else if outwards(point.x) > arm && point.y > joints[3].y {
            Part::Limb
        } else {
            Part::Border
        }
    }

    fn pose(self, limb: &PoseInput, rest: &PoseInput) -> PoseInput {
        let mut pose = *rest;
        for &joint in self.joints() {
            pose.rotations[joint] = limb.rotations[joint];
        }
        pose
    }

    fn points(
        self,
        limb: &KeyframePoints,
        rest: &KeyframePoints,
        joints: &[Vec3; JOINT_COUNT],
    ) -> KeyframePoints {
        let of = |points: &KeyframePoints, part: Part| {
            let all = points.surface.iter().copied();
            all.filter(move |at| self.part(at.point, joints) == part)
                .collect::<Vec<SurfacePoint>>()
        };
        let mut surface = of(limb, Part::Limb);
        surface.extend(of(rest, Part::Rest));
        KeyframePoints::of_surface(surface)
    }
}

/// A frame to learn from.
pub(super) struct Composite<'a> {
    pub(super) pose: PoseInput,
    pub(super) points: Cow<'a, KeyframePoints>,
    /// Not of the frame itself.
    limbs: Vec<Limb>,
}

impl<'a> Composite<'a> {
    /// A frame of somebody; each with a chance of `share`, its legs and one of its arms are another frame's.
    pub(super) fn draw(person: &'a Prepared, frame: usize, share: f32, rng: &mut impl Rng) -> Self {
        let mut drawn = Self {
            pose: person.poses[frame],
            points: Cow::Borrowed(&person.points[frame]),
            limbs: Vec::new(),
        };
        if share <= 0.0 {
            return drawn;
        }
        // One arm at a time: the borders of both would take the whole trunk.
        let arm = if rng.random() {
            Limb::LeftArm
        } else {
            Limb::RightArm
        };
        for limb in [Limb::Legs, arm] {
            let other = rng.random_range(0..person.poses.len());
            if rng.random::<f32>() < share && other != frame {
                let joints = &drawn.pose.joints_in_unit;
                let points = limb.points(&person.points[other], &drawn.points, joints);
                drawn.points = Cow::Owned(points);
                drawn.pose = limb.pose(&person.poses[other], &drawn.pose);
                drawn.limbs.push(limb);
            }
        }
        drawn
    }

    /// Takes all weight from random points at borders: a surface may be there.
    pub(super) fn forget_borders(&self, points: &[Vec3], known: &mut [LossPoint]) {
        let joints = &self.pose.joints_in_unit;
        for (&point, known) in points.iter().zip(known) {
            let is_at_border = |limb: &Limb| limb.part(point, joints) == Part::Border;
            if known.known == Known::Nothing && self.limbs.iter().any(is_at_border) {
                known.weight = 0.0;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use effigy_registration::smpl::builtin;
    use rand::{SeedableRng as _, rngs::StdRng};

    use super::*;
    use crate::{Subject, meta::PersonFrame, skinning::star_body};

    /// The star pose's body in four poses; a point's normal says which one it is of.
    fn prepared() -> Prepared {
        let body = builtin::body();
        let betas = [0.8; 10];
        let subject = Subject::new(&body, &betas).unwrap();
        let star: Vec<Vec3> = star_body(&body, &betas);
        let mut prepared = Prepared::default();
        for number in 0..4 {
            let theta = [Vec3::X * 0.1 * number as f32; JOINT_COUNT];
            let pose = subject.pose_input(&theta);
            let points = star
                .iter()
                .map(|&v| subject.unit_box.unit_from_canonical(v));
            let normals = vec![Vec3::X * number as f32; star.len()];
            prepared.push(&PersonFrame { pose, points_in_unit: points.collect(), normals });
        }
        prepared
    }

    /// A vertex is moved by the joints of the frame that it comes from, and by no other frame's.
    #[test]
    fn limbs_come_with_the_joints_that_move_them() {
        let (body, person) = (builtin::body(), prepared());
        let mut rng = StdRng::seed_from_u64(5);
        let (mut others, mut count) = (0, 0);
        for _ in 0..40 {
            let drawn = Composite::draw(&person, 0, 0.5, &mut rng);
            for at in &drawn.points.surface {
                let vertex = person.points[0]
                    .surface
                    .iter()
                    .position(|known| known.point == at.point)
                    .unwrap();
                let frame = at.normal.x as usize;
                let moved = |joint: usize| {
                    drawn.pose.rotations[joint] == person.poses[frame].rotations[joint]
                };
                let weights = &body.skinning[vertex];
                let bones = weights.bones.iter().zip(weights.weights);
                let own: f32 = bones
                    .filter(|(bone, _)| moved(usize::from(**bone)))
                    .map(|(_, weight)| weight)
                    .sum();
                assert!(own > 0.9, "vertex {vertex} of frame {frame}: {own}");
                others += usize::from(frame != 0);
                count += 1;
            }
            let all = person.points[0].surface.len();
            assert!(drawn.points.surface.len() > all / 2, "of {all}");
        }
        assert!(others > count / 10, "{others} of {count}");
    }

    #[test]
    fn at_borders_random_points_say_nothing() {
        let person = prepared();
        let mut rng = StdRng::seed_from_u64(2);
        let drawn = Composite::draw(&person, 0, 1.0, &mut rng);
        let hips = drawn.pose.joints_in_unit[0];
        let feet = drawn.pose.joints_in_unit[10];
        let random = LossPoint { known: Known::Nothing, weight: 1.0 };
        let measured = LossPoint { known: Known::Distance(0.01), weight: 1.0 };
        let mut known = [random, measured, random];
        drawn.forget_borders(&[hips, hips, feet], &mut known);
        assert_eq!(known.map(|point| point.weight), [0.0, 1.0, 1.0]);
    }

    #[test]
    fn nothing_is_put_together_unless_asked_for() {
        let person = prepared();
        let mut rng = StdRng::seed_from_u64(5);
        let drawn = Composite::draw(&person, 2, 0.0, &mut rng);
        assert_eq!(drawn.pose, person.poses[2]);
        assert!(matches!(drawn.points, Cow::Borrowed(_)));
        assert_eq!(
            rng.random::<u64>(),
            StdRng::seed_from_u64(5).random::<u64>()
        );
    }
}
