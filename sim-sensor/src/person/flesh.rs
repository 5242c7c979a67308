//! Muscles that swell and fat that hangs: how a body's surface follows its pose beyond bones.

use effigy_registration::{
    BodyModel,
    smpl::{BoneTransforms, JOINT_COUNT},
};
use glam::{Mat3, Vec3, vec3};

use super::{
    anthropometry::{Adult, Sex},
    bends,
    chart::Chart,
    individual::between,
    tailor::smoothstep,
};
use crate::random::Randomness;

/// One person's soft tissue, on the zero-pose surface.
#[derive(Clone, Debug)]
pub(super) struct Flesh {
    muscles: Vec<Muscle>,
    pads: Vec<Pad>,
}

/// What swells along the surface's normals.
#[derive(Clone, Debug)]
struct Muscle {
    works: Work,
    /// Vertices and their displacement at full work.
    swelling: Vec<(u32, Vec3)>,
}

/// What hangs: it follows gravity in the frame of its bone.
#[derive(Clone, Debug)]
struct Pad {
    bone: usize,
    /// Vertices and how far they hang when gravity turns by a right angle, metres.
    hang_m: Vec<(u32, f32)>,
}

/// How hard a muscle works in a pose, from 0 to 1.
#[derive(Clone, Copy, Debug)]
enum Work {
    /// The angle of a hinge, full at so many radians.
    Flexion { joint: usize, full_rad: f32 },
    /// How far an upper arm is raised above where the zero pose has it, or hangs below (negative).
    Raised { side: usize },
}

/// A swelling between two joints: where along the bone, how far to its front, its reach along and across.
struct Belly {
    works: Work,
    bone: [usize; 2],
    along: f32,
    aside: Vec3,
    reach_m: f32,
    height_m: f32,
}

impl Flesh {
    pub(super) fn new(body: &BodyModel, chart: &Chart, adult: &Adult, seed: u64) -> Self {
        let random = Randomness::new(seed, 0, 0xf1e);
        // Beta 8 is muscle; fat is what body mass index says, and women have more of it.
        let strength = (1.0 + 0.35 * adult.betas[8]).clamp(0.4, 1.8) * random.between(0, 0.8, 1.2);
        let bmi = adult.mass_kg / (adult.stature_m * adult.stature_m);
        let of_sex = if adult.sex == Sex::Female { 0.15 } else { 0.0 };
        let fatness = (0.25 + 0.075 * (bmi - 20.0) + of_sex).clamp(0.1, 1.6);
        let muscles = [0, 1].into_iter().flat_map(bellies).map(|belly| Muscle {
            works: belly.works,
            swelling: belly.swelling(body, chart, strength),
        });
        Self { muscles: muscles.collect(), pads: pads(body, chart, fatness) }
    }

    /// Moves a zero-pose surface as the pose makes flesh move.
    pub(super) fn move_with(
        &self,
        vertices: &mut [Vec3],
        theta: &[Vec3; JOINT_COUNT],
        rest_joints: &[Vec3; JOINT_COUNT],
    ) {
        let rotations = bends(theta).map(|bend| bend + Mat3::IDENTITY);
        for muscle in &self.muscles {
            let work = muscle.works.in_pose(&rotations, theta);
            if work != 0.0 {
                for &(vertex, displacement) in &muscle.swelling {
                    vertices[vertex as usize] += displacement * work;
                }
            }
        }
        let (bones, _) = BoneTransforms::from_rotations(&rotations, rest_joints);
        for pad in &self.pads {
            let bone = Mat3::from(bones.0[pad.bone].matrix3);
            // Gravity as the bone feels it; standing upright it is what the surface was measured in.
            let turned = bone.transpose() * Vec3::NEG_Y - Vec3::NEG_Y;
            for &(vertex, hang_m) in &pad.hang_m {
                vertices[vertex as usize] += turned * hang_m;
            }
        }
    }
}

impl Work {
    fn in_pose(self, rotations: &[Mat3; JOINT_COUNT], theta: &[Vec3; JOINT_COUNT]) -> f32 {
        match self {
            Self::Flexion { joint, full_rad } => {
                smoothstep(0.0, 1.0, theta[joint].length() / full_rad)
            }
            Self::Raised { side } => {
                let along = if side == 0 { Vec3::X } else { Vec3::NEG_X };
                let arm = rotations[13 + side] * rotations[16 + side] * along;
                arm.y.clamp(-1.0, 1.0)
            }
        }
    }
}

/// Biceps, calf, thigh, seat and shoulder of one side.
fn bellies(side: usize) -> [Belly; 5] {
    let flexion = |joint: usize, full_rad: f32| Work::Flexion { joint: joint + side, full_rad };
    [
        Belly {
            works: flexion(18, 2.0),
            bone: [16 + side, 18 + side],
            along: 0.55,
            aside: vec3(0.0, 0.0, 0.05),
            reach_m: 0.06,
            height_m: 0.009,
        },
        Belly {
            works: flexion(7, 0.6),
            bone: [4 + side, 7 + side],
            along: 0.28,
            aside: vec3(0.0, 0.0, -0.05),
            reach_m: 0.07,
            height_m: 0.006,
        },
        Belly {
            works: flexion(4, 1.6),
            bone: [1 + side, 4 + side],
            along: 0.55,
            aside: vec3(0.0, 0.0, 0.07),
            reach_m: 0.11,
            height_m: 0.007,
        },
        Belly {
            works: flexion(1, 1.6),
            bone: [1 + side, 4 + side],
            along: -0.02,
            aside: vec3(0.0, 0.0, -0.11),
            reach_m: 0.09,
            height_m: -0.010,
        },
        Belly {
            works: Work::Raised { side },
            bone: [13 + side, 16 + side],
            along: 0.85,
            aside: vec3(0.0, 0.05, 0.0),
            reach_m: 0.06,
            height_m: 0.008,
        },
    ]
}

impl Belly {
    fn swelling(&self, body: &BodyModel, chart: &Chart, strength: f32) -> Vec<(u32, Vec3)> {
        let [from, to] = self.bone;
        let center = between(&chart.joints, from, to, self.along) + self.aside;
        around(chart, center, self.reach_m)
            .filter(|(v, _)| {
                // The other leg is not this one's muscle, however near it is.
                let skinning = &body.skinning[*v as usize];
                let mut bones = skinning.bones.iter().zip(&skinning.weights);
                bones.any(|(&bone, &weight)| weight > 0.2 && [from, to].contains(&(bone as usize)))
            })
            .map(|(v, share)| {
                (
                    v,
                    chart.normals[v as usize] * share * self.height_m * strength,
                )
            })
            .collect()
    }
}

/// Belly, chest and seat.
fn pads(body: &BodyModel, chart: &Chart, fatness: f32) -> Vec<Pad> {
    let joints = &chart.joints;
    let of_trunk = |v: u32| {
        let place = &chart.places[v as usize];
        place.arm_share < 0.5 && place.leg_share < 0.8
    };
    let pad = |bone: usize, center: Vec3, reach_m: f32, hang_m: f32| Pad {
        bone,
        hang_m: around(chart, center, reach_m)
            .filter(|(v, _)| of_trunk(*v))
            .map(|(v, share)| (v, share * hang_m * fatness))
            .collect(),
    };
    debug_assert_eq!(body.vertex_count(), chart.vertices.len());
    let belly = between(joints, 0, 3, 0.4) + vec3(0.0, 0.0, 0.13);
    let mut pads = vec![pad(3, belly, 0.13, 0.016)];
    for side in [-1.0, 1.0] {
        let chest = joints[9] + vec3(0.09 * side, 0.0, 0.12);
        pads.push(pad(9, chest, 0.07, 0.009));
        let seat = joints[0] + vec3(0.09 * side, -0.06, -0.12);
        pads.push(pad(0, seat, 0.09, 0.007));
    }
    pads
}

/// Vertices around a centre and how much they belong to it.
fn around(chart: &Chart, center: Vec3, reach_m: f32) -> impl Iterator<Item = (u32, f32)> {
    chart
        .vertices
        .iter()
        .enumerate()
        .filter_map(move |(v, vertex)| {
            let away2 = vertex.distance_squared(center) / (reach_m * reach_m);
            (away2 < 6.0).then(|| (v as u32, (-0.5 * away2).exp()))
        })
}
