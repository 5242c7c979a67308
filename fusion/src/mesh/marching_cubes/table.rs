//! The triangles of a cell for each of the 256 ways its corners can lie inside or outside.
//!
//! The table is derived, not typed in. On each face, every run of inside corners is cut off by a line of its
//! own; that depends on the face's four corners only, so both cells at a face draw the same lines. The lines
//! of a cell link up into loops, and each loop is filled with triangles whose inner edges do not lie in a
//! face, where the neighbour could have the same edge too.

use std::sync::LazyLock;

use glam::{IVec3, ivec3};

/// No case needs more.
const MAX_TRIANGLES: usize = 12;

pub(super) static TABLE: LazyLock<Vec<Case>> = LazyLock::new(|| (0..256).map(Case::new).collect());

/// How the surface passes through a cell: triangles between vertices on its edges.
pub(super) struct Case {
    count: usize,
    triangles: [[u8; 3]; MAX_TRIANGLES],
}

impl Case {
    pub(super) fn triangles(&self) -> &[[u8; 3]] {
        &self.triangles[..self.count]
    }

    /// `inside` has a bit for each corner.
    fn new(inside: usize) -> Self {
        let mut case = Self { count: 0, triangles: [[0; 3]; MAX_TRIANGLES] };
        for ring in loops(inside) {
            let (_, triangles) = fill(&ring, 0, ring.len() - 1)
                .expect("each loop has a filling without edges in a face, as the test shows");
            for triangle in triangles {
                case.triangles[case.count] = triangle;
                case.count += 1;
            }
        }
        case
    }
}

/// Where a corner lies in its cell: bit 0 of its number is x, bit 1 is y, bit 2 is z.
pub(super) fn offset(corner: usize) -> IVec3 {
    let bit = |axis: usize| (corner >> axis & 1) as i32;
    ivec3(bit(0), bit(1), bit(2))
}

/// The two corners of an edge, the lower one first. Edge `4 * axis + i` runs along `axis`.
pub(super) fn ends(edge: usize) -> [usize; 2] {
    let axis = edge / 4;
    // The edge's number within its axis is its place on the other two axes.
    let low_bits = edge & ((1 << axis) - 1);
    let high_bits = (edge % 4) >> axis << (axis + 1);
    let low = low_bits | high_bits;
    [low, low | 1 << axis]
}

fn edge_between(a: usize, b: usize) -> u8 {
    (0..12)
        .find(|&edge| ends(edge) == [a.min(b), a.max(b)])
        .expect("the corners are neighbours") as u8
}

/// The corners of a face, counter-clockwise as seen from outside the cell.
fn face_corners(axis: usize, side: usize) -> [usize; 4] {
    let (u, v) = (1 << ((axis + 1) % 3), 1 << ((axis + 2) % 3));
    let base = side << axis;
    if side == 1 {
        [base, base | u, base | u | v, base | v]
    } else {
        [base, base | v, base | u | v, base | u]
    }
}

/// The closed loops of crossed edges, each running so that the inside lies on the same hand.
fn loops(inside: usize) -> Vec<Vec<u8>> {
    let mut next = [None; 12];
    for (axis, side) in (0..3).flat_map(|axis| [(axis, 0), (axis, 1)]) {
        let corners = face_corners(axis, side);
        let is_inside = |index: usize| inside >> corners[index % 4] & 1 == 1;
        let crossing = |index: usize| edge_between(corners[index % 4], corners[(index + 1) % 4]);
        for enter in (0..4).filter(|&index| !is_inside(index) && is_inside(index + 1)) {
            let leave = (enter + 1..enter + 4)
                .find(|&index| is_inside(index) && !is_inside(index + 1))
                .expect("a face that is entered is left");
            next[crossing(enter) as usize] = Some(crossing(leave));
        }
    }
    let mut loops = Vec::new();
    for start in 0..12 {
        let mut ring = Vec::new();
        let mut edge = start;
        while let Some(following) = next[edge].take() {
            ring.push(edge as u8);
            edge = following as usize;
        }
        if !ring.is_empty() {
            loops.push(ring);
        }
    }
    loops
}

/// Triangles between corners `from..=to` of a loop with the shortest inner edges, and the cost of these.
fn fill(ring: &[u8], from: usize, to: usize) -> Option<(i32, Vec<[u8; 3]>)> {
    if to - from < 2 {
        return Some((0, Vec::new()));
    }
    let mut best: Option<(i32, Vec<[u8; 3]>)> = None;
    for apex in from + 1..to {
        let Some(cost) = diagonal(ring, from, apex).zip(diagonal(ring, apex, to)) else {
            continue;
        };
        let Some((left, right)) = fill(ring, from, apex).zip(fill(ring, apex, to)) else {
            continue;
        };
        let cost = cost.0 + cost.1 + left.0 + right.0;
        if best.as_ref().is_none_or(|(least, _)| cost < *least) {
            let mut triangles = left.1;
            triangles.extend(right.1);
            triangles.push([ring[from], ring[apex], ring[to]]);
            best = Some((cost, triangles));
        }
    }
    best
}

/// The squared length of a line across a loop, with vertices at the edges' middles; `None` if it lies in a
/// face, 0 if it is part of the loop.
fn diagonal(ring: &[u8], from: usize, to: usize) -> Option<i32> {
    if to - from == 1 || to - from == ring.len() - 1 {
        return Some(0);
    }
    let middle = |edge: u8| ends(edge as usize).map(offset).iter().sum::<IVec3>();
    let (a, b) = (middle(ring[from]), middle(ring[to]));
    // Doubled coordinates: 0 and 2 are the cell's faces.
    let share_face = (0..3).any(|axis| a[axis] == b[axis] && a[axis] != 1);
    (!share_face).then(|| a.distance_squared(b))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_case_uses_exactly_its_crossed_edges() {
        for inside in 0..256 {
            let mut used: Vec<u8> = TABLE[inside]
                .triangles()
                .iter()
                .flatten()
                .copied()
                .collect();
            used.sort_unstable();
            used.dedup();
            let crossed: Vec<u8> = (0..12)
                .filter(|&edge| {
                    let [a, b] = ends(edge as usize);
                    (inside >> a ^ inside >> b) & 1 == 1
                })
                .collect();
            assert_eq!(used, crossed, "case {inside:08b}");
        }
    }

    #[test]
    fn a_single_inside_corner_is_cut_off_by_one_triangle_facing_away_from_it() {
        for corner in 0..8 {
            let case = &TABLE[1 << corner];
            let [triangle] = case.triangles() else {
                panic!("one triangle")
            };
            let [a, b, c] = triangle.map(|edge| {
                ends(edge as usize)
                    .map(offset)
                    .iter()
                    .sum::<IVec3>()
                    .as_vec3()
                    / 2.0
            });
            let outward = (b - a).cross(c - a).dot(a - offset(corner).as_vec3());
            assert!(outward > 0.0, "corner {corner}");
        }
    }
}
