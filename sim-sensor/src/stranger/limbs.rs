//! The joints that everybody has, whatever the skeleton: where they are, and how far an estimate is from them.

use effigy_registration::smpl::JOINT_COUNT;
use glam::{Quat, Vec3};

/// Hips, knees, ankles, shoulders, elbows and wrists by SMPL's numbers, left before right.
pub const LIMB_JOINTS: [usize; 12] = [1, 2, 4, 5, 7, 8, 16, 17, 18, 19, 20, 21];

/// A joint in world space, and how its bone is turned from SMPL's zero pose.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LimbJoint {
    pub position: Vec3,
    pub rotation: Quat,
}

/// Mean distance of estimated joints from true ones, over frames, for each limb joint.
///
/// Skeletons disagree about where in the flesh a joint is. That is a constant offset in the bone's own axes, which is
/// measured over all frames and removed. Estimates are SMPL's 24 joints in the truth's world space.
pub fn limb_errors_m(
    frames: &[([Vec3; JOINT_COUNT], [LimbJoint; LIMB_JOINTS.len()])],
) -> [f32; LIMB_JOINTS.len()] {
    let count = frames.len().max(1) as f32;
    std::array::from_fn(|limb| {
        let offsets: Vec<Vec3> = frames
            .iter()
            .map(|(estimated, truth)| {
                let off = estimated[LIMB_JOINTS[limb]] - truth[limb].position;
                truth[limb].rotation.inverse() * off
            })
            .collect();
        let constant = offsets.iter().sum::<Vec3>() / count;
        offsets
            .iter()
            .map(|offset| offset.distance(constant))
            .sum::<f32>()
            / count
    })
}
