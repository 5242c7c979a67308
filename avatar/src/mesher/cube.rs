//! The polygons that separate the inside corners of a cube from the outside ones.
//!
//! The table is derived, not listed: on each face every run of inside corners is cut off by a segment, and
//! the segments of six faces close to polygons. A face is cut the same way from both of its cubes, so the
//! polygons of neighbouring cubes fit together without holes.

use std::sync::LazyLock;

/// One closed polygon around inside corners, counter-clockwise seen from outside the surface.
#[derive(Clone, Debug)]
pub(super) struct Polygon {
    /// Numbers of the cube's edges it crosses.
    pub(super) edges: Vec<u8>,
    /// Positions in `edges` from which a fan of triangles has no diagonal in a face of the cube, where
    /// the neighbouring cube could have the same one.
    pub(super) fan_starts: Vec<u8>,
}

/// For each of the 256 sets of inside corners, its polygons. Corner `c` lies at
/// `(c & 1, c >> 1 & 1, c >> 2 & 1)`.
pub(super) struct CubeTable {
    /// Lower corner first.
    edges: Vec<[usize; 2]>,
    polygons: Vec<Vec<Polygon>>,
}

impl CubeTable {
    pub(super) fn get() -> &'static Self {
        static TABLE: LazyLock<CubeTable> = LazyLock::new(CubeTable::derive);
        &TABLE
    }

    /// The polygons for a set of inside corners, a bit each.
    pub(super) fn polygons(&self, inside: u8) -> &[Polygon] {
        &self.polygons[usize::from(inside)]
    }

    pub(super) fn edge_corners(&self, edge: u8) -> [usize; 2] {
        self.edges[usize::from(edge)]
    }

    fn derive() -> Self {
        let edges: Vec<[usize; 2]> = (0..3)
            .flat_map(|axis| {
                (0..8)
                    .filter(move |corner| corner >> axis & 1 == 0)
                    .map(move |corner| [corner, corner | 1 << axis])
            })
            .collect();
        let polygons = (0..=255_u8)
            .map(|inside| polygons_of(inside, &edges))
            .collect();
        Self { edges, polygons }
    }
}

/// The corners of the six faces, counter-clockwise seen from outside the cube.
fn faces() -> [[usize; 4]; 6] {
    std::array::from_fn(|face| {
        let (axis, side) = (face / 2, face % 2);
        let (u, v) = (1 << ((axis + 1) % 3), 1 << ((axis + 2) % 3));
        let mut corners = [0, u, u | v, v].map(|corner| corner | side << axis);
        if side == 0 {
            corners.reverse();
        }
        corners
    })
}

fn edge_number(edges: &[[usize; 2]], a: usize, b: usize) -> usize {
    edges
        .iter()
        .position(|&edge| edge == [a.min(b), a.max(b)])
        .expect("neighbours on a face share an edge of the cube")
}

fn polygons_of(inside: u8, edges: &[[usize; 2]]) -> Vec<Polygon> {
    let mut next = next_edges(inside, edges);
    let mut polygons = Vec::new();
    for start in 0..edges.len() {
        let mut polygon = Vec::new();
        let mut edge = start;
        while let Some(following) = next[edge].take() {
            polygon.push(edge as u8);
            edge = following;
        }
        if !polygon.is_empty() {
            let fan_starts = fan_starts(&polygon, edges);
            polygons.push(Polygon { edges: polygon, fan_starts });
        }
    }
    polygons
}

/// For each crossed edge, the one that follows it: on a face, the edge where a run of inside corners
/// begins is followed by the edge where the run ends.
fn next_edges(inside: u8, edges: &[[usize; 2]]) -> [Option<usize>; 12] {
    let is_inside = |corner: usize| inside >> corner & 1 == 1;
    let mut next = [None; 12];
    for face in faces() {
        for start in 0..4 {
            let (before, first) = (face[(start + 3) % 4], face[start]);
            if is_inside(before) || !is_inside(first) {
                continue;
            }
            let length = (1..4)
                .find(|&step| !is_inside(face[(start + step) % 4]))
                .expect("the corner before the run is outside");
            let (last, after) = (face[(start + length - 1) % 4], face[(start + length) % 4]);
            next[edge_number(edges, before, first)] = Some(edge_number(edges, last, after));
        }
    }
    next
}

fn fan_starts(polygon: &[u8], edges: &[[usize; 2]]) -> Vec<u8> {
    let count = polygon.len();
    let share_a_face = |a: u8, b: u8| {
        let corners = [edges[usize::from(a)], edges[usize::from(b)]].concat();
        faces()
            .iter()
            .any(|face| corners.iter().all(|corner| face.contains(corner)))
    };
    (0..count)
        .filter(|&start| {
            (2..count - 1)
                .all(|step| !share_a_face(polygon[start], polygon[(start + step) % count]))
        })
        .map(|start| start as u8)
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_polygon_has_a_fan_without_diagonals_in_faces() {
        let table = CubeTable::get();
        for inside in 0..=255 {
            for polygon in table.polygons(inside) {
                assert!((3..=7).contains(&polygon.edges.len()));
                assert!(!polygon.fan_starts.is_empty(), "corners {inside:08b}");
            }
        }
    }

    #[test]
    fn every_crossed_edge_is_used_exactly_once() {
        let table = CubeTable::get();
        for inside in 0..=255_u8 {
            let mut used: Vec<u8> = table
                .polygons(inside)
                .iter()
                .flat_map(|p| p.edges.clone())
                .collect();
            used.sort_unstable();
            let crossed: Vec<u8> = (0..12)
                .filter(|&edge| {
                    let [a, b] = table.edge_corners(edge);
                    (inside >> a ^ inside >> b) & 1 == 1
                })
                .collect();
            assert_eq!(used, crossed, "corners {inside:08b}");
        }
    }
}
