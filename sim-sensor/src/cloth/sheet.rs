//! An open triangle mesh while it is cut and sewn: edges, borders, neighbours, smoothing.

use std::collections::{BTreeMap, BTreeSet};

use glam::Vec3;

/// No triangle, or no vertex, on that side of an edge.
pub(super) const NONE: u32 = u32::MAX;

/// A piece of cloth; triangles run counter-clockwise seen from outside.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Sheet {
    pub points: Vec<Vec3>,
    pub triangles: Vec<[u32; 3]>,
}

/// An edge with the triangles on its sides.
#[derive(Clone, Copy, Debug)]
pub(super) struct Edge {
    pub(super) ends: [u32; 2],
    pub(super) triangles: [u32; 2],
    /// The corners of those triangles that are not on the edge.
    pub(super) opposite: [u32; 2],
}

/// Lists of numbers, one list for each of a row of things.
#[derive(Clone, Debug, Default)]
pub(super) struct Lists {
    starts: Vec<u32>,
    items: Vec<u32>,
}

impl Edge {
    pub(super) fn is_border(&self) -> bool {
        self.triangles[1] == NONE
    }
}

impl Lists {
    /// From pairs of a list's number and an item.
    pub(super) fn of(count: usize, mut pairs: Vec<(u32, u32)>) -> Self {
        pairs.sort_unstable();
        pairs.dedup();
        let mut starts = vec![0; count + 1];
        for &(list, _) in &pairs {
            starts[list as usize + 1] += 1;
        }
        for list in 0..count {
            starts[list + 1] += starts[list];
        }
        Self { starts, items: pairs.into_iter().map(|(_, item)| item).collect() }
    }

    pub(super) fn get(&self, list: u32) -> &[u32] {
        let list = list as usize;
        &self.items[self.starts[list] as usize..self.starts[list + 1] as usize]
    }
}

impl Sheet {
    /// All edges, by the numbers of their ends.
    pub(super) fn edges(&self) -> Vec<Edge> {
        let mut edges: BTreeMap<[u32; 2], Edge> = BTreeMap::new();
        for (number, &[a, b, c]) in self.triangles.iter().enumerate() {
            for [from, to, other] in [[a, b, c], [b, c, a], [c, a, b]] {
                let side = ([number as u32, NONE], [other, NONE]);
                edges
                    .entry([from.min(to), from.max(to)])
                    .and_modify(|edge| {
                        edge.triangles[1] = number as u32;
                        edge.opposite[1] = other;
                    })
                    .or_insert(Edge {
                        ends: [from.min(to), from.max(to)],
                        triangles: side.0,
                        opposite: side.1,
                    });
            }
        }
        edges.into_values().collect()
    }

    pub(super) fn neighbours(&self) -> Lists {
        let both = |&[a, b, c]: &[u32; 3]| [(a, b), (b, a), (b, c), (c, b), (c, a), (a, c)];
        Lists::of(
            self.points.len(),
            self.triangles.iter().flat_map(both).collect(),
        )
    }

    pub(super) fn triangles_of_points(&self) -> Lists {
        let pairs = self.triangles.iter().enumerate();
        Lists::of(
            self.points.len(),
            pairs
                .flat_map(|(number, corners)| corners.map(|point| (point, number as u32)))
                .collect(),
        )
    }

    /// For each point, the points before and after it along the border; `NONE` inside.
    pub(super) fn border_links(&self) -> Vec<[u32; 2]> {
        let mut links = vec![[NONE; 2]; self.points.len()];
        let mut directed: BTreeSet<[u32; 2]> = BTreeSet::new();
        for &[a, b, c] in &self.triangles {
            for side in [[a, b], [b, c], [c, a]] {
                directed.insert(side);
            }
        }
        for &[from, to] in &directed {
            if !directed.contains(&[to, from]) {
                links[from as usize][1] = to;
                links[to as usize][0] = from;
            }
        }
        links
    }

    /// Closed borders, each in the order in which its triangles run along it.
    pub(super) fn border_loops(&self) -> Vec<Vec<u32>> {
        let links = self.border_links();
        let mut seen = vec![false; links.len()];
        let mut loops = Vec::new();
        for start in 0..links.len() as u32 {
            let mut around = Vec::new();
            let mut at = start;
            while at != NONE && links[at as usize][1] != NONE && !seen[at as usize] {
                seen[at as usize] = true;
                around.push(at);
                at = links[at as usize][1];
            }
            if !around.is_empty() {
                loops.push(around);
            }
        }
        loops
    }

    pub(super) fn normals(&self) -> Vec<Vec3> {
        effigy_fusion::mesh::normals::vertex_normals(&self.points, &self.triangles)
    }

    pub(super) fn area_m2(&self) -> f32 {
        let doubled = self.triangles.iter().map(|corners| {
            let [a, b, c] = corners.map(|v| self.points[v as usize]);
            (b - a).cross(c - a).length()
        });
        0.5 * doubled.sum::<f32>()
    }

    /// Keeps the largest connected part.
    pub(super) fn largest_part(self) -> Self {
        let mesh = effigy_fusion::mesh::TriangleMesh::new(self.points, self.triangles);
        let mesh = effigy_fusion::mesh::components::largest_component(&mesh);
        Self { points: mesh.vertices, triangles: mesh.triangles }
    }

    /// One round of smoothing: points go towards the mean of their neighbours, border points along the border.
    pub(super) fn smooth(&mut self, neighbours: &Lists, border: &[[u32; 2]], share: f32) {
        let before = self.points.clone();
        for (v, point) in self.points.iter_mut().enumerate() {
            let [last, next] = border[v];
            let around = neighbours.get(v as u32);
            if next != NONE && last != NONE {
                let middle = 0.5 * (before[last as usize] + before[next as usize]);
                *point = point.lerp(middle, 0.6 * share);
            } else if !around.is_empty() {
                let sum: Vec3 = around.iter().map(|&o| before[o as usize]).sum();
                *point = point.lerp(sum / around.len() as f32, share);
            }
        }
    }
}
