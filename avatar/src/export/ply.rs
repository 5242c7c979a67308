//! A posed avatar as a PLY mesh.

use std::path::Path;

use effigy_capture::Rigid3;
use effigy_fusion::{FusionError, TriangleMesh, mesh::ply};

use crate::drive::AvatarMesh;

/// Writes the posed mesh with its normals, moved by `target_from_world`.
pub fn write_ply(
    path: &Path,
    mesh: &AvatarMesh,
    target_from_world: Rigid3,
) -> Result<(), FusionError> {
    let mesh = TriangleMesh {
        vertices: mesh
            .vertices
            .iter()
            .map(|&vertex| target_from_world * vertex)
            .collect(),
        normals: mesh
            .normals
            .iter()
            .map(|&normal| target_from_world.rotate(normal))
            .collect(),
        triangles: mesh.triangles.to_vec(),
        colors: Vec::new(),
    };
    ply::write(path, &mesh, ply::Encoding::BinaryLittleEndian)
}
