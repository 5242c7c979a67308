//! The zero surface of values on a grid, as a mesh (Lorensen and Cline 1987), closed wherever the values are.
//!
//! Positive is outside. Neighbouring cells share their vertices and always agree about their common face, so
//! the mesh has no cracks, and each edge inside the grid has exactly two triangles.

mod table;

use glam::{IVec3, Vec3, ivec3};
use rustc_hash::FxHashMap;

use self::table::TABLE;
use super::TriangleMesh;

/// A vertex keeps this share of its edge away from both ends: triangles then never shrink to nothing, and
/// the shift is a thousandth of a cell.
const MARGIN: f32 = 1e-3;

/// Extracts the zero surface from a dense grid.
///
/// `values[x + dims[0] * (y + dims[1] * z)]` belongs to the point `origin + spacing * (x, y, z)`. Cells with
/// a value that is NaN are left open. The surface ends where the grid does.
///
/// # Panics
/// If there are not as many values as the dimensions say.
pub fn marching_cubes(
    values: &[f32],
    dims: [usize; 3],
    origin: Vec3,
    spacing: f32,
) -> TriangleMesh {
    let [columns, rows, layers] = dims;
    assert_eq!(
        values.len(),
        columns * rows * layers,
        "a grid of {dims:?} needs as many values"
    );
    let value_at = |corner: IVec3| {
        let [x, y, z] = corner.to_array().map(|coordinate| coordinate as usize);
        values[x + columns * (y + rows * z)]
    };
    let mut surface = Surface::new(origin, spacing);
    for z in 0..layers.saturating_sub(1) {
        for y in 0..rows.saturating_sub(1) {
            let starts = [(y, z), (y + 1, z), (y, z + 1), (y + 1, z + 1)]
                .map(|(y, z)| columns * (y + rows * z));
            // Bits 0, 2, 4, 6: which of the four corners at one x are inside.
            let inside_at = |x: usize| {
                (0..4).fold(0_u8, |mask, row| {
                    mask | u8::from(values[starts[row] + x] < 0.0) << (2 * row)
                })
            };
            let mut left = inside_at(0);
            for x in 1..columns {
                let right = inside_at(x);
                let mask = left | right << 1;
                left = right;
                if mask != 0 && mask != 255 {
                    surface.add_cell(ivec3(x as i32 - 1, y as i32, z as i32), value_at);
                }
            }
        }
    }
    surface.mesh
}

/// Extracts the zero surface from some cells of an endless grid: the sparse twin of [`marching_cubes`].
///
/// `value` is asked for the corners of each cell; a cell is named by its lowest corner, and lies within
/// -2^20..2^20. The surface is closed if all the cells it passes through are given.
pub fn marching_cubes_sparse(
    cells: impl IntoIterator<Item = IVec3>,
    value: impl Fn(IVec3) -> f32,
    origin: Vec3,
    spacing: f32,
) -> TriangleMesh {
    let mut surface = Surface::new(origin, spacing);
    for cell in cells {
        surface.add_cell(cell, &value);
    }
    surface.mesh
}

/// A mesh in the making.
struct Surface {
    mesh: TriangleMesh,
    vertex_of_edge: FxHashMap<u64, u32>,
    origin: Vec3,
    spacing: f32,
}

impl Surface {
    fn new(origin: Vec3, spacing: f32) -> Self {
        let mesh = TriangleMesh::default();
        Self { mesh, vertex_of_edge: FxHashMap::default(), origin, spacing }
    }

    fn add_cell(&mut self, cell: IVec3, value: impl Fn(IVec3) -> f32) {
        let values: [f32; 8] = std::array::from_fn(|corner| value(cell + table::offset(corner)));
        if values.iter().any(|value| value.is_nan()) {
            return;
        }
        let inside = (0..8).fold(0, |mask, corner| {
            mask | usize::from(values[corner] < 0.0) << corner
        });
        for triangle in TABLE[inside].triangles() {
            let corners = triangle.map(|edge| self.vertex(cell, edge as usize, &values));
            self.mesh.triangles.push(corners);
        }
    }

    /// The vertex on an edge of a cell, made at the first call for it.
    fn vertex(&mut self, cell: IVec3, edge: usize, values: &[f32; 8]) -> u32 {
        let [low, high] = table::ends(edge);
        let from = cell + table::offset(low);
        *self
            .vertex_of_edge
            .entry(key(from, edge / 4))
            .or_insert_with(|| {
                let share = values[low] / (values[low] - values[high]);
                // The quotient of two infinities; the middle is as good as any.
                let share = if share.is_nan() {
                    0.5
                } else {
                    share.clamp(MARGIN, 1.0 - MARGIN)
                };
                let mut place = from.as_vec3();
                place[edge / 4] += share;
                self.mesh.vertices.push(self.origin + self.spacing * place);
                self.mesh.vertices.len() as u32 - 1
            })
    }
}

/// A number for the edge that leaves a grid point along an axis.
fn key(from: IVec3, axis: usize) -> u64 {
    let [x, y, z] = from
        .to_array()
        .map(|coordinate| u64::from((coordinate + (1 << 20)) as u32));
    (x << 42 | y << 21 | z) << 2 | axis as u64
}

#[cfg(test)]
mod tests {
    use glam::vec3;

    use super::super::sample::{SplitMix, sample_surface};
    use super::*;

    const DIMS: [usize; 3] = [34, 36, 38];
    const ORIGIN: Vec3 = vec3(-0.5, -0.6, 0.4);
    const SPACING: f32 = 0.03;

    fn grid(distance: impl Fn(Vec3) -> f32) -> Vec<f32> {
        let mut values = Vec::new();
        for z in 0..DIMS[2] {
            for y in 0..DIMS[1] {
                for x in 0..DIMS[0] {
                    values.push(distance(
                        ORIGIN + SPACING * vec3(x as f32, y as f32, z as f32),
                    ));
                }
            }
        }
        values
    }

    #[test]
    fn extracted_sphere_is_closed_unshifted_and_faces_outwards() {
        let (center, radius) = (vec3(0.01, -0.04, 0.93), 0.35);
        let mut mesh = marching_cubes(
            &grid(|p| p.distance(center) - radius),
            DIMS,
            ORIGIN,
            SPACING,
        );
        assert!(mesh.is_watertight(), "{:?}", mesh.edge_report());
        for vertex in &mesh.vertices {
            // Linear interpolation along an edge errs by spacing^2 / (8 radius), a hundredth of a cell.
            assert!((vertex.distance(center) - radius).abs() < 0.02 * SPACING);
        }
        let samples = sample_surface(&mesh, 100_000, 0);
        let mean = samples.iter().map(|sample| sample.point).sum::<Vec3>() / 1e5;
        // Three standard deviations of the mean of so many points: radius / sqrt(3 * 100 000).
        assert!(mean.distance(center) < 3.0 * radius / 3e5_f32.sqrt());
        let ball = 4.0 / 3.0 * std::f32::consts::PI * radius.powi(3);
        assert!((mesh.volume() / ball - 1.0).abs() < 0.01);
        mesh.compute_normals();
        for (vertex, normal) in mesh.vertices.iter().zip(&mesh.normals) {
            assert!(normal.dot((vertex - center) / radius) > 0.99);
        }
    }

    #[test]
    fn random_values_give_a_mesh_whose_every_edge_has_two_triangles() {
        // Noise meets every one of the 256 cases and every ambiguous pair of neighbours.
        for seed in 0..4 {
            let dims = [20, 21, 22];
            let mut random = SplitMix::new(seed);
            let mut values = Vec::new();
            for z in 0..dims[2] {
                for y in 0..dims[1] {
                    for x in 0..dims[0] {
                        let border = [(x, dims[0]), (y, dims[1]), (z, dims[2])]
                            .iter()
                            .any(|&(at, size)| at == 0 || at + 1 == size);
                        let noise = random.unit_f64() as f32 - 0.5;
                        values.push(if border { 1.0 } else { noise });
                    }
                }
            }
            let mesh = marching_cubes(&values, dims, Vec3::ZERO, 1.0);
            assert!(mesh.is_watertight(), "{:?}", mesh.edge_report());
            assert!(mesh.volume() > 0.0);
        }
    }

    #[test]
    fn the_sparse_twin_extracts_the_same_surface() {
        let distance =
            |p: Vec3| vec3(p.x, p.y, p.z - 0.9).length() - 0.3 + 0.05 * (20.0 * p.x).sin();
        let dense = marching_cubes(&grid(distance), DIMS, ORIGIN, SPACING);
        let cells = (0..DIMS[2] as i32 - 1).flat_map(|z| {
            (0..DIMS[1] as i32 - 1)
                .flat_map(move |y| (0..DIMS[0] as i32 - 1).map(move |x| ivec3(x, y, z)))
        });
        let value = |corner: IVec3| distance(ORIGIN + SPACING * corner.as_vec3());
        assert_eq!(marching_cubes_sparse(cells, value, ORIGIN, SPACING), dense);
    }

    #[test]
    fn values_of_exactly_zero_make_no_degenerate_triangles() {
        // The plane z = 3 lies on grid points, whose value is then exactly 0.
        let dims = [6, 6, 6];
        let values: Vec<f32> = (0..216).map(|i| (i / 36) as f32 - 3.0).collect();
        let mesh = marching_cubes(&values, dims, Vec3::ZERO, 1.0);
        assert_eq!(mesh.triangles.len(), 50);
        for triangle in 0..mesh.triangles.len() {
            let [a, b, c] = mesh.corners(triangle);
            let normal = (b - a).cross(c - a);
            assert!((normal.z - 1.0).abs() < 1e-3, "{normal}");
        }
    }

    #[test]
    fn unknown_values_leave_a_hole_and_empty_grids_no_mesh() {
        let center = vec3(0.0, 0.0, 0.9);
        let mut values = grid(|p| p.distance(center) - 0.3);
        assert!(marching_cubes(&values, DIMS, ORIGIN, SPACING).is_watertight());
        let near_surface = values.iter().position(|value| value.abs() < 0.01).unwrap();
        values[near_surface] = f32::NAN;
        assert!(
            marching_cubes(&values, DIMS, ORIGIN, SPACING)
                .edge_report()
                .border
                > 0
        );
        assert!(
            marching_cubes(&[], [0, 0, 0], ORIGIN, SPACING)
                .triangles
                .is_empty()
        );
        assert!(
            marching_cubes(&[-1.0], [1, 1, 1], ORIGIN, SPACING)
                .triangles
                .is_empty()
        );
    }
}
