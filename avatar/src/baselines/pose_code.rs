//! A pose as numbers without anything learned: 23 unit quaternions (the paper's ablations).

use effigy_registration::smpl::JOINT_COUNT;
use glam::Quat;

use crate::PoseInput;

/// Numbers of all joints but the root.
pub(crate) const QUATERNION_NUMBERS: usize = 4 * (JOINT_COUNT - 1);

/// Relative joint rotations, root left out, each with a real part that is not negative.
pub(crate) fn quaternions(pose: &PoseInput) -> Vec<f32> {
    let turns = pose.rotations[1..].iter().map(|rotation| {
        let turn = Quat::from_mat3(rotation);
        if turn.w < 0.0 { -turn } else { turn }
    });
    turns.flat_map(|turn| turn.to_array()).collect()
}
