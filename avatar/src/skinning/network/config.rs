//! Sizes of a skinning network.

use effigy_registration::smpl::JOINT_COUNT;
use serde::{Deserialize, Serialize};

use crate::nn::unet::UNetConfig;

/// A point encoder with plane pooling, a U-Net that the three planes share, and a decoder for each point
/// (Peng et al. 2020).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NetworkConfig {
    /// What is known of a point beside its place.
    pub features: usize,
    /// Width of the encoder's residual blocks; they take twice as much.
    pub hidden: usize,
    pub blocks: usize,
    /// Cells along a side of each plane.
    pub side: usize,
    /// The planes reach this far from the middle, in normalised units; points beyond are at the border.
    pub half_extent: f32,
    /// Channels of each plane.
    pub channels: usize,
    pub unet: UNetConfig,
    /// The decoder's widths, from its first to its last layer but one.
    pub decoder: [usize; 5],
    /// Groups of the decoder's norms; 0 for none.
    pub groups: usize,
    /// Numbers a point: 24, and two more where the network may leave the answer to the body.
    #[serde(default = "one_a_bone")]
    pub outputs: usize,
}

fn one_a_bone() -> usize {
    JOINT_COUNT
}

impl NetworkConfig {
    /// MetaAvatar's: 34.6 million parameters. It is counted here, not trained.
    pub const PAPER: Self = Self {
        features: 0,
        hidden: 256,
        blocks: 5,
        side: 64,
        half_extent: 1.0,
        channels: 32,
        unet: UNetConfig { depth: 5, width: 64 },
        decoder: [1024, 512, 256, 128, 128],
        groups: 32,
        outputs: JOINT_COUNT,
    };

    /// Ours, for clouds beside a tracked body about whose points this many numbers are known: the body says most of
    /// it, so that planes can be narrow.
    pub const fn beside_body(features: usize, outputs: usize) -> Self {
        let unet = UNetConfig { depth: 3, width: 8 };
        Self { features, outputs, unet, channels: 8, ..Self::CLOUD_ONLY }
    }

    /// Ours, for clouds about which nothing is known.
    pub const CLOUD_ONLY: Self = Self {
        features: 0,
        hidden: 32,
        blocks: 3,
        side: 48,
        half_extent: 0.85,
        channels: 16,
        unet: UNetConfig { depth: 3, width: 16 },
        decoder: [96, 96, 64, 64, 64],
        groups: 0,
        outputs: JOINT_COUNT,
    };
}
