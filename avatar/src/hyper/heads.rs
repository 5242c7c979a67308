//! One head: the codes of pose and person become the residual of one layer of the field.
//!
//! `144 + person -> 256 -> LayerNorm -> ReLU -> 256 -> LayerNorm -> ReLU`, then all parameters (the paper), or a few
//! coefficients of which all parameters are a linear combination.

use rand::Rng;
use rand_distr::{Distribution as _, Normal};

use super::config::{HEAD_WIDTH, HeadKind, HyperConfig};
use crate::nn::{
    layer_norm::{LayerNorm, NormCache},
    linear::{Linear, OuterGradient},
};

/// Deviation of a low-rank basis at the start: a coefficient of one in all 32 moves a parameter by about
/// 0.006, the size of a hidden weight.
const BASIS_DEVIATION: f32 = 1e-3;

#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Head {
    pub(crate) first: Linear,
    pub(crate) first_norm: LayerNorm,
    pub(crate) second: Linear,
    pub(crate) second_norm: LayerNorm,
    /// Hidden units to coefficients; none in a full head.
    pub(crate) coefficients: Option<Linear>,
    /// To the layer's parameters; its bias is the residual that no pose changes.
    pub(crate) output: Linear,
}

/// What the backward pass needs.
#[derive(Clone, Debug)]
pub(crate) struct HeadCache {
    first: NormCache,
    second: NormCache,
    /// The output layer's input; [rows, rank or 256]
    pub(crate) basis_input: Vec<f32>,
}

/// Gradients, weights as outer products.
#[derive(Clone, Debug)]
pub(crate) struct HeadGradient {
    pub(crate) first: OuterGradient,
    pub(crate) first_norm: LayerNorm,
    pub(crate) second: OuterGradient,
    pub(crate) second_norm: LayerNorm,
    pub(crate) coefficients: Option<OuterGradient>,
    pub(crate) output: OuterGradient,
}

impl Head {
    /// Its residual is zero for every pose.
    pub(crate) fn init(config: &HyperConfig, parameters: usize, rng: &mut impl Rng) -> Self {
        let first = Linear::he(config.head_inputs(), HEAD_WIDTH, rng);
        let second = Linear::he(HEAD_WIDTH, HEAD_WIDTH, rng);
        let (coefficients, output) = match config.heads {
            HeadKind::Full => (None, Linear::zeros(HEAD_WIDTH, parameters)),
            HeadKind::LowRank(rank) => {
                let normal = Normal::new(0.0, BASIS_DEVIATION).expect("a positive deviation");
                let mut basis = Linear::zeros(rank, parameters);
                basis.weight.fill_with(|| normal.sample(rng));
                (Some(Linear::zeros(HEAD_WIDTH, rank)), basis)
            }
        };
        Self {
            first,
            first_norm: LayerNorm::new(HEAD_WIDTH),
            second,
            second_norm: LayerNorm::new(HEAD_WIDTH),
            coefficients,
            output,
        }
    }

    /// All zeros: the frame that a file's tensors are read into.
    pub(crate) fn zeros(config: &HyperConfig, parameters: usize) -> Self {
        let (coefficients, inputs) = match config.heads {
            HeadKind::Full => (None, HEAD_WIDTH),
            HeadKind::LowRank(rank) => (Some(Linear::zeros(HEAD_WIDTH, rank)), rank),
        };
        Self {
            first: Linear::zeros(config.head_inputs(), HEAD_WIDTH),
            first_norm: LayerNorm::zeros(HEAD_WIDTH),
            second: Linear::zeros(HEAD_WIDTH, HEAD_WIDTH),
            second_norm: LayerNorm::zeros(HEAD_WIDTH),
            coefficients,
            output: Linear::zeros(inputs, parameters),
        }
    }

    /// What the basis is mixed with; `None` in a full head.
    ///
    /// # Shapes
    /// `code` [rows, inputs]; result [rows, rank]
    pub(crate) fn coefficients(&self, code: &[f32]) -> Option<Vec<f32>> {
        let [_, second] = self.trunk(code);
        Some(self.coefficients.as_ref()?.forward(&second.output))
    }

    /// Both hidden layers.
    fn trunk(&self, code: &[f32]) -> [NormCache; 2] {
        let first = self.first_norm.forward_relu(&self.first.forward(code));
        let second = self
            .second_norm
            .forward_relu(&self.second.forward(&first.output));
        [first, second]
    }

    /// # Shapes
    /// `code` [rows, inputs]; `offsets` a coefficient vector a row, or none at all; result [rows, parameters]
    pub(crate) fn forward(&self, code: &[f32], offsets: &[&[f32]]) -> (HeadCache, Vec<f32>) {
        let [first, second] = self.trunk(code);
        let basis_input = match &self.coefficients {
            Some(layer) => {
                let mut coefficients = layer.forward(&second.output);
                let rows = coefficients.chunks_exact_mut(layer.outputs).zip(offsets);
                rows.for_each(|(row, offset)| {
                    row.iter_mut()
                        .zip(*offset)
                        .for_each(|(x, offset)| *x += offset);
                });
                coefficients
            }
            None => second.output.clone(),
        };
        let residual = self.output.forward(&basis_input);
        (HeadCache { first, second, basis_input }, residual)
    }

    /// The gradients of the head's parameters, and of the code.
    ///
    /// # Shapes
    /// `code` and the second result [rows, inputs], `residual_bar` [rows, parameters]
    pub(crate) fn backward(
        &self,
        code: &[f32],
        cache: HeadCache,
        residual_bar: Vec<f32>,
    ) -> (HeadGradient, Vec<f32>) {
        let basis_bar = self.output.input_bar(&residual_bar);
        let output = OuterGradient { input: cache.basis_input, output_bar: residual_bar };
        let (coefficients, hidden_bar) = match &self.coefficients {
            Some(layer) => {
                let hidden_bar = layer.input_bar(&basis_bar);
                let input = cache.second.output.clone();
                (
                    Some(OuterGradient { input, output_bar: basis_bar }),
                    hidden_bar,
                )
            }
            None => (None, basis_bar),
        };
        let mut second_norm = LayerNorm::zeros(HEAD_WIDTH);
        let second_bar =
            self.second_norm
                .backward_relu(&cache.second, &hidden_bar, &mut second_norm);
        let first_out_bar = self.second.input_bar(&second_bar);
        let mut first_norm = LayerNorm::zeros(HEAD_WIDTH);
        let first_bar =
            self.first_norm
                .backward_relu(&cache.first, &first_out_bar, &mut first_norm);
        let code_bar = self.first.input_bar(&first_bar);
        let gradient = HeadGradient {
            first: OuterGradient { input: code.to_vec(), output_bar: first_bar },
            first_norm,
            second: OuterGradient { input: cache.first.output, output_bar: second_bar },
            second_norm,
            coefficients,
            output,
        };
        (gradient, code_bar)
    }
}
