//! The star pose: SMPL's zero pose with each leg turned 45 degrees outwards about its hip.

use glam::{Affine3A, Quat, Vec3};

use super::{JOINT_COUNT, lbs::BoneTransforms};

/// The angle each leg is turned about z (MetaAvatar's canonical pose).
pub const STAR_HALF_ANGLE_RAD: f32 = std::f32::consts::FRAC_PI_4;

const LEFT_LEG: [usize; 4] = [1, 4, 7, 10];
const RIGHT_LEG: [usize; 4] = [2, 5, 8, 11];

/// For each bone, rest space to canonical (star pose) space: each leg is one rigid piece.
pub fn star_transforms(rest_joints: &[Vec3; JOINT_COUNT]) -> BoneTransforms {
    let mut bones = BoneTransforms::IDENTITY;
    for (leg, angle) in [
        (LEFT_LEG, STAR_HALF_ANGLE_RAD),
        (RIGHT_LEG, -STAR_HALF_ANGLE_RAD),
    ] {
        let hip = rest_joints[leg[0]];
        let about_hip = Affine3A::from_translation(hip)
            * Affine3A::from_quat(Quat::from_rotation_z(angle))
            * Affine3A::from_translation(-hip);
        for bone in leg {
            bones.0[bone] = about_hip;
        }
    }
    bones
}
