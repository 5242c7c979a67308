//! Adam (Kingma & Ba 2015), with a weight's gradient formed as an outer product inside the update.

use effigy_fusion::simd;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::linear::{Linear, OuterGradient, sum_of_rows};

/// Decay rates and epsilon; MetaAvatar keeps the defaults in every stage.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct AdamConfig {
    pub beta1: f32,
    pub beta2: f32,
    pub epsilon: f32,
}

impl Default for AdamConfig {
    fn default() -> Self {
        Self { beta1: 0.9, beta2: 0.999, epsilon: 1e-8 }
    }
}

/// The constants of one step: bias corrections follow from its number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AdamStep {
    config: AdamConfig,
    mean_correction: f32,
    square_correction: f32,
}

impl AdamStep {
    /// Step `number` counts from one.
    pub fn new(config: AdamConfig, number: u32) -> Self {
        let correction = |beta: f32| {
            let remaining = 1.0 - f64::from(beta).powi(number.cast_signed());
            (1.0 / remaining) as f32
        };
        Self {
            config,
            mean_correction: correction(config.beta1),
            square_correction: correction(config.beta2),
        }
    }

    #[expect(
        clippy::inline_always,
        reason = "it must be compiled inside each vector unit's loop"
    )]
    #[inline(always)]
    fn update(&self, rate: f32, gradient: f32, value: &mut f32, mean: &mut f32, square: &mut f32) {
        let AdamConfig { beta1, beta2, epsilon } = self.config;
        *mean = beta1.mul_add(*mean, (1.0 - beta1) * gradient);
        *square = beta2.mul_add(*square, (1.0 - beta2) * gradient * gradient);
        let deviation = (*square * self.square_correction).sqrt() + epsilon;
        *value -= rate * (*mean * self.mean_correction) / deviation;
    }
}

/// First and second moments of a vector of parameters.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Moments {
    pub(crate) mean: Vec<f32>,
    pub(crate) square: Vec<f32>,
}

impl Moments {
    pub(crate) fn zeros(count: usize) -> Self {
        Self { mean: vec![0.0; count], square: vec![0.0; count] }
    }

    /// One step with the gradient at hand.
    pub(crate) fn step(
        &mut self,
        step: &AdamStep,
        rate: f32,
        gradient: &[f32],
        values: &mut [f32],
    ) {
        self.step_parts(step, (values.len(), [rate, 0.0]), gradient, values);
    }

    /// One step with a rate for the first so many parameters and another for the rest.
    pub(crate) fn step_parts(
        &mut self,
        step: &AdamStep,
        (first, rates): (usize, [f32; 2]),
        gradient: &[f32],
        values: &mut [f32],
    ) {
        let parts = [0..first, first..values.len()];
        for (part, rate) in parts.into_iter().zip(rates) {
            let (values, gradient) = (&mut values[part.clone()], &gradient[part.clone()]);
            let (mean, square) = (&mut self.mean[part.clone()], &mut self.square[part]);
            simd::run(
                #[inline(always)]
                || {
                    let moments = mean.iter_mut().zip(square.iter_mut());
                    for ((value, gradient), (mean, square)) in
                        values.iter_mut().zip(gradient).zip(moments)
                    {
                        step.update(rate, *gradient, value, mean, square);
                    }
                },
            );
        }
    }
}

/// Moments of a linear layer.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct LinearMoments {
    pub(crate) weight: Moments,
    pub(crate) bias: Moments,
}

/// Rates of a linear layer's weight and bias.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct LinearRates {
    pub(crate) weight: f32,
    pub(crate) bias: f32,
}

/// Rows of a weight in one parallel piece.
const ROWS_PER_PIECE: usize = 1024;

impl LinearMoments {
    pub(crate) fn new(layer: &Linear) -> Self {
        Self {
            weight: Moments::zeros(layer.weight.len()),
            bias: Moments::zeros(layer.bias.len()),
        }
    }

    /// One step of a layer. Each weight's gradient is summed over the batch when it is needed.
    pub(crate) fn step(
        &mut self,
        step: &AdamStep,
        rates: LinearRates,
        gradient: &OuterGradient,
        layer: &mut Linear,
    ) {
        let (inputs, outputs) = (layer.inputs, layer.outputs);
        let piece = ROWS_PER_PIECE * inputs;
        layer
            .weight
            .par_chunks_mut(piece)
            .zip(self.weight.mean.par_chunks_mut(piece))
            .zip(self.weight.square.par_chunks_mut(piece))
            .enumerate()
            .for_each(|(index, ((weight, mean), square))| {
                let rows = Rows { first: index * ROWS_PER_PIECE, inputs, outputs, gradient };
                step_rows(step, rates.weight, &rows, weight, (mean, square));
            });
        let bias_gradient = sum_of_rows(&gradient.output_bar, outputs);
        self.bias
            .step(step, rates.bias, &bias_gradient, &mut layer.bias);
    }
}

/// Some rows of a weight, and the factors of its gradient.
struct Rows<'a> {
    first: usize,
    inputs: usize,
    outputs: usize,
    gradient: &'a OuterGradient,
}

fn step_rows(
    step: &AdamStep,
    rate: f32,
    rows: &Rows<'_>,
    weight: &mut [f32],
    (mean, square): (&mut [f32], &mut [f32]),
) {
    let &Rows { first, inputs, outputs, gradient } = rows;
    let mut row_gradient = vec![0.0_f32; inputs];
    simd::run(
        #[inline(always)]
        || {
            let moments = mean
                .chunks_exact_mut(inputs)
                .zip(square.chunks_exact_mut(inputs));
            let rows = weight.chunks_exact_mut(inputs).zip(moments).enumerate();
            for (row, (weight, (mean, square))) in rows {
                row_gradient.fill(0.0);
                let batch = gradient.input.chunks_exact(inputs);
                for (input, bars) in batch.zip(gradient.output_bar.chunks_exact(outputs)) {
                    let bar = bars[first + row];
                    for (sum, x) in row_gradient.iter_mut().zip(input) {
                        *sum = bar.mul_add(*x, *sum);
                    }
                }
                let elements = weight
                    .iter_mut()
                    .zip(&row_gradient)
                    .zip(mean.iter_mut().zip(square));
                for ((weight, gradient), (mean, square)) in elements {
                    step.update(rate, *gradient, weight, mean, square);
                }
            }
        },
    );
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn first_step_moves_every_parameter_by_the_rate_against_its_gradient() {
        // With bias correction, mean / sqrt(square) of a single gradient is its sign.
        let mut values = vec![1.0_f32, 2.0, 3.0];
        let mut moments = Moments::zeros(3);
        let step = AdamStep::new(AdamConfig::default(), 1);
        moments.step(&step, 0.01, &[5.0, -1e-3, 0.0], &mut values);
        let expected = [0.99, 2.01, 3.0];
        // The epsilon of 1e-8 beside a gradient of 1e-3, and f32 rounding at 2.
        assert!(
            values
                .iter()
                .zip(expected)
                .all(|(a, b)| (a - b).abs() < 1e-6),
            "{values:?}"
        );
    }

    #[test]
    fn outer_product_gradients_step_as_written_out_ones_do() {
        let (inputs, outputs, rows) = (5, 2 * ROWS_PER_PIECE + 3, 3);
        let wave = |count: usize, phase: f32| -> Vec<f32> {
            (0..count)
                .map(|i| (i as f32 * 0.37 + phase).sin())
                .collect()
        };
        let mut layer = Linear::zeros(inputs, outputs);
        layer.weight = wave(inputs * outputs, 0.3);
        let gradient = OuterGradient {
            input: wave(rows * inputs, 0.1),
            output_bar: wave(rows * outputs, 0.2),
        };
        let (weight_gradient, bias_gradient) = gradient.written_out(&layer);
        let (mut weight, mut bias) = (layer.weight.clone(), layer.bias.clone());
        let (mut plain, mut moments) = (LinearMoments::new(&layer), LinearMoments::new(&layer));
        let rates = LinearRates { weight: 1e-2, bias: 1e-3 };
        for number in 1..=3 {
            let step = AdamStep::new(AdamConfig::default(), number);
            moments.step(&step, rates, &gradient, &mut layer);
            plain
                .weight
                .step(&step, rates.weight, &weight_gradient, &mut weight);
            plain
                .bias
                .step(&step, rates.bias, &bias_gradient, &mut bias);
        }
        // The sums over three rows may be fused; a near-zero gradient's direction can then differ a little.
        let close = |a: &[f32], b: &[f32]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-4);
        assert!(close(&layer.weight, &weight) && close(&layer.bias, &bias));
    }
}
