//! The ten betas: how the body grows, bone by bone, for one standard deviation each.

use glam::{Vec3, vec3};

use super::{mirrored, on_grid, skinning::Skin};
use crate::smpl::{JOINT_COUNT, PARENTS};

/// Bones that grow alike, and their growth along x, y, z (a share of the length). In the zero pose arms lie
/// along x, trunk and legs along y, feet along z.
type Growth = (&'static [usize], [f32; 3]);

const PELVIS: &[usize] = &[0];
const BELLY: &[usize] = &[3];
const WAIST: &[usize] = &[3, 6];
const CHEST: &[usize] = &[9, 13, 14];
const TRUNK: &[usize] = &[0, 3, 6, 9, 13, 14];
const NECK: &[usize] = &[12];
const HEAD: &[usize] = &[15];
const THIGHS: &[usize] = &[1, 2];
const SHANKS: &[usize] = &[4, 5];
const FEET: &[usize] = &[7, 8, 10, 11];
const UPPER_ARMS: &[usize] = &[16, 17];
const FOREARMS: &[usize] = &[18, 19];
const HANDS: &[usize] = &[20, 21, 22, 23];

/// A soft swelling: centre on the left (millimetres, rest space), its reach along x, y, z, and the push.
struct Bump {
    center: Vec3,
    reach: Vec3,
    push: Vec3,
}

struct Shape {
    growth: &'static [Growth],
    bumps: &'static [Bump],
}

/// Sources of the figures: `docs/body.md`.
const SHAPES: [Shape; 10] = [
    // 0: size. Stature varies by 4 % (7 cm); heads vary less.
    Shape {
        growth: &[
            (TRUNK, [0.035, 0.04, 0.035]),
            (NECK, [0.035, 0.04, 0.035]),
            (HEAD, [0.015, 0.02, 0.015]),
            (THIGHS, [0.03, 0.043, 0.03]),
            (SHANKS, [0.03, 0.043, 0.03]),
            (FEET, [0.035, 0.04, 0.04]),
            (UPPER_ARMS, [0.042, 0.03, 0.03]),
            (FOREARMS, [0.042, 0.03, 0.03]),
            (HANDS, [0.04, 0.035, 0.035]),
        ],
        bumps: &[],
    },
    // 1: weight at the same stature.
    Shape {
        growth: &[
            (PELVIS, [0.07, 0.0, 0.08]),
            (WAIST, [0.09, 0.0, 0.12]),
            (CHEST, [0.05, 0.0, 0.08]),
            (NECK, [0.06, 0.0, 0.06]),
            (HEAD, [0.015, 0.0, 0.01]),
            (THIGHS, [0.075, 0.0, 0.075]),
            (SHANKS, [0.06, 0.0, 0.06]),
            (FEET, [0.02, 0.0, 0.0]),
            (UPPER_ARMS, [0.0, 0.08, 0.08]),
            (FOREARMS, [0.0, 0.055, 0.055]),
            (HANDS, [0.0, 0.03, 0.02]),
        ],
        bumps: &[Bump {
            center: vec3(0.0, -0.1, 0.15),
            reach: vec3(0.16, 0.14, 0.12),
            push: vec3(0.0, -0.002, 0.012),
        }],
    },
    // 2: from the build of men towards that of women; half the difference of the means.
    Shape {
        growth: &[
            (PELVIS, [0.02, -0.03, 0.0]),
            (WAIST, [-0.04, -0.035, -0.05]),
            (CHEST, [-0.055, -0.035, -0.045]),
            (NECK, [-0.07, -0.02, -0.07]),
            (HEAD, [-0.02, -0.025, -0.02]),
            (THIGHS, [0.015, -0.037, 0.0]),
            (SHANKS, [-0.015, -0.037, -0.02]),
            (FEET, [-0.05, -0.045, -0.05]),
            (UPPER_ARMS, [-0.04, -0.07, -0.07]),
            (FOREARMS, [-0.045, -0.07, -0.07]),
            (HANDS, [-0.045, -0.05, -0.05]),
        ],
        bumps: &[
            Bump {
                center: vec3(0.085, 0.085, 0.13),
                reach: vec3(0.06, 0.06, 0.08),
                push: vec3(0.002, -0.002, 0.011),
            },
            Bump {
                center: vec3(0.16, -0.27, -0.02),
                reach: vec3(0.07, 0.1, 0.12),
                push: vec3(0.006, 0.0, 0.0),
            },
        ],
    },
    // 3: longer legs under a shorter trunk, same stature.
    Shape {
        growth: &[
            (THIGHS, [0.0, 0.027, 0.0]),
            (SHANKS, [0.0, 0.027, 0.0]),
            (TRUNK, [0.0, -0.035, 0.0]),
            (NECK, [0.0, -0.02, 0.0]),
        ],
        bumps: &[],
    },
    // 4: longer arms.
    Shape {
        growth: &[
            (UPPER_ARMS, [0.027, 0.0, 0.0]),
            (FOREARMS, [0.027, 0.0, 0.0]),
            (HANDS, [0.025, 0.01, 0.01]),
        ],
        bumps: &[],
    },
    // 5: wider shoulders.
    Shape { growth: &[(CHEST, [0.045, 0.0, 0.0]), (&[6], [0.015, 0.0, 0.0])], bumps: &[] },
    // 6: wider hips.
    Shape {
        growth: &[
            (PELVIS, [0.05, 0.0, 0.01]),
            (BELLY, [0.02, 0.0, 0.0]),
            (THIGHS, [0.03, 0.0, 0.02]),
        ],
        bumps: &[],
    },
    // 7: a deeper belly.
    Shape {
        growth: &[(WAIST, [0.015, 0.0, 0.02])],
        bumps: &[Bump {
            center: vec3(0.0, -0.1, 0.16),
            reach: vec3(0.15, 0.13, 0.12),
            push: vec3(0.0, -0.004, 0.024),
        }],
    },
    // 8: more muscle on limbs, chest and neck.
    Shape {
        growth: &[
            (WAIST, [-0.01, 0.0, -0.015]),
            (CHEST, [0.015, 0.0, 0.03]),
            (NECK, [0.05, 0.0, 0.05]),
            (THIGHS, [0.04, 0.0, 0.045]),
            (SHANKS, [0.045, 0.0, 0.05]),
            (UPPER_ARMS, [0.0, 0.07, 0.07]),
            (FOREARMS, [0.0, 0.055, 0.055]),
        ],
        bumps: &[],
    },
    // 9: a larger head.
    Shape { growth: &[(HEAD, [0.03, 0.028, 0.03]), (NECK, [0.02, 0.02, 0.02])], bumps: &[] },
];

/// Metres a unit of each beta; [10][V].
pub(super) fn shape_dirs(
    vertices: &[Vec3],
    skin: &Skin,
    joints: &[Vec3; JOINT_COUNT],
    mirror: &[u32],
) -> Vec<Vec<Vec3>> {
    SHAPES
        .iter()
        .map(|shape| {
            let field = Field::new(shape, joints);
            let moved: Vec<Vec3> = vertices
                .iter()
                .zip(&skin.shape_weights)
                .map(|(vertex, weights)| on_grid(field.at(*vertex, weights)))
                .collect();
            mirrored(&moved, mirror, |v| v * vec3(-1.0, 1.0, 1.0))
        })
        .collect()
}

/// One beta's displacement: every bone grows about its joint and carries the joints after it.
pub(super) struct Field {
    rates: [Vec3; JOINT_COUNT],
    joints: [Vec3; JOINT_COUNT],
    moved_joints: [Vec3; JOINT_COUNT],
    bumps: &'static [Bump],
}

impl Field {
    fn new(shape: &Shape, joints: &[Vec3; JOINT_COUNT]) -> Self {
        let mut rates = [Vec3::ZERO; JOINT_COUNT];
        for (bones, growth) in shape.growth {
            for &bone in *bones {
                rates[bone] = Vec3::from_array(*growth);
            }
        }
        let mut moved_joints = [Vec3::ZERO; JOINT_COUNT];
        for joint in 1..JOINT_COUNT {
            let parent = PARENTS[joint];
            moved_joints[joint] =
                moved_joints[parent] + rates[parent] * (joints[joint] - joints[parent]);
        }
        Self { rates, joints: *joints, moved_joints, bumps: shape.bumps }
    }

    fn at(&self, vertex: Vec3, weights: &[f32; JOINT_COUNT]) -> Vec3 {
        let mut sum = Vec3::ZERO;
        for (joint, &weight) in weights.iter().enumerate().filter(|(_, w)| **w > 0.0) {
            let grown = self.rates[joint] * (vertex - self.joints[joint]);
            sum += (self.moved_joints[joint] + grown) * weight;
        }
        for bump in self.bumps {
            sum += bump.at(vertex);
        }
        sum
    }
}

impl Bump {
    /// The push, fading to nothing at the reach; the same on the other side for one off the midline.
    fn at(&self, vertex: Vec3) -> Vec3 {
        let side = if vertex.x < 0.0 { -1.0 } else { 1.0 };
        let offset = (vertex * vec3(side, 1.0, 1.0) - self.center) / (self.reach * 1.6);
        let inside = (1.0 - offset.length_squared()).max(0.0);
        self.push * vec3(side, 1.0, 1.0) * (inside * inside)
    }
}

#[cfg(test)]
mod tests {
    use super::{Field, SHAPES};
    use crate::smpl::builtin::{body, joints::centres};

    #[test]
    fn regressed_joints_follow_the_shapes_within_five_millimetres() {
        let body = body();
        for (beta, shape) in SHAPES.iter().enumerate() {
            let designed = Field::new(shape, &centres()).moved_joints;
            for (joint, row) in body.joint_regressor.iter().enumerate() {
                let regressed = row.apply(&body.shape_dirs[beta]);
                let off_mm = 1e3 * regressed.distance(designed[joint]);
                assert!(off_mm < 5.0, "beta {beta}, joint {joint}: {off_mm:.1} mm");
            }
        }
    }
}
