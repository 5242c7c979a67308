//! Which body part a vertex belongs to.

use super::{BodyModel, VertexWeights};

impl BodyModel {
    /// For each vertex the joint with the largest skinning weight; [V].
    pub fn part_labels(&self) -> Vec<u8> {
        self.skinning.iter().map(VertexWeights::main_bone).collect()
    }
}
