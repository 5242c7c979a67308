//! The point of a mesh nearest to a query point, by a tree of boxes.

use glam::{Vec3, vec3};
use rayon::prelude::*;
use rustc_hash::FxHashMap;

use super::{TriangleMesh, normals::doubled_area_normal};
use crate::error::FusionError;

/// Triangles in a leaf: fewer means a deeper tree, more means more exact tests.
const LEAF_TRIANGLES: usize = 3;
/// Queries a thread takes at a time; the split does not change any result.
const BATCH: usize = 256;

/// The nearest point of a mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    pub point: Vec3,
    pub triangle: u32,
    /// Weights of the triangle's three corners; exactly 0 for those the point is not made of.
    pub barycentric: Vec3,
    pub distance: f32,
}

/// A mesh prepared for nearest-point queries.
#[derive(Clone, Debug)]
pub struct ClosestPoint {
    nodes: Vec<Node>,
    /// Triangles in leaf order.
    leaves: Vec<Leaf>,
    triangles: Vec<[u32; 3]>,
    normals: PseudoNormals,
}

/// A box; its children lie next to each other, its triangles too.
#[derive(Clone, Copy, Debug)]
struct Node {
    min: Vec3,
    /// The first child, or the first triangle of a leaf.
    first: u32,
    max: Vec3,
    /// Triangles in a leaf; 0 for an inner box.
    count: u32,
}

#[derive(Clone, Copy, Debug)]
struct Leaf {
    corner: Vec3,
    edge_ab: Vec3,
    edge_ac: Vec3,
    triangle: u32,
}

/// Normals whose sign tells inside from outside at any nearest point (Baerentzen and Aanaes 2005).
#[derive(Clone, Debug, Default)]
struct PseudoNormals {
    /// Of each triangle.
    faces: Vec<Vec3>,
    /// Of each vertex, weighted by the angle of each triangle at the vertex.
    corners: Vec<Vec3>,
    /// The sum of the two triangles' normals, for each triangle's edges ab, bc, ca.
    edges: Vec<[Vec3; 3]>,
}

impl ClosestPoint {
    /// Refuses a mesh without triangles, with missing vertices, or with vertices that are not finite.
    pub fn new(vertices: &[Vec3], triangles: &[[u32; 3]]) -> Result<Self, FusionError> {
        check(vertices, triangles)?;
        let mut order: Vec<u32> = (0..triangles.len() as u32).collect();
        let centers: Vec<Vec3> = triangles
            .iter()
            .map(|corners| {
                corners
                    .map(|vertex| vertices[vertex as usize])
                    .iter()
                    .sum::<Vec3>()
                    / 3.0
            })
            .collect();
        let mut nodes = vec![Node::leaf(0, order.len())];
        split(&mut nodes, 0, &mut order, &centers);
        let leaves = order
            .iter()
            .map(|&triangle| Leaf::unset(triangle))
            .collect();
        let normals = PseudoNormals::default();
        let mut tree = Self { nodes, leaves, triangles: triangles.to_vec(), normals };
        tree.place(vertices);
        Ok(tree)
    }

    pub fn from_mesh(mesh: &TriangleMesh) -> Result<Self, FusionError> {
        Self::new(&mesh.vertices, &mesh.triangles)
    }

    /// Follows the mesh to new vertices without building the tree anew: much faster, and exact; queries
    /// slow down only if the shape changes a lot.
    pub fn refit(&mut self, vertices: &[Vec3]) -> Result<(), FusionError> {
        check(vertices, &self.triangles)?;
        self.place(vertices);
        Ok(())
    }

    /// As [`Self::refit`], for a mesh that moves many times between questions about inside and outside: signs
    /// and pseudo-normals stay those of the last [`Self::refit`], distances and nearest points are exact.
    pub fn refit_distances(&mut self, vertices: &[Vec3]) -> Result<(), FusionError> {
        check(vertices, &self.triangles)?;
        self.place_boxes(vertices);
        Ok(())
    }

    /// The nearest point of the mesh. A query that is not finite gets a distance of NaN.
    pub fn query(&self, point: Vec3) -> Hit {
        let nowhere =
            Hit { point: Vec3::NAN, triangle: 0, barycentric: Vec3::X, distance: f32::NAN };
        self.search(point, f32::INFINITY).unwrap_or(nowhere)
    }

    /// The nearest point of the mesh, if it is no farther than that.
    pub fn query_within(&self, point: Vec3, max_distance: f32) -> Option<Hit> {
        // The bound is exclusive inside; the next number up makes it inclusive.
        self.search(point, (max_distance * max_distance).next_up())
    }

    /// [`Self::query`] for many points, on all threads; the same result for any number of them.
    pub fn query_all(&self, points: &[Vec3]) -> Vec<Hit> {
        points
            .par_iter()
            .with_min_len(BATCH)
            .map(|&point| self.query(point))
            .collect()
    }

    /// Distance to the mesh, negative inside. Means something for closed meshes only.
    pub fn signed_distance(&self, point: Vec3) -> f32 {
        self.sign(point, &self.query(point))
    }

    pub fn signed_distance_all(&self, points: &[Vec3]) -> Vec<f32> {
        points
            .par_iter()
            .with_min_len(BATCH)
            .map(|&point| self.signed_distance(point))
            .collect()
    }

    /// A hit's distance, negative if `point`, which it was found for, is inside.
    pub fn sign(&self, point: Vec3, hit: &Hit) -> f32 {
        if (point - hit.point).dot(self.pseudo_normal(hit)) < 0.0 {
            -hit.distance
        } else {
            hit.distance
        }
    }

    /// The outward normal at a hit: of the triangle, or summed over those that meet at its edge or
    /// weighted by angle over those at its vertex. Not of unit length.
    pub fn pseudo_normal(&self, hit: &Hit) -> Vec3 {
        let triangle = hit.triangle as usize;
        match hit.barycentric.to_array().map(|weight| weight == 0.0) {
            [false, false, false] => self.normals.faces[triangle],
            [false, false, true] => self.normals.edges[triangle][0],
            [true, false, false] => self.normals.edges[triangle][1],
            [false, true, false] => self.normals.edges[triangle][2],
            [false, true, true] => self.vertex_normal(triangle, 0),
            [true, false, true] => self.vertex_normal(triangle, 1),
            [true, true, _] => self.vertex_normal(triangle, 2),
        }
    }

    /// The unit normal of a triangle; zero if it has no area.
    pub fn triangle_normal(&self, triangle: u32) -> Vec3 {
        self.normals.faces[triangle as usize]
    }

    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }

    fn vertex_normal(&self, triangle: usize, corner: usize) -> Vec3 {
        self.normals.corners[self.triangles[triangle][corner] as usize]
    }

    fn search(&self, point: Vec3, max_squared: f32) -> Option<Hit> {
        let mut best_squared = max_squared;
        let mut best: Option<(Vec3, usize)> = None;
        // A balanced tree of 2^32 triangles is 33 deep, and each level leaves one box waiting.
        let mut waiting = [(0_u32, 0.0_f32); 48];
        let mut depth = 0;
        let mut node = &self.nodes[0];
        loop {
            if node.count > 0 {
                let first = node.first as usize;
                for (offset, leaf) in self.leaves[first..first + node.count as usize]
                    .iter()
                    .enumerate()
                {
                    let weights = leaf.closest(point);
                    let squared = leaf.at(weights).distance_squared(point);
                    if squared < best_squared {
                        best_squared = squared;
                        best = Some((weights, first + offset));
                    }
                }
            } else {
                let first = node.first as usize;
                let (left, right) = (&self.nodes[first], &self.nodes[first + 1]);
                let (to_left, to_right) =
                    (left.distance_squared(point), right.distance_squared(point));
                let (near, far, to_near, to_far) = if to_left <= to_right {
                    (left, first + 1, to_left, to_right)
                } else {
                    (right, first, to_right, to_left)
                };
                if to_near < best_squared {
                    if to_far < best_squared {
                        waiting[depth] = (far as u32, to_far);
                        depth += 1;
                    }
                    node = near;
                    continue;
                }
            }
            node = loop {
                if depth == 0 {
                    return best.map(|found| self.hit(found, best_squared));
                }
                depth -= 1;
                let (index, squared) = waiting[depth];
                if squared < best_squared {
                    break &self.nodes[index as usize];
                }
            };
        }
    }

    fn hit(&self, (weights, leaf): (Vec3, usize), squared: f32) -> Hit {
        let leaf = &self.leaves[leaf];
        Hit {
            point: leaf.at(weights),
            triangle: leaf.triangle,
            barycentric: weights,
            distance: squared.sqrt(),
        }
    }

    /// Sets boxes, triangles and normals from the vertices.
    fn place(&mut self, vertices: &[Vec3]) {
        self.place_boxes(vertices);
        self.normals.update(vertices, &self.triangles);
    }

    fn place_boxes(&mut self, vertices: &[Vec3]) {
        for leaf in &mut self.leaves {
            let [a, b, c] =
                self.triangles[leaf.triangle as usize].map(|vertex| vertices[vertex as usize]);
            *leaf = Leaf { corner: a, edge_ab: b - a, edge_ac: c - a, triangle: leaf.triangle };
        }
        // Children come after their parent.
        for index in (0..self.nodes.len()).rev() {
            let Node { first, count, .. } = self.nodes[index];
            let first = first as usize;
            let (mut min, mut max) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
            if count == 0 {
                let (left, right) = (&self.nodes[first], &self.nodes[first + 1]);
                (min, max) = (left.min.min(right.min), left.max.max(right.max));
            }
            for leaf in &self.leaves[first..first + count as usize] {
                for vertex in self.triangles[leaf.triangle as usize] {
                    min = min.min(vertices[vertex as usize]);
                    max = max.max(vertices[vertex as usize]);
                }
            }
            self.nodes[index].min = min;
            self.nodes[index].max = max;
        }
    }
}

fn check(vertices: &[Vec3], triangles: &[[u32; 3]]) -> Result<(), FusionError> {
    let count = vertices.len();
    if triangles.is_empty() {
        return Err(FusionError::EmptyMesh);
    }
    if let Some(&vertex) = triangles
        .iter()
        .flatten()
        .find(|&&vertex| vertex as usize >= count)
    {
        return Err(FusionError::MissingVertex { vertex, count });
    }
    if let Some(vertex) = vertices.iter().position(|vertex| !vertex.is_finite()) {
        return Err(FusionError::VertexNotFinite { vertex });
    }
    Ok(())
}

/// Halves a leaf at the median of its longest side until leaves are small.
fn split(nodes: &mut Vec<Node>, node: usize, order: &mut [u32], centers: &[Vec3]) {
    let Node { first, count, .. } = nodes[node];
    if count as usize <= LEAF_TRIANGLES {
        return;
    }
    let range = first as usize..(first + count) as usize;
    let part = &mut order[range];
    let (mut min, mut max) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    for &triangle in part.iter() {
        min = min.min(centers[triangle as usize]);
        max = max.max(centers[triangle as usize]);
    }
    let axis = (max - min).max_position();
    let half = part.len() / 2;
    // Ties are broken by number, so that the tree is the same everywhere.
    part.select_nth_unstable_by(half, |&a, &b| {
        centers[a as usize][axis]
            .total_cmp(&centers[b as usize][axis])
            .then(a.cmp(&b))
    });
    let left = nodes.len();
    nodes.push(Node::leaf(first, half));
    nodes.push(Node::leaf(first + half as u32, count as usize - half));
    nodes[node].first = left as u32;
    nodes[node].count = 0;
    split(nodes, left, order, centers);
    split(nodes, left + 1, order, centers);
}

impl Node {
    fn leaf(first: u32, count: usize) -> Self {
        Self { min: Vec3::ZERO, first, max: Vec3::ZERO, count: count as u32 }
    }

    #[inline]
    fn distance_squared(&self, point: Vec3) -> f32 {
        (self.min - point)
            .max(point - self.max)
            .max(Vec3::ZERO)
            .length_squared()
    }
}

impl Leaf {
    fn unset(triangle: u32) -> Self {
        Self { corner: Vec3::ZERO, edge_ab: Vec3::ZERO, edge_ac: Vec3::ZERO, triangle }
    }

    #[inline]
    fn at(&self, weights: Vec3) -> Vec3 {
        self.corner + self.edge_ab * weights.y + self.edge_ac * weights.z
    }

    /// Weights of the nearest point, region by region (Ericson 2005, section 5.1.5).
    #[inline]
    fn closest(&self, point: Vec3) -> Vec3 {
        let from_a = point - self.corner;
        let d1 = self.edge_ab.dot(from_a);
        let d2 = self.edge_ac.dot(from_a);
        if d1 <= 0.0 && d2 <= 0.0 {
            return Vec3::X;
        }
        let from_b = from_a - self.edge_ab;
        let d3 = self.edge_ab.dot(from_b);
        let d4 = self.edge_ac.dot(from_b);
        if d3 >= 0.0 && d4 <= d3 {
            return Vec3::Y;
        }
        let vc = d1 * d4 - d3 * d2;
        if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
            let along = d1 / (d1 - d3);
            return vec3(1.0 - along, along, 0.0);
        }
        let from_c = from_a - self.edge_ac;
        let d5 = self.edge_ab.dot(from_c);
        let d6 = self.edge_ac.dot(from_c);
        if d6 >= 0.0 && d5 <= d6 {
            return Vec3::Z;
        }
        let vb = d5 * d2 - d1 * d6;
        if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
            let along = d2 / (d2 - d6);
            return vec3(1.0 - along, 0.0, along);
        }
        let va = d3 * d6 - d5 * d4;
        if va <= 0.0 && d4 >= d3 && d5 >= d6 {
            let along = (d4 - d3) / ((d4 - d3) + (d5 - d6));
            return vec3(0.0, 1.0 - along, along);
        }
        let total = va + vb + vc;
        vec3(va / total, vb / total, vc / total)
    }
}

impl PseudoNormals {
    fn update(&mut self, vertices: &[Vec3], triangles: &[[u32; 3]]) {
        self.corners.clear();
        self.corners.resize(vertices.len(), Vec3::ZERO);
        self.faces.clear();
        for corners in triangles {
            let [a, b, c] = corners.map(|vertex| vertices[vertex as usize]);
            let normal = doubled_area_normal(a, b, c).normalize_or_zero();
            self.faces.push(normal);
            for (corner, [at, left, right]) in
                [[a, b, c], [b, c, a], [c, a, b]].into_iter().enumerate()
            {
                let angle = (left - at).angle_between(right - at);
                if angle.is_finite() {
                    self.corners[corners[corner] as usize] += angle * normal;
                }
            }
        }
        self.sum_over_edges(triangles);
    }

    fn sum_over_edges(&mut self, triangles: &[[u32; 3]]) {
        let sides = |[a, b, c]: [u32; 3]| [(a, b), (b, c), (c, a)];
        let mut sums: FxHashMap<(u32, u32), Vec3> = FxHashMap::default();
        for (&corners, &normal) in triangles.iter().zip(&self.faces) {
            for (from, to) in sides(corners) {
                *sums.entry((from.min(to), from.max(to))).or_default() += normal;
            }
        }
        self.edges.clear();
        self.edges.extend(
            triangles.iter().map(|&corners| {
                sides(corners).map(|(from, to)| sums[&(from.min(to), from.max(to))])
            }),
        );
    }
}

#[cfg(test)]
mod tests {
    use super::super::{
        primitives::{cuboid, sphere},
        sample::{SplitMix, sample_surface},
    };
    use super::*;

    fn points_around(count: usize, seed: u64) -> Vec<Vec3> {
        let mut random = SplitMix::new(seed);
        let mut coordinate = || random.unit_f64() as f32 * 3.0 - 1.5;
        (0..count)
            .map(|_| vec3(coordinate(), coordinate(), coordinate()))
            .collect()
    }

    fn brute_force(mesh: &TriangleMesh, point: Vec3) -> f32 {
        (0..mesh.triangles.len())
            .map(|triangle| {
                let [a, b, c] = mesh.corners(triangle);
                let leaf = Leaf { corner: a, edge_ab: b - a, edge_ac: c - a, triangle: 0 };
                leaf.at(leaf.closest(point)).distance(point)
            })
            .fold(f32::INFINITY, f32::min)
    }

    #[test]
    fn the_tree_finds_what_brute_force_finds() {
        let mut mesh = sphere(vec3(0.2, 0.0, 0.0), 0.7, 3);
        let brick = cuboid(vec3(-1.0, -0.2, -0.3), vec3(-0.5, 0.4, 0.3));
        let offset = mesh.vertices.len() as u32;
        mesh.vertices.extend(&brick.vertices);
        mesh.triangles
            .extend(brick.triangles.iter().map(|t| t.map(|v| v + offset)));
        let tree = ClosestPoint::from_mesh(&mesh).unwrap();
        let points = points_around(500, 1);
        for (&point, hit) in points.iter().zip(tree.query_all(&points)) {
            assert_eq!(hit, tree.query(point));
            assert_eq!(hit.distance, brute_force(&mesh, point));
            let [a, b, c] = mesh.corners(hit.triangle as usize);
            let blended = a * hit.barycentric.x + b * hit.barycentric.y + c * hit.barycentric.z;
            assert!(blended.distance(hit.point) < 1e-6);
            assert!((hit.point.distance(point) - hit.distance).abs() < 1e-6);
        }
    }

    #[test]
    fn a_limited_query_finds_the_same_or_nothing() {
        let mesh = sphere(Vec3::ZERO, 1.0, 3);
        let tree = ClosestPoint::from_mesh(&mesh).unwrap();
        for point in points_around(500, 2) {
            let hit = tree.query(point);
            assert_eq!(
                tree.query_within(point, 0.2),
                (hit.distance <= 0.2).then_some(hit)
            );
        }
    }

    #[test]
    fn distance_is_negative_inside_a_cuboid_even_at_its_corners() {
        let (min, max) = (vec3(-0.5, -0.6, -0.7), vec3(0.5, 0.6, 0.7));
        let tree = ClosestPoint::from_mesh(&cuboid(min, max)).unwrap();
        for point in points_around(2000, 3) {
            let outside = (min - point).max(point - max);
            let expected = outside.max(Vec3::ZERO).length() + outside.max_element().min(0.0);
            assert!(
                (tree.signed_distance(point) - expected).abs() < 1e-5,
                "at {point}"
            );
        }
    }

    #[test]
    fn refitting_is_as_good_as_building_anew() {
        let mesh = sphere(Vec3::ZERO, 1.0, 3);
        let mut tree = ClosestPoint::from_mesh(&mesh).unwrap();
        let bent: Vec<Vec3> = mesh
            .vertices
            .iter()
            .map(|v| vec3(v.x + 0.5 * v.y * v.y, 0.4 * v.y, v.z))
            .collect();
        tree.refit(&bent).unwrap();
        let mut quick = ClosestPoint::from_mesh(&mesh).unwrap();
        quick.refit_distances(&bent).unwrap();
        let anew = ClosestPoint::new(&bent, &mesh.triangles).unwrap();
        for point in points_around(500, 4) {
            assert_eq!(tree.query(point).distance, anew.query(point).distance);
            assert_eq!(quick.query(point), tree.query(point));
            assert!((tree.signed_distance(point) - anew.signed_distance(point)).abs() < 1e-6);
        }
    }

    #[test]
    fn a_point_on_the_surface_is_at_distance_zero() {
        let mesh = sphere(Vec3::ZERO, 1.0, 3);
        let tree = ClosestPoint::from_mesh(&mesh).unwrap();
        for sample in sample_surface(&mesh, 200, 5) {
            assert!(tree.query(sample.point).distance < 1e-6);
        }
    }

    #[test]
    fn bad_meshes_are_refused_and_bad_queries_answered() {
        assert!(matches!(
            ClosestPoint::new(&[], &[]),
            Err(FusionError::EmptyMesh)
        ));
        let missing = ClosestPoint::new(&[Vec3::ZERO], &[[0, 0, 1]]);
        assert!(matches!(
            missing,
            Err(FusionError::MissingVertex { vertex: 1, count: 1 })
        ));
        let broken = ClosestPoint::new(&[Vec3::ZERO, Vec3::NAN], &[[0, 0, 1]]);
        assert!(matches!(
            broken,
            Err(FusionError::VertexNotFinite { vertex: 1 })
        ));
        let tree = ClosestPoint::from_mesh(&sphere(Vec3::ZERO, 1.0, 1)).unwrap();
        assert!(tree.query(Vec3::NAN).distance.is_nan());
        assert!(tree.query_within(Vec3::NAN, 1.0).is_none());
    }
}
