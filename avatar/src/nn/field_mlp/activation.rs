//! The nonlinearities, each with its first two derivatives.

use effigy_fusion::simd;

use crate::sdf::{OMEGA, sincos};

/// Half the width of the smooth ramp's bend: as wide as a softplus of sharpness 100 (`SCANimate`, IGR) bends.
const BEND: f32 = 0.014;

/// Between two linear layers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Activation {
    /// `max(0, z)`.
    Relu,
    /// `(z + sqrt(z^2 + bend^2)) / 2`: a softplus without its exponential, which takes ten times as long.
    SmoothRamp,
    /// `sin(30 z)`.
    Sine,
}

impl Activation {
    /// Bound of a uniform start of a weight: He et al. 2015 for what is a ramp, Sitzmann et al. 2020 for sines.
    pub(super) fn weight_bound(self, inputs: f32, is_first: bool) -> f32 {
        match self {
            Self::Relu | Self::SmoothRamp => (6.0 / inputs).sqrt(),
            Self::Sine if is_first => 1.0 / inputs,
            Self::Sine => (6.0 / inputs).sqrt() / OMEGA,
        }
    }

    /// `h` holds `W x`, row by row; becomes the activation of that plus the bias, with its derivatives in `first` and
    /// `second`.
    pub(super) fn apply(self, bias: &[f32], h: &mut [f32], first: &mut [f32], second: &mut [f32]) {
        let width = bias.len();
        let rows = h
            .chunks_exact_mut(width)
            .zip(first.chunks_exact_mut(width))
            .zip(second.chunks_exact_mut(width));
        simd::run(
            #[inline(always)]
            || {
                for ((h, first), second) in rows {
                    let derivatives = first.iter_mut().zip(second);
                    for ((h, b), (first, second)) in h.iter_mut().zip(bias).zip(derivatives) {
                        (*h, *first, *second) = self.at(*h + b);
                    }
                }
            },
        );
    }

    #[expect(
        clippy::inline_always,
        reason = "it must be compiled inside each vector unit's loop"
    )]
    #[inline(always)]
    pub(super) fn at(self, z: f32) -> (f32, f32, f32) {
        match self {
            Self::Relu => {
                let on = if z > 0.0 { 1.0 } else { 0.0 };
                (z * on, on, 0.0)
            }
            Self::SmoothRamp => {
                let root = z.mul_add(z, BEND * BEND).sqrt();
                let second = 0.5 * BEND * BEND / (root * root * root);
                (0.5 * (z + root), 0.5 + 0.5 * z / root, second)
            }
            Self::Sine => {
                let (sine, cosine) = sincos(OMEGA * z);
                (sine, OMEGA * cosine, -OMEGA * OMEGA * sine)
            }
        }
    }
}
