//! Catmull-Clark subdivision of a closed polygon surface (Catmull and Clark 1978).

use glam::Vec4;
use rustc_hash::FxHashMap;

/// A closed surface of polygons whose points carry x, y, z and one more smooth value.
#[derive(Clone, Debug, Default)]
pub(super) struct PolygonSurface {
    pub(super) points: Vec<Vec4>,
    pub(super) faces: Vec<Vec<u32>>,
    /// The point on the other side of the midline plane.
    pub(super) mirror: Vec<u32>,
}

/// Edges numbered in the order in which the faces meet them.
struct Edges {
    ends: Vec<[u32; 2]>,
    faces: Vec<[u32; 2]>,
    index: FxHashMap<[u32; 2], u32>,
}

impl PolygonSurface {
    /// One step: every n-gon becomes n quads. New points come in the order old points, edges, faces.
    pub(super) fn subdivided(&self) -> Self {
        let edges = Edges::of(&self.faces);
        let face_points: Vec<Vec4> = self.faces.iter().map(|face| self.mean(face)).collect();
        let edge_points = edges.ends.iter().zip(&edges.faces).map(|(ends, faces)| {
            let of_faces = (face_points[faces[0] as usize] + face_points[faces[1] as usize]) * 0.5;
            (self.mean(ends) + of_faces) * 0.5
        });
        let mut points = self.vertex_points(&edges, &face_points);
        points.extend(edge_points);
        points.extend(&face_points);
        Self { points, faces: self.split_faces(&edges), mirror: self.split_mirror(&edges) }
    }

    fn mean(&self, ids: &[u32]) -> Vec4 {
        ids.iter().map(|&i| self.points[i as usize]).sum::<Vec4>() / ids.len() as f32
    }

    /// `(F + 2 R + (n - 3) P) / n` with the means `F` of the face points and `R` of the edge midpoints.
    fn vertex_points(&self, edges: &Edges, face_points: &[Vec4]) -> Vec<Vec4> {
        let mut faces = vec![Vec4::ZERO; self.points.len()];
        let mut middles = vec![Vec4::ZERO; self.points.len()];
        let mut valence = vec![0.0_f32; self.points.len()];
        for (face, point) in self.faces.iter().zip(face_points) {
            for &i in face {
                faces[i as usize] += *point;
            }
        }
        for ends in &edges.ends {
            let middle = self.mean(ends);
            for &i in ends {
                middles[i as usize] += middle;
                valence[i as usize] += 1.0;
            }
        }
        (0..self.points.len())
            .map(|i| {
                let n = valence[i];
                (faces[i] / n + middles[i] * 2.0 / n + self.points[i] * (n - 3.0)) / n
            })
            .collect()
    }

    fn split_faces(&self, edges: &Edges) -> Vec<Vec<u32>> {
        let first_edge = self.points.len() as u32;
        let first_face = first_edge + edges.ends.len() as u32;
        let mut quads = Vec::with_capacity(self.faces.len() * 4);
        for (number, face) in (first_face..).zip(&self.faces) {
            for corner in 0..face.len() {
                let before = face[(corner + face.len() - 1) % face.len()];
                let (here, after) = (face[corner], face[(corner + 1) % face.len()]);
                let incoming = first_edge + edges.index[&key(before, here)];
                let outgoing = first_edge + edges.index[&key(here, after)];
                quads.push(vec![here, outgoing, number, incoming]);
            }
        }
        quads
    }

    fn split_mirror(&self, edges: &Edges) -> Vec<u32> {
        let first_edge = self.points.len() as u32;
        let first_face = first_edge + edges.ends.len() as u32;
        let mut mirror = self.mirror.clone();
        mirror.extend(edges.ends.iter().map(|ends| {
            let [a, b] = ends.map(|i| self.mirror[i as usize]);
            first_edge + edges.index[&key(a, b)]
        }));
        let sorted = |face: &[u32]| {
            let mut face = face.to_vec();
            face.sort_unstable();
            face
        };
        let numbers: FxHashMap<Vec<u32>, u32> = (first_face..)
            .zip(&self.faces)
            .map(|(n, face)| (sorted(face), n))
            .collect();
        mirror.extend(self.faces.iter().map(|face| {
            let other: Vec<u32> = face.iter().map(|&i| self.mirror[i as usize]).collect();
            numbers[&sorted(&other)]
        }));
        mirror
    }
}

impl Edges {
    fn of(faces: &[Vec<u32>]) -> Self {
        let mut edges = Self { ends: Vec::new(), faces: Vec::new(), index: FxHashMap::default() };
        for (number, face) in (0..).zip(faces) {
            for (i, &a) in face.iter().enumerate() {
                let ends = key(a, face[(i + 1) % face.len()]);
                let next = edges.ends.len() as u32;
                let edge = *edges.index.entry(ends).or_insert(next);
                if edge == next {
                    edges.ends.push(ends);
                    edges.faces.push([number; 2]);
                } else {
                    edges.faces[edge as usize][1] = number;
                }
            }
        }
        edges
    }
}

fn key(a: u32, b: u32) -> [u32; 2] {
    [a.min(b), a.max(b)]
}
