//! Triangle meshes and what one asks of them.

use glam::Vec3;

/// An indexed triangle mesh; counter-clockwise triangles face outwards.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TriangleMesh {
    pub vertices: Vec<Vec3>,
    /// One unit normal a vertex, or none at all.
    pub normals: Vec<Vec3>,
    pub triangles: Vec<[u32; 3]>,
    /// One sRGB colour a vertex, or none at all.
    pub colors: Vec<[u8; 3]>,
}
