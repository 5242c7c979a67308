//! Points spread evenly over a surface.

use glam::{Vec3, vec3};

use super::{TriangleMesh, normals::doubled_area_normal};

/// A point on a mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfaceSample {
    pub point: Vec3,
    /// The unit normal of the triangle.
    pub normal: Vec3,
    pub triangle: u32,
    /// Weights of the triangle's three corners; they sum to 1.
    pub barycentric: Vec3,
}

/// `count` independent points, uniform by area; the same seed gives the same points.
///
/// A mesh without area gives none.
pub fn sample_surface(mesh: &TriangleMesh, count: usize, seed: u64) -> Vec<SurfaceSample> {
    let mut total = 0.0;
    let area_up_to: Vec<f64> = (0..mesh.triangles.len())
        .map(|triangle| {
            let [a, b, c] = mesh.corners(triangle);
            total += f64::from(doubled_area_normal(a, b, c).length());
            total
        })
        .collect();
    if !(total.is_finite() && total > 0.0) {
        return Vec::new();
    }
    let mut random = SplitMix::new(seed);
    (0..count)
        .map(|_| {
            let wanted = random.unit_f64() * total;
            let triangle = area_up_to.partition_point(|&area| area <= wanted);
            sample_triangle(mesh, triangle.min(area_up_to.len() - 1), &mut random)
        })
        .collect()
}

fn sample_triangle(mesh: &TriangleMesh, triangle: usize, random: &mut SplitMix) -> SurfaceSample {
    let [a, b, c] = mesh.corners(triangle);
    // The square root makes the points uniform over the triangle (Turk 1990).
    let root = random.unit_f64().sqrt() as f32;
    let along = random.unit_f64() as f32;
    let barycentric = vec3(1.0 - root, root * (1.0 - along), root * along);
    SurfaceSample {
        point: a * barycentric.x + b * barycentric.y + c * barycentric.z,
        normal: doubled_area_normal(a, b, c).normalize_or_zero(),
        triangle: triangle as u32,
        barycentric,
    }
}

/// `SplitMix64` (Steele, Lea and Flood 2014): small, seeded, and the same on every machine.
pub(crate) struct SplitMix {
    state: u64,
}

impl SplitMix {
    pub(crate) fn new(seed: u64) -> Self {
        Self { state: seed }
    }

    pub(crate) fn next_u64(&mut self) -> u64 {
        self.state = self.state.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut mixed = self.state;
        mixed = (mixed ^ (mixed >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        mixed ^ (mixed >> 31)
    }

    /// Uniform in [0, 1).
    pub(crate) fn unit_f64(&mut self) -> f64 {
        (self.next_u64() >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Uniform in 0..count.
    pub(crate) fn below(&mut self, count: usize) -> usize {
        ((u128::from(self.next_u64()) * count as u128) >> 64) as usize
    }
}

#[cfg(test)]
mod tests {
    use super::super::primitives::{cuboid, sphere};
    use super::*;

    #[test]
    fn samples_are_spread_by_area() {
        // A slab of 4 x 1 x 0.5: its six faces have 2/13, 8/13 and 3/13 of the area in pairs.
        let mesh = cuboid(Vec3::ZERO, vec3(4.0, 1.0, 0.5));
        let samples = sample_surface(&mesh, 20_000, 7);
        let share = |axis: usize| {
            samples
                .iter()
                .filter(|s| s.normal[axis].abs() > 0.5)
                .count() as f32
                / 20_000.0
        };
        // Binomial sigma is 0.0035 at most; four of them.
        for (axis, expected) in [(0, 1.0 / 13.0), (1, 4.0 / 13.0), (2, 8.0 / 13.0)] {
            assert!(
                (share(axis) - expected).abs() < 0.014,
                "axis {axis}: {}",
                share(axis)
            );
        }
    }

    #[test]
    fn samples_lie_on_their_triangle_and_repeat_with_their_seed() {
        let mesh = sphere(Vec3::ONE, 0.5, 3);
        let samples = sample_surface(&mesh, 500, 3);
        for sample in &samples {
            let [a, b, c] = mesh.corners(sample.triangle as usize);
            assert!(sample.normal.dot(sample.point - a).abs() < 1e-6);
            assert!((sample.barycentric.element_sum() - 1.0).abs() < 1e-6);
            assert!(doubled_area_normal(a, b, c).dot(sample.point - Vec3::ONE) > 0.0);
        }
        assert_eq!(samples, sample_surface(&mesh, 500, 3));
        assert_ne!(samples, sample_surface(&mesh, 500, 4));
    }

    #[test]
    fn a_mesh_without_area_gives_no_samples() {
        let mesh = TriangleMesh::new(vec![Vec3::ZERO; 3], vec![[0, 1, 2]]);
        assert!(sample_surface(&mesh, 5, 0).is_empty());
    }
}
