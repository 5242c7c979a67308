//! Simple closed shapes, for tests and for scenes.

use glam::{Vec3, vec3};
use rustc_hash::FxHashMap;

use super::TriangleMesh;

/// An icosahedron halved `subdivisions` times onto a sphere; 20 * 4^n triangles, facing outwards.
pub fn sphere(center: Vec3, radius_m: f32, subdivisions: u32) -> TriangleMesh {
    let (mut directions, mut triangles) = icosahedron();
    for _ in 0..subdivisions {
        triangles = subdivide(&mut directions, &triangles);
    }
    let vertices = directions
        .iter()
        .map(|direction| center + radius_m * *direction)
        .collect();
    TriangleMesh::new(vertices, triangles)
}

/// An axis-aligned box of 12 triangles facing outwards.
pub fn cuboid(min: Vec3, max: Vec3) -> TriangleMesh {
    let vertices = (0..8)
        .map(|corner| {
            let pick = |axis: usize| {
                if corner >> axis & 1 == 1 {
                    max[axis]
                } else {
                    min[axis]
                }
            };
            vec3(pick(0), pick(1), pick(2))
        })
        .collect();
    let quads = [
        [0, 4, 6, 2],
        [1, 3, 7, 5],
        [0, 1, 5, 4],
        [2, 6, 7, 3],
        [0, 2, 3, 1],
        [4, 5, 7, 6],
    ];
    let triangles = quads
        .iter()
        .flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]])
        .collect();
    TriangleMesh::new(vertices, triangles)
}

fn icosahedron() -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let golden = 0.5 + 1.25_f32.sqrt();
    let corners = [
        [-1.0, golden, 0.0],
        [1.0, golden, 0.0],
        [-1.0, -golden, 0.0],
        [1.0, -golden, 0.0],
        [0.0, -1.0, golden],
        [0.0, 1.0, golden],
        [0.0, -1.0, -golden],
        [0.0, 1.0, -golden],
        [golden, 0.0, -1.0],
        [golden, 0.0, 1.0],
        [-golden, 0.0, -1.0],
        [-golden, 0.0, 1.0],
    ];
    let directions: Vec<Vec3> = corners
        .iter()
        .map(|&corner| Vec3::from(corner).normalize_or_zero())
        .collect();
    // Corners at an edge's distance from each other form the 20 faces.
    let edge = 4.0 / (1.0 + golden * golden) + 1e-3;
    let near = |a: usize, b: usize| directions[a].distance_squared(directions[b]) < edge;
    let mut triangles = Vec::new();
    for a in 0..12 {
        for b in a + 1..12 {
            for c in b + 1..12 {
                if near(a, b) && near(b, c) && near(c, a) {
                    let outward = (directions[b] - directions[a])
                        .cross(directions[c] - directions[a])
                        .dot(directions[a])
                        > 0.0;
                    let (b, c) = if outward { (b, c) } else { (c, b) };
                    triangles.push([a as u32, b as u32, c as u32]);
                }
            }
        }
    }
    (directions, triangles)
}

fn subdivide(directions: &mut Vec<Vec3>, triangles: &[[u32; 3]]) -> Vec<[u32; 3]> {
    let mut middles: FxHashMap<(u32, u32), u32> = FxHashMap::default();
    let mut middle = |a: u32, b: u32| {
        *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
            let sum = directions[a as usize] + directions[b as usize];
            directions.push(sum.normalize_or_zero());
            directions.len() as u32 - 1
        })
    };
    triangles
        .iter()
        .flat_map(|&[a, b, c]| {
            let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
            [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn primitives_are_closed_and_face_outwards() {
        let ball = sphere(Vec3::ZERO, 1.0, 2);
        assert_eq!(ball.triangles.len(), 320);
        let brick = cuboid(vec3(-1.0, -2.0, -3.0), vec3(1.0, 2.0, 3.0));
        for mesh in [ball, brick] {
            assert!(mesh.is_watertight());
            for triangle in 0..mesh.triangles.len() {
                let [a, b, c] = mesh.corners(triangle);
                assert!((b - a).cross(c - a).dot(a + b + c) > 0.0);
            }
        }
    }
}
