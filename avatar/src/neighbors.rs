//! Which vertices of a mesh share an edge.

use glam::Vec3;

/// The neighbours of each vertex in rising order, packed.
pub(crate) struct Neighbors {
    starts: Vec<u32>,
    vertices: Vec<u32>,
}

impl Neighbors {
    pub(crate) fn new(vertex_count: usize, triangles: &[[u32; 3]]) -> Self {
        let mut edges: Vec<(u32, u32)> = triangles
            .iter()
            .flat_map(|&[a, b, c]| [(a, b), (b, a), (b, c), (c, b), (c, a), (a, c)])
            .collect();
        edges.sort_unstable();
        edges.dedup();
        let mut starts = vec![0_u32; vertex_count + 1];
        for &(from, _) in &edges {
            starts[from as usize + 1] += 1;
        }
        for vertex in 0..vertex_count {
            starts[vertex + 1] += starts[vertex];
        }
        Self { starts, vertices: edges.into_iter().map(|(_, to)| to).collect() }
    }

    pub(crate) fn of(&self, vertex: usize) -> &[u32] {
        &self.vertices[self.starts[vertex] as usize..self.starts[vertex + 1] as usize]
    }

    /// The mean length of the edges; 0 without any.
    pub(crate) fn mean_edge(&self, positions: &[Vec3]) -> f32 {
        let mut sum = 0.0_f64;
        for (vertex, position) in positions.iter().enumerate() {
            for &other in self.of(vertex) {
                sum += f64::from(position.distance(positions[other as usize]));
            }
        }
        (sum / self.vertices.len().max(1) as f64) as f32
    }
}
