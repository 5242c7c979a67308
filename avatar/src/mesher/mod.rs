//! The zero level of a field as a watertight mesh, from values near the surface only.
//!
//! A coarse lattice finds places where the sign changes; from there the surface is followed cell by cell
//! on the fine lattice. So a field is asked for about as many values as the mesh has triangles, and a
//! connected surface comes out whole however steep or flat the field is. What can be missed is a separate
//! piece thinner than a coarse cell; of the pieces found, the one with the most triangles is kept.

mod cube;
mod lattice;
mod relax;

use effigy_fusion::{TriangleMesh, mesh::components::largest_component};
use glam::Vec3;
use rustc_hash::FxHashMap;

use crate::sdf::SignedDistanceField;
use cube::CubeTable;
use lattice::Lattice;
pub(crate) use relax::FieldAt;
pub use relax::relax;

/// The largest piece of the zero level in `[-1, 1]^3`, normals included; empty if there is none.
///
/// The lattice has `resolution` points a side, both ends included: spacing `2 / (resolution - 1)`
/// (seed-systems.md 1.9). A surface that leaves the cube is closed at the cube's wall.
pub fn extract(sdf: &dyn SignedDistanceField, resolution: usize) -> TriangleMesh {
    let mut lattice = Lattice::new(sdf, resolution.clamp(4, MAX_RESOLUTION));
    let cells = lattice.surface_cells();
    tracing::debug!(
        resolution,
        cells = cells.len(),
        values = lattice.evaluated(),
        "extracted"
    );
    let mut mesh = largest_component(&polygonise(&lattice, &cells));
    mesh.compute_normals();
    mesh
}

/// 512 points a side take 0.5 GiB of address space, of which what lies near the surface is touched.
const MAX_RESOLUTION: usize = 512;

/// A crossing keeps this share of an edge away from both ends, so that no triangle degenerates.
const MIN_SHARE: f32 = 1e-3;

/// Marching cubes over the given cells; crossings are shared, so the mesh is closed where the cells are.
fn polygonise(lattice: &Lattice<'_>, cells: &[u32]) -> TriangleMesh {
    let table = CubeTable::get();
    let mut mesh = TriangleMesh::default();
    let mut vertex_of_edge = FxHashMap::default();
    for &cell in cells {
        let corners = lattice.corners(cell);
        for polygon in table.polygons(lattice.inside_mask(&corners)) {
            let vertices: Vec<u32> = polygon
                .edges
                .iter()
                .map(|&edge| {
                    let [a, b] = table.edge_corners(edge).map(|corner| corners[corner]);
                    *vertex_of_edge.entry((a, b)).or_insert_with(|| {
                        mesh.vertices.push(crossing(lattice, a, b));
                        mesh.vertices.len() as u32 - 1
                    })
                })
                .collect();
            push_fan(&mut mesh, &vertices, &polygon.fan_starts);
        }
    }
    mesh
}

/// Where the field is zero between two neighbouring lattice points, linearly.
fn crossing(lattice: &Lattice<'_>, a: u32, b: u32) -> Vec3 {
    let (value_a, value_b) = (lattice.value(a), lattice.value(b));
    let share = (value_a / (value_a - value_b)).clamp(MIN_SHARE, 1.0 - MIN_SHARE);
    lattice.position(a).lerp(lattice.position(b), share)
}

/// Triangles around the allowed start whose diagonals are shortest.
fn push_fan(mesh: &mut TriangleMesh, vertices: &[u32], fan_starts: &[u8]) {
    let count = vertices.len();
    let at = |index: usize| mesh.vertices[vertices[index % count] as usize];
    let diagonals = |start: usize| -> f32 {
        (2..count - 1)
            .map(|step| at(start).distance_squared(at(start + step)))
            .sum()
    };
    let start = fan_starts
        .iter()
        .map(|&start| usize::from(start))
        .min_by(|&a, &b| diagonals(a).total_cmp(&diagonals(b)))
        .expect("every polygon of the table has a start");
    for step in 1..count - 1 {
        mesh.triangles
            .push([0, step, step + 1].map(|offset| vertices[(start + offset) % count]));
    }
}

#[cfg(test)]
mod tests;
