//! Triangle meshes and what one asks of them.

pub mod closest_point;
pub mod components;
pub mod marching_cubes;

pub mod normals;
pub mod ply;
pub mod primitives;
pub mod sample;
pub mod topology;
pub mod z_buffer;

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

impl TriangleMesh {
    /// A bare mesh: no normals, no colours.
    pub fn new(vertices: Vec<Vec3>, triangles: Vec<[u32; 3]>) -> Self {
        Self { vertices, triangles, ..Self::default() }
    }

    /// The corners of one triangle.
    pub fn corners(&self, triangle: usize) -> [Vec3; 3] {
        self.triangles[triangle].map(|vertex| self.vertices[vertex as usize])
    }

    /// Whether every triangle names three vertices that exist.
    pub fn indices_are_valid(&self) -> bool {
        let count = self.vertices.len();
        self.triangles
            .iter()
            .flatten()
            .all(|&vertex| (vertex as usize) < count)
    }
}
