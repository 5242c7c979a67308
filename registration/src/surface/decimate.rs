//! A coarse mesh from a fine one: seeds spread by farthest-point sampling, triangles between their cells.

use std::{cmp::Reverse, collections::BinaryHeap};

use glam::Vec3;

/// Some of a mesh's vertices, and triangles over them.
pub(super) struct CoarseMesh {
    /// Indices into the fine mesh.
    pub(super) vertices: Vec<u32>,
    pub(super) triangles: Vec<[u32; 3]>,
}

/// Keeps `count` vertices. Each fine vertex belongs to the seed nearest along the mesh's edges; a fine
/// triangle whose corners belong to three seeds becomes a coarse one (the dual of the Voronoi cells).
pub(super) fn decimate(vertices: &[Vec3], triangles: &[[u32; 3]], count: usize) -> CoarseMesh {
    if vertices.len() <= count {
        return CoarseMesh {
            vertices: (0..vertices.len() as u32).collect(),
            triangles: triangles.to_vec(),
        };
    }
    let seeds = spread(vertices, count);
    let cell = nearest_seed_along_edges(vertices, triangles, &seeds);
    let mut coarse: Vec<[u32; 3]> = triangles
        .iter()
        .map(|t| t.map(|i| cell[i as usize]))
        .filter(|[a, b, c]| a != b && b != c && c != a && ![*a, *b, *c].contains(&u32::MAX))
        .map(smallest_first)
        .collect();
    coarse.sort_unstable();
    coarse.dedup();
    CoarseMesh { vertices: seeds, triangles: coarse }
}

/// Farthest-point sampling from vertex 0.
fn spread(vertices: &[Vec3], count: usize) -> Vec<u32> {
    let mut distance = vec![f32::MAX; vertices.len()];
    let mut seeds = Vec::with_capacity(count);
    let mut next = 0;
    while seeds.len() < count {
        seeds.push(next as u32);
        let seed = vertices[next];
        let mut farthest = -1.0;
        for (i, (d, vertex)) in distance.iter_mut().zip(vertices).enumerate() {
            *d = d.min(vertex.distance_squared(seed));
            if *d > farthest {
                farthest = *d;
                next = i;
            }
        }
    }
    seeds
}

/// Dijkstra from all seeds at once; `u32::MAX` for vertices that no edge connects to one.
fn nearest_seed_along_edges(vertices: &[Vec3], triangles: &[[u32; 3]], seeds: &[u32]) -> Vec<u32> {
    let mut neighbours = vec![Vec::new(); vertices.len()];
    for &[a, b, c] in triangles {
        for (from, to) in [(a, b), (b, c), (c, a)] {
            neighbours[from as usize].push(to);
            neighbours[to as usize].push(from);
        }
    }
    let mut cell = vec![u32::MAX; vertices.len()];
    let mut reached = vec![u64::MAX; vertices.len()];
    let mut queue = BinaryHeap::new();
    for (i, &seed) in seeds.iter().enumerate() {
        reached[seed as usize] = 0;
        cell[seed as usize] = i as u32;
        queue.push(Reverse((0_u64, seed)));
    }
    while let Some(Reverse((distance, vertex))) = queue.pop() {
        if distance > reached[vertex as usize] {
            continue;
        }
        for &next in &neighbours[vertex as usize] {
            let edge_m = vertices[vertex as usize].distance(vertices[next as usize]);
            // Whole nanometres, so that the order is total.
            let through = distance + (edge_m * 1e9) as u64;
            if through < reached[next as usize] {
                reached[next as usize] = through;
                cell[next as usize] = cell[vertex as usize];
                queue.push(Reverse((through, next)));
            }
        }
    }
    cell
}

/// Turns a triangle, without flipping it, so that equal triangles are equal arrays.
fn smallest_first([a, b, c]: [u32; 3]) -> [u32; 3] {
    if a < b && a < c {
        [a, b, c]
    } else if b < c {
        [b, c, a]
    } else {
        [c, a, b]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_decimated_sphere_stays_closed_and_keeps_its_area() {
        let (vertices, triangles) = sphere(60, 30);
        let coarse = decimate(&vertices, &triangles, 300);
        assert_eq!(coarse.vertices.len(), 300);
        let position = |i: u32| vertices[coarse.vertices[i as usize] as usize];
        let area: f32 = coarse
            .triangles
            .iter()
            .map(|t| {
                let [a, b, c] = t.map(position);
                (b - a).cross(c - a).length() * 0.5
            })
            .sum();
        let whole = 4.0 * std::f32::consts::PI;
        // Chords of a unit sphere at 0.2 m spacing lose about 1 %; a hole would lose more than 5 %.
        assert!((area / whole - 1.0).abs() < 0.05, "area {area} of {whole}");
    }

    fn sphere(around: u32, rings: u32) -> (Vec<Vec3>, Vec<[u32; 3]>) {
        let mut vertices = vec![Vec3::Y, -Vec3::Y];
        for ring in 1..rings {
            let polar = std::f32::consts::PI * ring as f32 / rings as f32;
            for i in 0..around {
                let turn = std::f32::consts::TAU * i as f32 / around as f32;
                vertices.push(Vec3::new(
                    polar.sin() * turn.sin(),
                    polar.cos(),
                    polar.sin() * turn.cos(),
                ));
            }
        }
        let at = |ring: u32, i: u32| 2 + (ring - 1) * around + i % around;
        let mut triangles = Vec::new();
        for i in 0..around {
            triangles.push([0, at(1, i), at(1, i + 1)]);
            triangles.push([1, at(rings - 1, i + 1), at(rings - 1, i)]);
            for ring in 1..rings - 1 {
                triangles.push([at(ring, i), at(ring + 1, i), at(ring + 1, i + 1)]);
                triangles.push([at(ring, i), at(ring + 1, i + 1), at(ring, i + 1)]);
            }
        }
        (vertices, triangles)
    }
}
