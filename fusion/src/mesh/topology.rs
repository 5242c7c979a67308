//! How a mesh's triangles hang together: edges, borders, watertightness.

use glam::Vec3;
use rustc_hash::FxHashMap;

use super::TriangleMesh;

/// How the edges of a mesh are shared.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct EdgeReport {
    pub edges: usize,
    /// Edges with a triangle on one side only.
    pub border: usize,
    /// Edges of more than two triangles.
    pub non_manifold: usize,
    /// Edges whose two triangles run along them in the same direction.
    pub flipped: usize,
    /// Triangles that name a vertex twice.
    pub degenerate: usize,
}

impl EdgeReport {
    pub fn is_watertight(&self) -> bool {
        self.edges > 0
            && [
                self.border,
                self.non_manifold,
                self.flipped,
                self.degenerate,
            ] == [0; 4]
    }
}

impl TriangleMesh {
    /// Whether each edge has exactly two triangles, which run along it in opposite directions.
    pub fn is_watertight(&self) -> bool {
        self.edge_report().is_watertight()
    }

    pub fn edge_report(&self) -> EdgeReport {
        edge_report(&self.triangles)
    }

    /// The volume enclosed, if the mesh is watertight; positive if its triangles face outwards.
    pub fn volume(&self) -> f32 {
        let sixfold: f64 = (0..self.triangles.len())
            .map(|triangle| {
                let [a, b, c] = self.corners(triangle).map(Vec3::as_dvec3);
                a.dot(b.cross(c))
            })
            .sum();
        (sixfold / 6.0) as f32
    }
}

pub fn edge_report(triangles: &[[u32; 3]]) -> EdgeReport {
    // Times an edge is run along upwards and downwards.
    let mut directions: FxHashMap<(u32, u32), [u32; 2]> = FxHashMap::default();
    let mut report = EdgeReport::default();
    for &[a, b, c] in triangles {
        if a == b || b == c || c == a {
            report.degenerate += 1;
            continue;
        }
        for (from, to) in [(a, b), (b, c), (c, a)] {
            let edge = (from.min(to), from.max(to));
            directions.entry(edge).or_default()[usize::from(from > to)] += 1;
        }
    }
    report.edges = directions.len();
    for [up, down] in directions.into_values() {
        match (up, down) {
            (1, 1) => {}
            (1, 0) | (0, 1) => report.border += 1,
            (2, 0) | (0, 2) => report.flipped += 1,
            _ => report.non_manifold += 1,
        }
    }
    report
}

#[cfg(test)]
mod tests {
    use glam::{Vec3, vec3};

    use super::super::primitives::{cuboid, sphere};

    #[test]
    fn a_missing_a_turned_and_a_doubled_triangle_are_each_noticed() {
        let whole = sphere(Vec3::ZERO, 1.0, 1);
        assert!(whole.is_watertight());

        let mut open = whole.clone();
        open.triangles.pop();
        assert_eq!(open.edge_report().border, 3);

        let mut turned = whole.clone();
        turned.triangles[0].swap(0, 1);
        assert_eq!(turned.edge_report().flipped, 3);

        let mut doubled = whole;
        doubled.triangles.push(doubled.triangles[0]);
        assert_eq!(doubled.edge_report().non_manifold, 3);
    }

    #[test]
    fn a_cuboid_has_its_volume() {
        let mesh = cuboid(Vec3::ZERO, vec3(1.0, 2.0, 3.0));
        assert!((mesh.volume() - 6.0).abs() < 1e-5);
    }
}
