//! What a keyframe teaches the field.

use effigy_registration::smpl::JOINT_COUNT;
use glam::Vec3;

use crate::pose_input::PoseInput;

/// One keyframe's points, canonicalised, in unit space.
#[derive(Clone, Debug)]
pub struct CanonicalSamples {
    pub theta: [Vec3; JOINT_COUNT],
    pub pose: PoseInput,
    pub points_in_unit: Vec<Vec3>,
    /// Unit normals at the points, outwards; zero where the sensor gave none.
    pub normals: Vec<Vec3>,
    /// Say of each point by the sensor's sigma and the slant of its surface; those that failed the re-projection test are
    /// not among them.
    pub weights: Vec<f32>,
    /// Points that the sensor saw to be empty, between camera and surface or beside the person: the field is positive
    /// there.
    pub free_in_unit: Vec<Vec3>,
}
