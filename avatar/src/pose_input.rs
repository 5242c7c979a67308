//! What the hypernetwork is told about a pose.

use effigy_registration::smpl::{
    JOINT_COUNT, UnitBox, mirror::MIRROR_JOINT, rotation_from_axis_angle,
};
use glam::{Mat3, Vec3};

/// 24 rotations, the root's replaced by identity, and the zero-pose joints in unit space
/// (what MetaAvatar's bone encoder takes: 216 + 72 numbers).
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

    /// The pose of whoever looks back from a mirror: left is right. It is the same person, so their joints stay.
    #[must_use]
    pub(crate) fn mirrored(&self) -> Self {
        let flip = Mat3::from_diagonal(across(Vec3::ONE));
        let rotations = MIRROR_JOINT.map(|other| flip * self.rotations[other] * flip);
        Self { rotations, ..*self }
    }

    /// Where this body's left meets its right.
    pub(crate) fn midplane(&self) -> Midplane {
        let sum: f32 = self.joints_in_unit.iter().map(|joint| joint.x).sum();
        Midplane { x_in_unit: sum / JOINT_COUNT as f32 }
    }
}

/// The plane between a body's left and right sides in unit space, through the mean of its joints.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Midplane {
    x_in_unit: f32,
}

impl Midplane {
    /// A point's mirror image; both in unit space.
    pub(crate) fn mirrored(self, point: Vec3) -> Vec3 {
        across(point) + Vec3::X * (2.0 * self.x_in_unit)
    }
}

/// A direction's mirror image.
pub(crate) fn across(direction: Vec3) -> Vec3 {
    Vec3::new(-direction.x, direction.y, direction.z)
}

#[cfg(test)]
mod tests {
    use effigy_registration::smpl::builtin;

    use super::*;
    use crate::Subject;

    #[test]
    fn a_mirrored_pose_is_that_of_the_mirrored_rotations() {
        let body = builtin::body();
        let subject = Subject::new(&body, &[0.5; 10]).unwrap();
        let mut theta = [Vec3::ZERO; JOINT_COUNT];
        theta[16] = Vec3::new(0.2, -0.4, 0.7);
        theta[5] = Vec3::new(1.1, 0.1, 0.0);
        let mut other = [Vec3::ZERO; JOINT_COUNT];
        // A rotation's axis is a pseudovector.
        other[17] = Vec3::new(0.2, 0.4, -0.7);
        other[4] = Vec3::new(1.1, -0.1, 0.0);
        let (found, expected) = (
            subject.pose_input(&theta).mirrored(),
            subject.pose_input(&other),
        );
        for (joint, (found, expected)) in
            found.rotations.iter().zip(&expected.rotations).enumerate()
        {
            assert!(found.abs_diff_eq(*expected, 1e-6), "joint {joint}");
        }
        assert_eq!(found.mirrored(), subject.pose_input(&theta));
    }

    #[test]
    fn the_midplane_sends_each_joint_to_its_other_side() {
        let body = builtin::body();
        let subject = Subject::new(&body, &[-0.7; 10]).unwrap();
        let pose = subject.pose_input(&[Vec3::ZERO; JOINT_COUNT]);
        for (joint, other) in MIRROR_JOINT.into_iter().enumerate() {
            let image = pose.midplane().mirrored(pose.joints_in_unit[joint]);
            let expected = pose.joints_in_unit[other];
            assert!(image.abs_diff_eq(expected, 1e-5), "{joint}: {image}");
        }
    }
}
