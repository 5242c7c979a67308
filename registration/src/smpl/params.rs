//! What makes one body at one moment.

use glam::Vec3;
use serde::{Deserialize, Serialize};

use super::JOINT_COUNT;

/// Shape, pose and place. `theta` is axis-angle in radians, the root's about the pelvis;
/// `trans` is metres in the space the body stands in (world, unless a name says otherwise).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct BodyParams {
    pub betas: [f32; 10],
    pub theta: [Vec3; JOINT_COUNT],
    pub trans: Vec3,
}

impl BodyParams {
    /// The average body in SMPL's zero pose at the origin.
    pub const ZERO: Self =
        Self { betas: [0.0; 10], theta: [Vec3::ZERO; JOINT_COUNT], trans: Vec3::ZERO };
}
