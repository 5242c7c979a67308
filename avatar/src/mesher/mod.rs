//! The zero level of a field as a watertight mesh, from values near the surface only.
//!
//! A coarse lattice finds places where the sign changes; from there the surface is followed cell by cell
//! on the fine lattice. So a field is asked for about as many values as the mesh has triangles, and a
//! connected surface comes out whole however steep or flat the field is. What can be missed is a separate
//! piece thinner than a coarse cell; of the pieces found, the one with the most triangles is kept.

mod lattice;
mod relax;

use effigy_fusion::{
    TriangleMesh,
    mesh::{components::largest_component, marching_cubes::marching_cubes_sparse},
};
use glam::Vec3;

use crate::sdf::SignedDistanceField;
use lattice::Lattice;
pub(crate) use relax::FieldAt;
pub use relax::relax;

/// The largest piece of the zero level in `[-1, 1]^3`, normals included; empty if there is none.
///
/// The lattice has `resolution` points a side, both ends included: spacing `2 / (resolution - 1)`
/// (as MetaAvatar meshes). A surface that leaves the cube is closed at the cube's wall.
pub fn extract(sdf: &dyn SignedDistanceField, resolution: usize) -> TriangleMesh {
    let resolution = resolution.clamp(4, MAX_RESOLUTION);
    let mut lattice = Lattice::new(sdf, resolution);
    let cells = lattice.surface_cells();
    tracing::debug!(
        resolution,
        cells = cells.len(),
        values = lattice.evaluated(),
        "extracted"
    );
    let surface = marching_cubes_sparse(
        cells.iter().map(|&cell| lattice.coordinates(cell)),
        |point| lattice.value(lattice.point(point)),
        Vec3::NEG_ONE,
        2.0 / (resolution - 1) as f32,
    );
    let mut mesh = largest_component(&surface);
    mesh.compute_normals();
    mesh
}

/// 512 points a side take 0.5 GiB of address space, of which what lies near the surface is touched.
const MAX_RESOLUTION: usize = 512;

#[cfg(test)]
mod tests;
