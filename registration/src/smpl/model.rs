//! The arrays of a body model.

use std::fmt;

use glam::Vec3;
use serde::{Deserialize, Serialize};

use super::JOINT_COUNT;

/// A read-only SMPL-like model; V vertices, 24 joints, 10 betas, 207 pose inputs.
#[derive(Clone, Debug)]
pub struct BodyModel {
    pub identity: BodyIdentity,
    /// The average body in the zero pose; [V].
    pub template: Vec<Vec3>,
    /// Metres a unit of each beta; [10][V].
    pub shape_dirs: Vec<Vec<Vec3>>,
    /// Correctives a unit of `vec(R_1 - I, .., R_23 - I)`, row-major 3x3 each; sparse by input: [207],
    /// each with the vertices it moves.
    pub pose_dirs: Vec<PoseDirection>,
    /// Joints are weighted means of shaped vertices; [24].
    pub joint_regressor: Vec<SparseRow>,
    /// Skinning weights, at most four a vertex (official models are cut to their four largest); [V].
    pub skinning: Vec<VertexWeights>,
    pub triangles: Vec<[u32; 3]>,
}

/// Vertices that one pose input moves, and by how much (metres a unit).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PoseDirection {
    pub vertices: Vec<u32>,
    pub offsets: Vec<Vec3>,
}

/// `sum_k weights[k] * vertex[indices[k]]`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SparseRow {
    pub indices: Vec<u32>,
    pub weights: Vec<f32>,
}

/// Up to four bones and their weights, which sum to one; unused slots have weight zero.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct VertexWeights {
    pub bones: [u8; 4],
    pub weights: [f32; 4],
}

impl VertexWeights {
    /// The bone with the largest weight; of equal ones the first.
    pub fn main_bone(&self) -> u8 {
        let largest = (1..4).fold(0, |best, slot| {
            if self.weights[slot] > self.weights[best] {
                slot
            } else {
                best
            }
        });
        self.bones[largest]
    }
}

/// The hash of everything in a body model; trained files carry it so that bodies are never mixed up.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct BodyIdentity(pub [u8; 16]);

impl BodyModel {
    pub fn vertex_count(&self) -> usize {
        self.template.len()
    }

    /// `template + shape_dirs * betas`: the minimal body in the zero pose, without pose correctives.
    pub fn shaped_vertices(&self, betas: &[f32; 10]) -> Vec<Vec3> {
        let mut vertices = self.template.clone();
        self.shape_into(betas, &mut vertices);
        vertices
    }

    /// As [`Self::shaped_vertices`], into a buffer of V vertices.
    pub fn shape_into(&self, betas: &[f32; 10], vertices: &mut [Vec3]) {
        vertices.copy_from_slice(&self.template);
        for (directions, &beta) in self.shape_dirs.iter().zip(betas) {
            if beta == 0.0 {
                continue;
            }
            for (vertex, direction) in vertices.iter_mut().zip(directions) {
                *vertex += *direction * beta;
            }
        }
    }

    /// The joints of a shaped body in the zero pose.
    pub fn joints(&self, shaped: &[Vec3]) -> [Vec3; JOINT_COUNT] {
        std::array::from_fn(|joint| self.joint_regressor[joint].apply(shaped))
    }
}

impl SparseRow {
    /// The weighted sum of these values.
    pub fn apply(&self, values: &[Vec3]) -> Vec3 {
        self.indices
            .iter()
            .zip(&self.weights)
            .map(|(&i, &w)| values[i as usize] * w)
            .sum()
    }
}

impl fmt::Display for BodyIdentity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.iter().try_for_each(|byte| write!(f, "{byte:02x}"))
    }
}

impl fmt::Debug for BodyIdentity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "BodyIdentity({self})")
    }
}
