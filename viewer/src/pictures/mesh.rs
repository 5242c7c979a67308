//! A borrowed mesh, whatever type it lives in.

use effigy_fusion::{TriangleMesh, mesh::normals::vertex_normals};
use glam::Vec3;

use crate::snapshot::{AvatarView, BodyView};

/// What is drawn, in world space.
#[derive(Clone, Copy, Debug)]
pub struct MeshView<'a> {
    pub vertices: &'a [Vec3],
    /// One unit normal a vertex, or none: then they are computed.
    pub normals: &'a [Vec3],
    pub triangles: &'a [[u32; 3]],
    /// One sRGB colour a vertex, or none: then it is clay.
    pub colors: &'a [[u8; 3]],
}

impl<'a> MeshView<'a> {
    pub fn new(vertices: &'a [Vec3], triangles: &'a [[u32; 3]]) -> Self {
        Self { vertices, normals: &[], triangles, colors: &[] }
    }

    /// Normals as long as the vertices: the mesh's own, or area-weighted means of its triangles'.
    pub(crate) fn normals_or_computed(&self) -> Vec<Vec3> {
        if self.normals.len() == self.vertices.len() {
            return self.normals.to_vec();
        }
        vertex_normals(self.vertices, self.triangles)
    }
}

impl<'a> From<&'a TriangleMesh> for MeshView<'a> {
    fn from(mesh: &'a TriangleMesh) -> Self {
        let TriangleMesh { vertices, normals, triangles, colors } = mesh;
        Self { vertices, normals, triangles, colors }
    }
}

impl<'a> From<&'a AvatarView> for MeshView<'a> {
    fn from(avatar: &'a AvatarView) -> Self {
        Self {
            vertices: &avatar.vertices,
            normals: &avatar.normals,
            triangles: &avatar.triangles,
            colors: &avatar.colors,
        }
    }
}

impl<'a> From<&'a BodyView> for MeshView<'a> {
    fn from(body: &'a BodyView) -> Self {
        Self::new(&body.vertices, &body.triangles)
    }
}
