//! The shape of a SIREN and where each layer lies in its flat parameter vector.

use std::ops::Range;

use serde::{Deserialize, Serialize};

/// Factor inside every sine, the first layer's too (MetaAvatar).
pub const OMEGA: f32 = 30.0;

/// Layer sizes of the field's network: 3 -> hidden -> .. -> hidden -> 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SirenConfig {
    /// Width of every hidden layer.
    pub hidden: usize,
    /// Linear layers, the first and the last included; each but the last is followed by a sine.
    pub layers: usize,
}

impl SirenConfig {
    /// What we train and ship.
    pub const LIVE: Self = Self { hidden: 128, layers: 5 };
    /// MetaAvatar's: 330,241 parameters.
    pub const PAPER: Self = Self { hidden: 256, layers: 7 };

    /// Inputs and outputs of a layer.
    pub fn layer_size(self, layer: usize) -> (usize, usize) {
        let inputs = if layer == 0 { 3 } else { self.hidden };
        let outputs = if layer + 1 == self.layers {
            1
        } else {
            self.hidden
        };
        (inputs, outputs)
    }

    /// Weights and biases of a layer.
    pub fn layer_parameters(self, layer: usize) -> usize {
        let (inputs, outputs) = self.layer_size(layer);
        inputs * outputs + outputs
    }

    pub fn parameter_count(self) -> usize {
        (0..self.layers)
            .map(|layer| self.layer_parameters(layer))
            .sum()
    }

    /// Where a layer's parameters lie: the weight, row-major (out x in), then the bias.
    pub fn layer_range(self, layer: usize) -> Range<usize> {
        let start = (0..layer).map(|before| self.layer_parameters(before)).sum();
        start..start + self.layer_parameters(layer)
    }

    /// A layer's weight and bias.
    pub fn split(self, parameters: &[f32], layer: usize) -> (&[f32], &[f32]) {
        let (inputs, outputs) = self.layer_size(layer);
        parameters[self.layer_range(layer)].split_at(inputs * outputs)
    }

    /// A layer's weight and bias.
    pub fn split_mut(self, parameters: &mut [f32], layer: usize) -> (&mut [f32], &mut [f32]) {
        let (inputs, outputs) = self.layer_size(layer);
        parameters[self.layer_range(layer)].split_at_mut(inputs * outputs)
    }

    /// Multiply-adds of one point's training step: value, gradient and the backward pass through both,
    /// six products of the forward pass's size.
    pub fn training_multiply_adds(self) -> usize {
        6 * (0..self.layers)
            .map(|layer| {
                let (inputs, outputs) = self.layer_size(layer);
                inputs * outputs
            })
            .sum::<usize>()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paper_preset_has_the_papers_parameter_count() {
        assert_eq!(SirenConfig::PAPER.parameter_count(), 330_241);
    }

    #[test]
    fn layers_tile_the_parameter_vector() {
        let config = SirenConfig::LIVE;
        let mut end = 0;
        for layer in 0..config.layers {
            assert_eq!(config.layer_range(layer).start, end);
            end = config.layer_range(layer).end;
        }
        assert_eq!(end, config.parameter_count());
    }
}
