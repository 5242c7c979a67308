//! A plain multi-layer perceptron as a field: a point and a code in, one value out, with its spatial gradient and the
//! training gradient through both.
//!
//! It is what the SIREN kernel is for one network, for any of the networks that ours is compared with: slower, and
//! short. The code may differ from point to point; its own gradient is not formed, nor does the spatial gradient see
//! it change.

mod activation;
mod gradients;
mod tape;

use std::ops::Range;

use glam::Vec3;
use rand::{Rng, RngExt as _};
use rayon::prelude::*;

pub(crate) use activation::Activation;
pub(crate) use gradients::{MlpFrame, MlpGradients};
use tape::{TILE, Tape};

/// How a point enters the network.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Encoding {
    /// Its coordinates.
    Raw,
    /// Its coordinates, then sine and cosine of each at `pi 2^k` for so many k (Mildenhall et al. 2020).
    Octaves(usize),
}

impl Encoding {
    pub(crate) fn size(self) -> usize {
        match self {
            Self::Raw => 3,
            Self::Octaves(count) => 3 + 6 * count,
        }
    }

    /// Writes the encoded point.
    fn write(self, point: Vec3, out: &mut [f32]) {
        self.each(point, |place, _, value, _| out[place] = value);
    }

    /// The encoding's derivative in a direction.
    fn along(self, point: Vec3, direction: Vec3, out: &mut [f32]) {
        self.each(point, |place, axis, _, slope| {
            out[place] = slope * direction[axis];
        });
    }

    /// The gradient by the point from that by the encoded point.
    fn back(self, point: Vec3, bars: &[f32]) -> Vec3 {
        let mut gradient = Vec3::ZERO;
        self.each(point, |place, axis, _, slope| {
            gradient[axis] += slope * bars[place];
        });
        gradient
    }

    /// Place, axis, value and slope of each number of the encoded point.
    fn each(self, point: Vec3, mut number: impl FnMut(usize, usize, f32, f32)) {
        for axis in 0..3 {
            number(axis, axis, point[axis], 1.0);
        }
        let Self::Octaves(count) = self else {
            return;
        };
        for octave in 0..count {
            let frequency = std::f32::consts::PI * (1_u32 << octave) as f32;
            for axis in 0..3 {
                let (sine, cosine) = (frequency * point[axis]).sin_cos();
                let place = 3 + 6 * octave + 2 * axis;
                number(place, axis, sine, frequency * cosine);
                number(place + 1, axis, cosine, -frequency * sine);
            }
        }
    }
}

/// What a point is told besides where it is.
pub(crate) trait CodeAt: Sync {
    /// Fills `code`.
    fn write(&self, point: Vec3, code: &mut [f32]);
}

/// One code for all points.
impl CodeAt for Vec<f32> {
    fn write(&self, _point: Vec3, code: &mut [f32]) {
        code.copy_from_slice(self);
    }
}

/// The network's shape.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct FieldMlpConfig {
    pub(crate) encoding: Encoding,
    /// Numbers of the code.
    pub(crate) code: usize,
    pub(crate) hidden: usize,
    /// Linear layers, the first and the last included.
    pub(crate) layers: usize,
    pub(crate) activation: Activation,
}

impl FieldMlpConfig {
    pub(crate) fn inputs(self) -> usize {
        self.encoding.size() + self.code
    }

    /// Inputs and outputs of a layer.
    fn layer_size(self, layer: usize) -> (usize, usize) {
        let inputs = if layer == 0 {
            self.inputs()
        } else {
            self.hidden
        };
        let outputs = if layer + 1 == self.layers {
            1
        } else {
            self.hidden
        };
        (inputs, outputs)
    }

    /// Where a layer's weight (outputs x inputs, row-major) lies, and where its bias.
    fn layer_ranges(self, layer: usize) -> (Range<usize>, Range<usize>) {
        let size = |layer| {
            let (inputs, outputs) = self.layer_size(layer);
            (inputs + 1) * outputs
        };
        let start: usize = (0..layer).map(size).sum();
        let (inputs, outputs) = self.layer_size(layer);
        let bias = start + inputs * outputs;
        (start..bias, bias..bias + outputs)
    }

    pub(crate) fn parameter_count(self) -> usize {
        self.layer_ranges(self.layers - 1).1.end
    }
}

#[derive(Clone, Debug, PartialEq)]
pub(crate) struct FieldMlp {
    pub(crate) config: FieldMlpConfig,
    /// Layer by layer: the weight, then the bias.
    pub(crate) parameters: Vec<f32>,
}

impl FieldMlp {
    /// A random start as the activation wants it; biases uniform within one over the square root of the inputs.
    pub(crate) fn init(config: FieldMlpConfig, rng: &mut impl Rng) -> Self {
        let mut parameters = vec![0.0; config.parameter_count()];
        for layer in 0..config.layers {
            let inputs = config.layer_size(layer).0 as f32;
            let (weight, bias) = config.layer_ranges(layer);
            let bound = config.activation.weight_bound(inputs, layer == 0);
            parameters[weight].fill_with(|| rng.random_range(-bound..bound));
            let bound = 1.0 / inputs.sqrt();
            parameters[bias].fill_with(|| rng.random_range(-bound..bound));
        }
        Self { config, parameters }
    }

    fn layer(&self, layer: usize) -> (&[f32], &[f32]) {
        let (weight, bias) = self.config.layer_ranges(layer);
        (&self.parameters[weight], &self.parameters[bias])
    }

    /// One value a point.
    pub(crate) fn values(&self, points: &[Vec3], codes: &dyn CodeAt, out: &mut [f32]) {
        let tiles = points.par_chunks(TILE).zip(out.par_chunks_mut(TILE));
        tiles.for_each_init(
            || Tape::new(self.config),
            |tape, (points, out)| {
                tape.values(self, points, codes);
                out.copy_from_slice(&tape.values[..points.len()]);
            },
        );
    }

    /// Values and spatial gradients.
    pub(crate) fn values_and_gradients(
        &self,
        points: &[Vec3],
        codes: &dyn CodeAt,
        values: &mut [f32],
        gradients: &mut [Vec3],
    ) {
        let tiles = points.par_chunks(TILE).zip(values.par_chunks_mut(TILE));
        tiles.zip(gradients.par_chunks_mut(TILE)).for_each_init(
            || Tape::new(self.config),
            |tape, ((points, values), gradients)| {
                tape.values(self, points, codes);
                tape.gradients(self, points);
                values.copy_from_slice(&tape.values[..points.len()]);
                gradients.copy_from_slice(&tape.gradients[..points.len()]);
            },
        );
    }
}

#[cfg(test)]
mod tests;
