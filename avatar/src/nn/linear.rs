//! A linear layer over a batch of a few rows, and the gradient of its weight as an outer product.

use rand::{Rng, RngExt as _};
use rand_distr::{Distribution as _, Normal};

use super::matmul::{View, Write, multiply};

/// `y = W x + b`.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Linear {
    pub(crate) inputs: usize,
    pub(crate) outputs: usize,
    /// Row-major; [outputs, inputs]
    pub(crate) weight: Vec<f32>,
    /// [outputs]
    pub(crate) bias: Vec<f32>,
}

impl Linear {
    pub(crate) fn zeros(inputs: usize, outputs: usize) -> Self {
        Self { inputs, outputs, weight: vec![0.0; inputs * outputs], bias: vec![0.0; outputs] }
    }

    /// Uniform +-1/sqrt(inputs) for weight and bias: what the papers' framework does by default.
    pub(crate) fn uniform(inputs: usize, outputs: usize, rng: &mut impl Rng) -> Self {
        let bound = 1.0 / (inputs as f32).sqrt();
        let mut layer = Self::zeros(inputs, outputs);
        layer.weight.fill_with(|| rng.random_range(-bound..bound));
        layer.bias.fill_with(|| rng.random_range(-bound..bound));
        layer
    }

    /// Weight normal with variance 2 / inputs (He et al. 2015), bias as [`Self::uniform`].
    pub(crate) fn he(inputs: usize, outputs: usize, rng: &mut impl Rng) -> Self {
        let mut layer = Self::uniform(inputs, outputs, rng);
        let normal = Normal::new(0.0, (2.0 / inputs as f32).sqrt()).expect("a positive deviation");
        layer.weight.fill_with(|| normal.sample(rng));
        layer
    }

    /// # Shapes
    /// `input` [rows, inputs], result [rows, outputs]
    pub(crate) fn forward(&self, input: &[f32]) -> Vec<f32> {
        let rows = input.len() / self.inputs;
        let mut out: Vec<f32> = self
            .bias
            .iter()
            .copied()
            .cycle()
            .take(rows * self.outputs)
            .collect();
        let weight = View::new(&self.weight, self.outputs, self.inputs).transposed();
        multiply(
            &mut out,
            Write::Add,
            View::new(input, rows, self.inputs),
            weight,
        );
        out
    }

    /// The gradient by the input.
    ///
    /// # Shapes
    /// `output_bar` [rows, outputs], result [rows, inputs]
    pub(crate) fn input_bar(&self, output_bar: &[f32]) -> Vec<f32> {
        let rows = output_bar.len() / self.outputs;
        let mut out = vec![0.0; rows * self.inputs];
        let weight = View::new(&self.weight, self.outputs, self.inputs);
        multiply(
            &mut out,
            Write::Replace,
            View::new(output_bar, rows, self.outputs),
            weight,
        );
        out
    }
}

/// The sum of a batch's rows of `width` numbers each; empty for a width of zero.
pub(crate) fn sum_of_rows(rows: &[f32], width: usize) -> Vec<f32> {
    let mut sums = vec![0.0; width];
    for row in rows.chunks_exact(width.max(1)) {
        for (sum, x) in sums.iter_mut().zip(row) {
            *sum += x;
        }
    }
    sums
}

/// What a layer's parameter gradient is made of: `dW = output_bar^T input`, `db = sum of output_bar`.
/// Its rank is the batch's size, so it is never written out; Adam forms each entry when it needs it.
#[derive(Clone, Debug, Default)]
pub(crate) struct OuterGradient {
    /// [rows, inputs]
    pub(crate) input: Vec<f32>,
    /// [rows, outputs]
    pub(crate) output_bar: Vec<f32>,
}

impl OuterGradient {
    /// Weight and bias gradient written out, for tests.
    #[cfg(test)]
    pub(crate) fn written_out(&self, layer: &Linear) -> (Vec<f32>, Vec<f32>) {
        let rows = self.input.len() / layer.inputs;
        let mut weight = vec![0.0; layer.weight.len()];
        let mut bias = vec![0.0; layer.outputs];
        for row in 0..rows {
            for out in 0..layer.outputs {
                let bar = self.output_bar[row * layer.outputs + out];
                bias[out] += bar;
                for k in 0..layer.inputs {
                    weight[out * layer.inputs + k] += bar * self.input[row * layer.inputs + k];
                }
            }
        }
        (weight, bias)
    }
}
