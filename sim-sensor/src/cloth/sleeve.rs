//! Sleeves stay on: a ring of cloth around an arm may slide and sag a little, but not leave it, nor be rolled up.
//!
//! Where a bent forearm is pressed into the upper arm or the trunk, bodies made of skinning weights run into
//! themselves, and cloth between the two surfaces has no place to be. Contacts alone then push it out on either side.

use std::{collections::BTreeMap, ops::RangeInclusive};

use glam::Vec3;

use super::{collider::Arm, form::Form, sheet::Sheet};

/// Rings are this far apart, as a share of the upper arm's or forearm's length, and begin below the armpit.
const SPACING: f32 = 0.1;
const FIRST_STATION: f32 = 0.35;
/// A ring of fewer points is none.
const LEAST_POINTS: usize = 6;
/// How far a ring's middle may be from the arm's, beyond its ease.
const SAG_M: f32 = 0.012;
/// How far a ring may slide along its arm from where it was cut, either way, before that counts as leaving it: on the
/// upper arm, where shoulders draw sleeves along, and on the forearm.
const SLIDE_M: [f32; 2] = [0.10, 0.03];

/// Shoulder, elbow, wrist and hand of both arms.
pub(super) type ArmAxes = [[Vec3; 4]; 2];
pub(super) const ARM_JOINTS: [[usize; 4]; 2] = [[16, 18, 20, 22], [17, 19, 21, 23]];

/// Points of a sleeve at one station of an arm.
#[derive(Clone, Debug)]
pub(super) struct Ring {
    arm: Arm,
    points: Vec<u32>,
    /// Where it was cut, along shoulder, elbow, wrist and hand.
    home_m: f32,
    slide_m: f32,
    most_m: f32,
}

/// The rings of a garment's sleeves, each in the order of its points' numbers.
pub(super) fn rings(form: &Form, sheet: &Sheet, arms: &[Option<Arm>]) -> Vec<Ring> {
    let axes = ARM_JOINTS.map(|arm| arm.map(|joint| form.joints[joint]));
    let mut rings: BTreeMap<(usize, u32), Vec<u32>> = BTreeMap::new();
    for (v, (&point, arm)) in sheet.points.iter().zip(arms).enumerate() {
        let Some(arm) = arm else { continue };
        let station = form.place(&form.tree.query(point)).arm;
        if station >= FIRST_STATION {
            let ring = (*arm as usize, (station / SPACING) as u32);
            rings.entry(ring).or_default().push(v as u32);
        }
    }
    rings
        .into_iter()
        .filter(|(_, points)| points.len() >= LEAST_POINTS)
        .map(|((side, _), points)| {
            let middle = middle_of(&points, &sheet.points);
            let home_m = nearest_on(&axes[side], middle, 0.0..=f32::MAX).0;
            let eases_m = points.iter().map(|&v| {
                let point = sheet.points[v as usize];
                form.tree.query(point).point.distance(point)
            });
            let ease_m = eases_m.sum::<f32>() / points.len() as f32;
            let elbow_m = axes[side][0].distance(axes[side][1]);
            let slide_m = SLIDE_M[usize::from(home_m > elbow_m)];
            Ring { arm: Arm::BOTH[side], points, home_m, slide_m, most_m: SAG_M + ease_m }
        })
        .collect()
}

impl Ring {
    /// Moves the ring as a whole back around its arm if it has left it.
    pub(super) fn hold(&self, points: &mut [Vec3], axes: &ArmAxes) {
        let aside = self.aside(points, axes);
        let excess_m = aside.length() - self.most_m;
        if excess_m > 0.0 {
            let back = -aside.normalize_or_zero() * excess_m;
            for &v in &self.points {
                points[v as usize] += back;
            }
        }
    }

    /// How far the ring is off its arm beyond what it may be, in metres; negative around it.
    #[cfg(test)]
    pub(super) fn excess_m(&self, points: &[Vec3], axes: &ArmAxes) -> f32 {
        self.aside(points, axes).length() - self.most_m
    }

    /// From where on its arm the ring's middle may be to where it is.
    fn aside(&self, points: &[Vec3], axes: &ArmAxes) -> Vec3 {
        let middle = middle_of(&self.points, points);
        let reach_m = self.home_m - self.slide_m..=self.home_m + self.slide_m;
        middle - nearest_on(&axes[self.arm as usize], middle, reach_m).1
    }
}

fn middle_of(ring: &[u32], points: &[Vec3]) -> Vec3 {
    ring.iter().map(|&v| points[v as usize]).sum::<Vec3>() / ring.len() as f32
}

/// The point nearest to another on a part of an arm's axis, and how far along the axis that is.
fn nearest_on(axis: &[Vec3; 4], point: Vec3, part_m: RangeInclusive<f32>) -> (f32, Vec3) {
    let mut nearest = (0.0, axis[0]);
    let mut nearest_m = f32::MAX;
    let mut passed_m = 0.0;
    for bone in axis.windows(2) {
        let length_m = bone[0].distance(bone[1]).max(1e-6);
        let along = (bone[1] - bone[0]) / length_m;
        let first_m = (part_m.start() - passed_m).max(0.0);
        let last_m = (part_m.end() - passed_m).min(length_m);
        if first_m <= last_m {
            let at_m = (point - bone[0]).dot(along).clamp(first_m, last_m);
            let on_bone = bone[0] + along * at_m;
            if on_bone.distance(point) < nearest_m {
                nearest_m = on_bone.distance(point);
                nearest = (passed_m + at_m, on_bone);
            }
        }
        passed_m += length_m;
    }
    nearest
}

#[cfg(test)]
mod tests {
    use glam::vec3;

    use super::*;

    #[test]
    fn a_ring_that_left_its_arm_is_brought_back_whole() {
        let axes = [
            [Vec3::ZERO, Vec3::X, Vec3::X * 2.0, Vec3::X * 2.2],
            [Vec3::Y; 4],
        ];
        let ring = Ring {
            arm: Arm::Left,
            points: vec![0, 1, 2, 3],
            home_m: 1.5,
            slide_m: 0.05,
            most_m: 0.03,
        };
        let around = [Vec3::Y, Vec3::Z, -Vec3::Y, -Vec3::Z].map(|out| Vec3::X * 1.5 + out * 0.06);
        let mut points = around;
        ring.hold(&mut points, &axes);
        assert_eq!(
            points, around,
            "a ring that is around its arm is left alone"
        );
        let mut points = around.map(|point| point + Vec3::Y * 0.2);
        ring.hold(&mut points, &axes);
        for (point, before) in points.iter().zip(around) {
            let moved = *point - before;
            assert!((moved - Vec3::Y * 0.03).length() < 1e-6, "{moved}");
        }
    }

    #[test]
    fn a_ring_slides_no_further_than_a_sleeve_does() {
        let axes = [
            [
                Vec3::ZERO,
                Vec3::X,
                vec3(1.0, 1.0, 0.0),
                vec3(1.0, 1.2, 0.0),
            ],
            [Vec3::Y; 4],
        ];
        let ring =
            Ring { arm: Arm::Left, points: vec![0, 1], home_m: 1.5, slide_m: 0.05, most_m: 0.03 };
        let mut points = [Vec3::Z, -Vec3::Z].map(|out| vec3(1.0, 0.2, 0.0) + out * 0.06);
        ring.hold(&mut points, &axes);
        let middle = 0.5 * (points[0] + points[1]);
        let expected = vec3(1.0, 0.5 - ring.slide_m - 0.03, 0.0);
        assert!(middle.distance(expected) < 1e-6, "{middle}");
        // A bent arm: the ring belongs to the forearm, though the upper arm is nearer.
        let mut points = [Vec3::Z, -Vec3::Z].map(|out| vec3(0.5, 0.1, 0.0) + out * 0.06);
        ring.hold(&mut points, &axes);
        let middle = 0.5 * (points[0] + points[1]);
        assert!(
            middle.distance(vec3(1.0, 0.5 - ring.slide_m, 0.0)) < 0.031,
            "{middle}"
        );
    }
}
