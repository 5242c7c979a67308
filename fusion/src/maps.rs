//! Per-pixel geometry in the depth camera's space, row-major; NaN means "no measurement".

use glam::Vec3;

/// Depth along the optical axis, in metres.
#[derive(Clone, Debug, PartialEq)]
pub struct DepthMap {
    pub width: usize,
    pub height: usize,
    pub metres: Vec<f32>,
}

/// The point seen by each pixel, in metres.
#[derive(Clone, Debug, PartialEq)]
pub struct VertexMap {
    pub width: usize,
    pub height: usize,
    pub points: Vec<Vec3>,
}

/// The unit normal at each pixel, towards the camera.
#[derive(Clone, Debug, PartialEq)]
pub struct NormalMap {
    pub width: usize,
    pub height: usize,
    pub normals: Vec<Vec3>,
}
