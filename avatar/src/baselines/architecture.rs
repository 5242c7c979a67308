//! The networks by name.

use super::pose_code::QUATERNION_NUMBERS;
use crate::nn::field_mlp::{Activation, Encoding, FieldMlpConfig};

/// A network that is told the pose beside the point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Architecture {
    /// `ReLU` units and bare coordinates (the paper's ablation "MLP").
    Mlp,
    /// The same with eight octaves of positional encoding (the paper's "`PosEnc`").
    PositionalEncoding,
    /// Sines, as wide and deep as our field (the paper's "SIREN").
    Siren,
    /// Occupancy instead of distance, in the manner of LEAP (Mihajlovic et al. 2021): `ReLU` units, bare coordinates,
    /// and the whole pose.
    Occupancy,
    /// A distance field in the manner of `SCANimate` (Saito et al. 2021): a smooth ramp for its softplus, four octaves, and only the pose of
    /// joints near the point.
    Scanimate,
}

impl Architecture {
    pub(super) fn config(self) -> FieldMlpConfig {
        let (encoding, hidden, layers, activation) = match self {
            Self::Mlp => (Encoding::Raw, 128, 5, Activation::Relu),
            Self::PositionalEncoding => (Encoding::Octaves(8), 128, 5, Activation::Relu),
            Self::Siren => (Encoding::Raw, 128, 5, Activation::Sine),
            Self::Occupancy => (Encoding::Raw, 128, 6, Activation::Relu),
            Self::Scanimate => (Encoding::Octaves(4), 128, 6, Activation::SmoothRamp),
        };
        FieldMlpConfig { encoding, code: QUATERNION_NUMBERS, hidden, layers, activation }
    }

    pub(super) fn is_occupancy(self) -> bool {
        self == Self::Occupancy
    }
}
