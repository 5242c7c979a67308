//! The shape of a hypernetwork.

use effigy_registration::smpl::JOINT_COUNT;
use serde::{Deserialize, Serialize};

use super::pose_encoder::CODE_SIZE;
use crate::sdf::SirenConfig;

/// Width of the heads' hidden layers (MetaAvatar).
pub(crate) const HEAD_WIDTH: usize = 256;

/// What a head's last hidden layer is turned into.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum HeadKind {
    /// Every parameter of the field's layer from all 256 hidden units (the paper).
    Full,
    /// `rank` coefficients, of which every parameter is a linear combination: `residual = B c + b`.
    LowRank(usize),
}

/// A field and the heads that make it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HyperConfig {
    pub field: SirenConfig,
    pub heads: HeadKind,
    /// Numbers that say who it is, which the heads see beside the pose: what a pose does to clothes depends on the
    /// clothes. MetaAvatar has none.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub person: usize,
}

#[expect(
    clippy::trivially_copy_pass_by_ref,
    reason = "serde passes a reference"
)]
fn is_zero(count: &usize) -> bool {
    *count == 0
}

impl HyperConfig {
    /// What we train and ship.
    pub const LIVE: Self =
        Self { field: SirenConfig::LIVE, heads: HeadKind::LowRank(32), person: 16 };
    /// MetaAvatar's: 85,599,489 parameters in the heads, 13,734 in the encoder.
    pub const PAPER: Self = Self { field: SirenConfig::PAPER, heads: HeadKind::Full, person: 0 };

    /// What a head sees: the pose's code and the person's.
    pub(crate) fn head_inputs(&self) -> usize {
        CODE_SIZE + self.person
    }

    /// Parameters of all heads.
    pub fn head_parameter_count(&self) -> usize {
        let norm = 2 * HEAD_WIDTH;
        let trunk =
            linear(self.head_inputs(), HEAD_WIDTH) + linear(HEAD_WIDTH, HEAD_WIDTH) + 2 * norm;
        (0..self.field.layers)
            .map(|layer| {
                let parameters = self.field.layer_parameters(layer);
                trunk
                    + match self.heads {
                        HeadKind::Full => linear(HEAD_WIDTH, parameters),
                        HeadKind::LowRank(rank) => {
                            linear(HEAD_WIDTH, rank) + linear(rank, parameters)
                        }
                    }
            })
            .sum()
    }

    /// Parameters of the pose encoder, the same for every configuration.
    pub fn encoder_parameter_count() -> usize {
        use super::pose_encoder::{FEATURE_SIZE, GLOBAL_INPUTS, JOINT_INPUTS};
        linear(GLOBAL_INPUTS, FEATURE_SIZE)
            + JOINT_COUNT
                * (linear(JOINT_INPUTS, JOINT_INPUTS) + linear(JOINT_INPUTS, FEATURE_SIZE))
    }
}

const fn linear(inputs: usize, outputs: usize) -> usize {
    inputs * outputs + outputs
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paper_preset_has_the_papers_parameter_counts() {
        assert_eq!(HyperConfig::PAPER.head_parameter_count(), 85_599_489);
        assert_eq!(HyperConfig::encoder_parameter_count(), 13_734);
    }
}
