//! Motion: sequences of SMPL poses, and the files they come from.

use glam::Vec3;

/// A sequence of poses at a fixed rate. `trans` is metres in the world (y up).
#[derive(Clone, Debug, PartialEq)]
pub struct Motion {
    pub name: String,
    pub rate_hz: f32,
    pub poses: Vec<MotionPose>,
}

/// One pose: axis-angle for each SMPL joint, radians.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotionPose {
    pub theta: [Vec3; 24],
    pub trans: Vec3,
}
