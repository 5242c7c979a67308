//! The followed surface against the dense grid's, on shapes whose distance is known.

use std::sync::atomic::{AtomicUsize, Ordering};

use effigy_fusion::mesh::marching_cubes::marching_cubes;
use glam::vec3;

use super::*;
use crate::testing::Analytic;

/// Two arms, two legs, a trunk and a head, 0.04 to 0.16 thick.
fn capsule_body(p: Vec3) -> f32 {
    const CAPSULES: [([f32; 3], [f32; 3], f32); 7] = [
        ([0.0, -0.1, 0.0], [0.0, 0.35, 0.0], 0.16),
        ([0.0, 0.5, 0.0], [0.0, 0.65, 0.0], 0.1),
        ([0.0, 0.4, 0.0], [0.7, 0.4, 0.0], 0.04),
        ([0.0, 0.4, 0.0], [-0.7, 0.4, 0.0], 0.04),
        ([0.08, -0.1, 0.0], [0.6, -0.7, 0.0], 0.06),
        ([-0.08, -0.1, 0.0], [-0.6, -0.7, 0.0], 0.06),
        ([-0.6, -0.7, 0.0], [-0.62, -0.72, 0.15], 0.05),
    ];
    CAPSULES
        .iter()
        .map(|&(a, b, radius)| {
            let (a, b) = (Vec3::from(a), Vec3::from(b));
            let along = ((p - a).dot(b - a) / (b - a).length_squared()).clamp(0.0, 1.0);
            p.distance(a + (b - a) * along) - radius
        })
        .fold(f32::MAX, f32::min)
}

fn torus(p: Vec3) -> f32 {
    let ring = vec3(p.x, p.y, 0.0).length() - 0.55;
    ring.hypot(p.z) - 0.12
}

fn dense(field: fn(Vec3) -> f32, resolution: usize) -> TriangleMesh {
    let spacing = 2.0 / (resolution - 1) as f32;
    let point = |index: usize| {
        let (x, rest) = (index % resolution, index / resolution);
        vec3(
            x as f32,
            (rest % resolution) as f32,
            (rest / resolution) as f32,
        ) * spacing
            - 1.0
    };
    let values: Vec<f32> = (0..resolution.pow(3))
        .map(|index| field(point(index)))
        .collect();
    largest_component(&marching_cubes(
        &values,
        [resolution; 3],
        Vec3::NEG_ONE,
        spacing,
    ))
}

/// Vertices as a sorted list, to compare meshes whose order differs.
fn sorted(mesh: &TriangleMesh) -> Vec<[i64; 3]> {
    let mut keys: Vec<[i64; 3]> = mesh
        .vertices
        .iter()
        .map(|vertex| {
            vertex
                .to_array()
                .map(|x| (f64::from(x) * 1e5).round() as i64)
        })
        .collect();
    keys.sort_unstable();
    keys
}

fn assert_same_surface(a: &TriangleMesh, b: &TriangleMesh) {
    assert_eq!(a.triangles.len(), b.triangles.len());
    let (a, b) = (sorted(a), sorted(b));
    assert_eq!(a.len(), b.len());
    for (a, b) in a.iter().zip(&b) {
        // 1e-5 units are 10 micrometres on an adult; rounding of the key may add one.
        assert!(
            a.iter().zip(b).all(|(a, b)| a.abs_diff(*b) <= 1),
            "{a:?} {b:?}"
        );
    }
}

#[test]
fn the_followed_surface_is_the_dense_grids() {
    for field in [capsule_body as fn(Vec3) -> f32, torus, |p| p.length() - 0.7] {
        for resolution in [64, 97, 128] {
            let mesh = extract(&Analytic(field), resolution);
            assert!(mesh.is_watertight());
            assert_same_surface(&mesh, &dense(field, resolution));
        }
    }
}

#[test]
fn a_sphere_is_found_within_half_a_cell_unshifted_and_facing_outwards() {
    let resolution = 128;
    let cell = 2.0 / (resolution - 1) as f32;
    let center = vec3(0.11, -0.07, 0.03);
    let mesh = extract(
        &Analytic(move |p: Vec3| p.distance(center) - 0.6),
        resolution,
    );
    for (vertex, normal) in mesh.vertices.iter().zip(&mesh.normals) {
        // Linear interpolation of a distance over one cell errs by cell^2 / (8 r): far below a tenth.
        assert!((vertex.distance(center) - 0.6).abs() < 0.1 * cell);
        assert!(normal.dot(*vertex - center) > 0.55);
    }
    let mean = mesh.vertices.iter().sum::<Vec3>() / mesh.vertices.len() as f32;
    assert!(
        mean.distance(center) < 0.02 * cell,
        "shifted by {}",
        mean.distance(center)
    );
}

#[test]
fn the_largest_of_several_pieces_is_kept() {
    let two = |p: Vec3| (p - 0.5).length().min((p + 0.4).length() + 0.1) - 0.3;
    let mesh = extract(&Analytic(two), 64);
    assert!(mesh.vertices.iter().all(|vertex| vertex.x > 0.1));
}

#[test]
fn a_surface_that_leaves_the_cube_is_closed_at_its_wall() {
    let mesh = extract(
        &Analytic(|p: Vec3| p.distance(vec3(0.9, 0.0, 0.0)) - 0.4),
        64,
    );
    assert!(mesh.is_watertight());
}

#[test]
fn fields_without_a_surface_give_an_empty_mesh() {
    assert!(extract(&Analytic(|_: Vec3| 1.0), 32).triangles.is_empty());
    assert!(
        extract(&Analytic(|_: Vec3| f32::NAN), 32)
            .triangles
            .is_empty()
    );
}

/// A field far from a distance: steep by three near the surface, flat away from it.
#[test]
fn a_saturated_field_comes_out_whole() {
    let field: fn(Vec3) -> f32 = |p| (3.0 * capsule_body(p)).clamp(-0.02, 0.02);
    let mesh = extract(&Analytic(field), 128);
    assert_same_surface(&mesh, &dense(field, 128));
}

#[test]
fn few_values_are_asked_for() {
    static ASKED: AtomicUsize = AtomicUsize::new(0);
    let counted = |p: Vec3| {
        ASKED.fetch_add(1, Ordering::Relaxed);
        capsule_body(p)
    };
    let mesh = extract(&Analytic(counted), 256);
    // The bar of a 256^3 body mesh is 300,000 values; dense would be 16.8 million.
    assert!(ASKED.load(Ordering::Relaxed) < 300_000);
    assert!(ASKED.load(Ordering::Relaxed) < 4 * mesh.vertices.len() + 60_000);
}

#[test]
fn relaxing_stays_on_the_surface_and_removes_slivers() {
    let field = Analytic(capsule_body);
    let mut mesh = extract(&field, 96);
    let before = worst_shape(&mesh);
    relax(&mut mesh, &field, 4);
    assert!(mesh.is_watertight());
    assert!(
        worst_shape(&mesh) > 10.0 * before,
        "{} {}",
        worst_shape(&mesh),
        before
    );
    for vertex in &mesh.vertices {
        // A Newton step on an exact distance is exact except at the creases between capsules.
        assert!(capsule_body(*vertex).abs() < 1e-3);
    }
}

/// The first percentile of area over squared longest edge.
fn worst_shape(mesh: &TriangleMesh) -> f32 {
    let mut shapes: Vec<f32> = (0..mesh.triangles.len())
        .map(|triangle| {
            let [a, b, c] = mesh.corners(triangle);
            let longest = a
                .distance_squared(b)
                .max(b.distance_squared(c))
                .max(c.distance_squared(a));
            (b - a).cross(c - a).length() / longest
        })
        .collect();
    shapes.sort_by(f32::total_cmp);
    shapes[shapes.len() / 100]
}
