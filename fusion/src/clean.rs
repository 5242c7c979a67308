//! A frame made metric, denoised, and reduced to the person.

use effigy_capture::{FrameId, Timestamp};
use glam::Vec3;

use crate::maps::{DepthMap, NormalMap, VertexMap};

/// One frame's clean geometry in the depth camera's space; all maps have one size.
#[derive(Clone, Debug)]
pub struct CleanFrame {
    pub id: FrameId,
    pub timestamp: Timestamp,
    pub depth: DepthMap,
    pub vertices: VertexMap,
    pub normals: NormalMap,
    /// Pixels that belong to the person being followed.
    pub person: Vec<bool>,
    /// Standard deviation of each pixel's depth, in metres.
    pub sigma_m: Vec<f32>,
    /// The floor, where enough of it is seen.
    pub floor: Option<FloorPlane>,
    pub visibility: PersonVisibility,
}

/// Points `p` with `normal . p = offset_m`; the normal points up, away from the floor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FloorPlane {
    pub normal: Vec3,
    pub offset_m: f32,
}

/// How much of a person the camera has in view.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PersonVisibility {
    Nobody,
    /// The image border or the working volume cuts the body.
    Partial,
    Whole,
}
