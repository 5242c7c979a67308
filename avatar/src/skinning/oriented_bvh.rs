//! The closest point of a mesh, where a surface that faces the wrong way counts as farther off.

use glam::Vec3;

/// Triangles a leaf holds at most.
const LEAF_TRIANGLES: usize = 4;
/// Normals up to 60 degrees apart agree: depth normals and cloth folds err by that much.
const AGREEING_COSINE: f32 = 0.5;

/// A bounding volume hierarchy over one triangle mesh.
pub(super) struct OrientedBvh {
    nodes: Vec<Node>,
    /// Corner positions and corner normals, in leaf order.
    triangles: Vec<Triangle>,
}

/// The chosen point of the mesh.
#[derive(Clone, Copy, Debug)]
pub(super) struct OrientedHit {
    pub(super) vertices: [u32; 3],
    pub(super) barycentric: [f32; 3],
    pub(super) distance_m: f32,
    /// The distance, and what normals that disagree add to it.
    pub(super) cost_m: f32,
    /// From the mesh to the point.
    pub(super) offset: Vec3,
    /// The mesh's unit normal there.
    pub(super) normal: Vec3,
}

#[derive(Clone, Copy)]
struct Node {
    min: Vec3,
    max: Vec3,
    /// Inner: index of the left child, the right one follows it. Leaf: first triangle.
    first: u32,
    /// Triangles in a leaf; 0 for an inner node.
    count: u32,
}

#[derive(Clone, Copy)]
struct Triangle {
    corners: [Vec3; 3],
    normals: [Vec3; 3],
    vertices: [u32; 3],
}

impl OrientedBvh {
    pub(super) fn new(vertices: &[Vec3], normals: &[Vec3], triangles: &[[u32; 3]]) -> Self {
        let mut all: Vec<Triangle> = triangles
            .iter()
            .map(|&indices| Triangle {
                corners: indices.map(|i| vertices[i as usize]),
                normals: indices.map(|i| normals[i as usize]),
                vertices: indices,
            })
            .collect();
        let mut bvh = Self { nodes: vec![Node::over(&all)], triangles: Vec::new() };
        bvh.split(0, &mut all, 0);
        bvh.triangles = all;
        bvh
    }

    /// Minimises `distance^2 + penalty^2`, where the penalty grows from zero at agreeing normals to
    /// `opposed_m` at opposite ones. A zero normal asks for the plain closest point.
    pub(super) fn closest(&self, point: Vec3, normal: Vec3, opposed_m: f32) -> OrientedHit {
        let mut best = None;
        let mut best_cost = f32::INFINITY;
        let mut stack = [(0_u32, 0.0_f32); 64];
        let mut depth = 1;
        while depth > 0 {
            depth -= 1;
            let (index, bound) = stack[depth];
            if bound >= best_cost {
                continue;
            }
            let node = self.nodes[index as usize];
            if node.count > 0 {
                for triangle in &self.triangles[node.first as usize..][..node.count as usize] {
                    let (cost, barycentric) = triangle.cost(point, normal, opposed_m);
                    if cost < best_cost {
                        (best_cost, best) = (cost, Some((triangle, barycentric)));
                    }
                }
                continue;
            }
            let bounds =
                [0, 1].map(|side| self.nodes[(node.first + side) as usize].squared_distance(point));
            // The nearer child is looked at first: it is pushed last.
            let near = u32::from(bounds[1] < bounds[0]);
            for side in [1 - near, near] {
                stack[depth] = (node.first + side, bounds[side as usize]);
                depth += 1;
            }
        }
        best.map_or_else(OrientedHit::nowhere, |(triangle, barycentric)| {
            let cost_m = best_cost.sqrt();
            OrientedHit { cost_m, ..triangle.hit(point, barycentric) }
        })
    }

    /// Median split along the longest side; `first` is the index of `triangles[0]` in leaf order.
    fn split(&mut self, node: usize, triangles: &mut [Triangle], first: usize) {
        if triangles.len() <= LEAF_TRIANGLES {
            self.nodes[node].first = first as u32;
            self.nodes[node].count = triangles.len() as u32;
            return;
        }
        let size = self.nodes[node].max - self.nodes[node].min;
        let axis = if size.x >= size.y && size.x >= size.z {
            0
        } else if size.y >= size.z {
            1
        } else {
            2
        };
        let middle = triangles.len() / 2;
        triangles.select_nth_unstable_by(middle, |a, b| {
            a.middle()[axis]
                .total_cmp(&b.middle()[axis])
                .then(a.vertices.cmp(&b.vertices))
        });
        let (left, right) = triangles.split_at_mut(middle);
        let child = self.nodes.len();
        self.nodes[node].first = child as u32;
        self.nodes.push(Node::over(left));
        self.nodes.push(Node::over(right));
        self.split(child, left, first);
        self.split(child + 1, right, first + middle);
    }
}

impl Node {
    fn over(triangles: &[Triangle]) -> Self {
        let mut node = Self { min: Vec3::INFINITY, max: Vec3::NEG_INFINITY, first: 0, count: 0 };
        for corner in triangles.iter().flat_map(|triangle| triangle.corners) {
            node.min = node.min.min(corner);
            node.max = node.max.max(corner);
        }
        node
    }

    fn squared_distance(&self, point: Vec3) -> f32 {
        point.distance_squared(point.clamp(self.min, self.max))
    }
}

impl Triangle {
    fn middle(&self) -> Vec3 {
        self.corners[0] + self.corners[1] + self.corners[2]
    }

    fn cost(&self, point: Vec3, normal: Vec3, opposed_m: f32) -> (f32, [f32; 3]) {
        let barycentric = closest_barycentric(point, &self.corners);
        let squared = point.distance_squared(mix(&self.corners, barycentric));
        let mut cost = squared;
        if normal != Vec3::ZERO {
            let facing = normal.dot(mix(&self.normals, barycentric).normalize_or_zero());
            let disagreement = (AGREEING_COSINE - facing).max(0.0) / (1.0 + AGREEING_COSINE);
            cost += opposed_m * opposed_m * disagreement;
        }
        (cost, barycentric)
    }

    fn hit(&self, point: Vec3, barycentric: [f32; 3]) -> OrientedHit {
        let offset = point - mix(&self.corners, barycentric);
        OrientedHit {
            vertices: self.vertices,
            barycentric,
            distance_m: offset.length(),
            cost_m: offset.length(),
            offset,
            normal: mix(&self.normals, barycentric).normalize_or_zero(),
        }
    }
}

impl OrientedHit {
    /// On a mesh without triangles.
    fn nowhere() -> Self {
        Self {
            vertices: [0; 3],
            barycentric: [1.0, 0.0, 0.0],
            distance_m: 0.0,
            cost_m: 0.0,
            offset: Vec3::ZERO,
            normal: Vec3::ZERO,
        }
    }
}

fn mix(corners: &[Vec3; 3], barycentric: [f32; 3]) -> Vec3 {
    corners[0] * barycentric[0] + corners[1] * barycentric[1] + corners[2] * barycentric[2]
}

/// Barycentric coordinates of the triangle's point closest to `point`, by its Voronoi regions.
fn closest_barycentric(point: Vec3, &[a, b, c]: &[Vec3; 3]) -> [f32; 3] {
    let (ab, ac) = (b - a, c - a);
    let to_a = point - a;
    let (d1, d2) = (ab.dot(to_a), ac.dot(to_a));
    if d1 <= 0.0 && d2 <= 0.0 {
        return [1.0, 0.0, 0.0];
    }
    let to_b = point - b;
    let (d3, d4) = (ab.dot(to_b), ac.dot(to_b));
    if d3 >= 0.0 && d4 <= d3 {
        return [0.0, 1.0, 0.0];
    }
    let on_ab = d1 * d4 - d3 * d2;
    if on_ab <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        let along = share(d1, d1 - d3);
        return [1.0 - along, along, 0.0];
    }
    let to_c = point - c;
    let (d5, d6) = (ab.dot(to_c), ac.dot(to_c));
    if d6 >= 0.0 && d5 <= d6 {
        return [0.0, 0.0, 1.0];
    }
    let on_ac = d5 * d2 - d1 * d6;
    if on_ac <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        let along = share(d2, d2 - d6);
        return [1.0 - along, 0.0, along];
    }
    let on_bc = d3 * d6 - d5 * d4;
    if on_bc <= 0.0 && d4 >= d3 && d5 >= d6 {
        let along = share(d4 - d3, (d4 - d3) + (d5 - d6));
        return [0.0, 1.0 - along, along];
    }
    let sum = on_ab + on_ac + on_bc;
    let (v, w) = (share(on_ac, sum), share(on_ab, sum));
    [1.0 - v - w, v, w]
}

/// `part / whole`, and 0 for a degenerate triangle.
fn share(part: f32, whole: f32) -> f32 {
    if whole.abs() > f32::MIN_POSITIVE {
        part / whole
    } else {
        0.0
    }
}

#[cfg(test)]
mod tests {
    use rand::{RngExt as _, SeedableRng as _, rngs::StdRng};

    use super::*;

    fn random_mesh(rng: &mut StdRng, count: usize) -> (Vec<Vec3>, Vec<Vec3>, Vec<[u32; 3]>) {
        let mut random =
            || Vec3::from_array(std::array::from_fn(|_| rng.random_range(-1.0_f32..1.0)));
        let mut vertices = Vec::new();
        for _ in 0..count {
            let corner = random();
            vertices.extend([corner, corner + random() * 0.1, corner + random() * 0.1]);
        }
        let normals = vertices
            .iter()
            .map(|_| random().normalize_or_zero())
            .collect();
        let triangles = (0..count as u32)
            .map(|t| [3 * t, 3 * t + 1, 3 * t + 2])
            .collect();
        (vertices, normals, triangles)
    }

    #[test]
    fn tree_finds_what_brute_force_finds() {
        let mut rng = StdRng::seed_from_u64(3);
        let (vertices, normals, triangles) = random_mesh(&mut rng, 300);
        let bvh = OrientedBvh::new(&vertices, &normals, &triangles);
        for _ in 0..200 {
            let point = Vec3::from_array(std::array::from_fn(|_| rng.random_range(-1.2..1.2)));
            let normal = Vec3::from_array(std::array::from_fn(|_| rng.random_range(-1.0..1.0)))
                .normalize_or_zero();
            let found = bvh.closest(point, normal, 0.3);
            let (_, expected) = bvh
                .triangles
                .iter()
                .map(|triangle| (triangle.cost(point, normal, 0.3).0, triangle.vertices))
                .min_by(|a, b| a.0.total_cmp(&b.0))
                .unwrap();
            assert_eq!(found.vertices, expected);
        }
    }

    #[test]
    fn closest_barycentric_is_a_minimum_over_the_triangle() {
        let mut rng = StdRng::seed_from_u64(4);
        for _ in 0..100 {
            let mut random =
                || Vec3::from_array(std::array::from_fn(|_| rng.random_range(-1.0_f32..1.0)));
            let corners = [random(), random(), random()];
            let point = random() * 1.5;
            let found = point.distance(mix(&corners, closest_barycentric(point, &corners)));
            for i in 0..=20 {
                for j in 0..=20 - i {
                    let (v, w) = (i as f32 / 20.0, j as f32 / 20.0);
                    let other = point.distance(mix(&corners, [1.0 - v - w, v, w]));
                    assert!(found <= other + 1e-5);
                }
            }
        }
    }
}
