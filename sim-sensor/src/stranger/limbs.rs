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

/// What SMPL's 24 joints are estimated to be in the truth's world space, and where the limbs' joints are.
pub type EstimatedLimbs = ([Vec3; JOINT_COUNT], [LimbJoint; LIMB_JOINTS.len()]);

/// In each frame, the distance of estimated joints from true ones.
///
/// Skeletons disagree about where in the flesh a joint is. That is a constant offset in the bone's own axes, which is
/// measured over all frames and removed.
pub fn limb_errors_m(frames: &[EstimatedLimbs]) -> Vec<[f32; LIMB_JOINTS.len()]> {
    let offsets: Vec<_> = frames.iter().map(offsets).collect();
    let count = offsets.len().max(1) as f32;
    let constant: [Vec3; LIMB_JOINTS.len()] = std::array::from_fn(|limb| {
        let sum: Vec3 = offsets.iter().map(|offsets| offsets[limb]).sum();
        sum / count
    });
    let errors = |offsets: &[Vec3; LIMB_JOINTS.len()]| {
        std::array::from_fn(|limb| offsets[limb].distance(constant[limb]))
    };
    offsets.iter().map(errors).collect()
}

/// How far off each joint is, in its bone's axes.
fn offsets((estimated, truth): &EstimatedLimbs) -> [Vec3; LIMB_JOINTS.len()] {
    std::array::from_fn(|limb| {
        let off = estimated[LIMB_JOINTS[limb]] - truth[limb].position;
        truth[limb].rotation.inverse() * off
    })
}
