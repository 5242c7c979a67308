//! What the hypernetwork is told about a pose.

use effigy_registration::smpl::{JOINT_COUNT, UnitBox, rotation_from_axis_angle};
use glam::{Mat3, Vec3};

/// 24 rotations, the root's replaced by identity, and the zero-pose joints in unit space
/// (seed-systems: bone encoder, 216 + 72 numbers).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PoseInput {
    pub rotations: [Mat3; JOINT_COUNT],
    pub joints_in_unit: [Vec3; JOINT_COUNT],
}

impl PoseInput {
    pub fn new(
        theta: &[Vec3; JOINT_COUNT],
        rest_joints: &[Vec3; JOINT_COUNT],
        unit_box: &UnitBox,
    ) -> Self {
        let mut rotations = theta.map(rotation_from_axis_angle);
        rotations[0] = Mat3::IDENTITY;
        let joints_in_unit = rest_joints.map(|joint| unit_box.unit_from_canonical(joint));
        Self { rotations, joints_in_unit }
    }
}
