//! Which body part a vertex belongs to.

use super::BodyModel;

impl BodyModel {
    /// For each vertex the joint with the largest skinning weight; [V].
    pub fn part_labels(&self) -> Vec<u8> {
        self.skinning
            .iter()
            .map(|row| {
                let largest = (1..4).fold(0, |best, slot| {
                    if row.weights[slot] > row.weights[best] {
                        slot
                    } else {
                        best
                    }
                });
                row.bones[largest]
            })
            .collect()
    }
}
