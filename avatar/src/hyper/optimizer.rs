//! Adam over a whole hypernetwork, with rates derived from how far a step may move the field.

use serde::{Deserialize, Serialize};

use super::{
    heads::{Head, HeadGradient},
    network::{HyperGradient, HyperNetwork},
    pose_encoder::EncoderGradient,
};
use crate::nn::{
    AdamConfig, AdamStep,
    adam::{LinearMoments, LinearRates, Moments},
    layer_norm::LayerNorm,
    linear::sum_of_rows,
};

/// Mean hidden activation after `LayerNorm` and `ReLU`: 1 / sqrt(2 pi).
const MEAN_ACTIVATION: f32 = 0.4;
/// A coefficient's least assumed size, for a basis whose coefficients are still zero.
const LEAST_COEFFICIENT: f32 = 0.3;

/// How fast each part learns.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RateConfig {
    /// How far one step may move a parameter of the field: an Adam step of `rate` on every weight of a row
    /// moves its output by `rate * sum |input|`, so weights get this rate over that sum, and biases all of it.
    pub field: f32,
    /// The part of that which the static residual (the output layer's bias) gets.
    pub static_share: f32,
    /// The part of it which comes through the basis.
    pub basis_share: f32,
    /// The part of it which comes through the coefficients, as far as poses decide on them...
    pub coefficient_share: f32,
    /// ...and as far as they do not: through their biases, where a person's code is.
    pub code_share: f32,
    /// Of the heads' hidden layers, and their norms.
    pub trunk: f32,
    /// Of the pose encoder (MetaAvatar).
    pub encoder: f32,
    /// Of the numbers that say who it is.
    pub person: f32,
}

/// With so many poses every part learns at the same pace.
const MANY_POSES: f32 = 128.0;
/// What no pose changes learns at this share of the pace at least.
const LEAST_STATIC_SHARE: f32 = 0.3;
/// What somebody is learned from live.
const FEW_POSES: usize = 8;

impl RateConfig {
    /// Every part learns at the same pace: for many people in many poses.
    pub fn everything() -> Self {
        Self {
            field: 2e-4,
            static_share: 1.0,
            basis_share: 1.0,
            coefficient_share: 1.0,
            code_share: 1.0,
            trunk: 1e-5,
            encoder: 1e-4,
            person: 1e-2,
        }
    }

    /// For one person in so many poses: the fewer there are, the less they say about what poses do, which is then left as
    /// the prior has it. With eight one-sided views everything at the same pace was worse than a surface for all poses.
    pub fn of_poses(poses: usize) -> Self {
        let everything = Self::everything();
        let share = (poses as f32 / MANY_POSES).min(1.0);
        // What no pose changes would take up what poses do in these few views as well.
        let static_share = share.max(LEAST_STATIC_SHARE);
        Self {
            static_share,
            basis_share: share,
            coefficient_share: share,
            code_share: static_share,
            trunk: share * everything.trunk,
            encoder: share * everything.encoder,
            ..everything
        }
    }

    /// Nothing but who it is.
    pub fn of_code() -> Self {
        Self {
            field: 1e-3,
            static_share: 0.0,
            basis_share: 0.0,
            coefficient_share: 0.0,
            code_share: 1.0,
            trunk: 0.0,
            encoder: 0.0,
            person: 2e-2,
        }
    }
}

/// For eight poses.
impl Default for RateConfig {
    fn default() -> Self {
        Self::of_poses(FEW_POSES)
    }
}

/// Rates of one head's last layers.
#[derive(Clone, Copy, Debug, PartialEq)]
struct HeadRates {
    coefficients: LinearRates,
    output: LinearRates,
}

impl HeadRates {
    fn derive(head: &Head, inputs: &[f32], config: &RateConfig) -> Self {
        let width = head.output.inputs as f32;
        let mean = inputs.iter().map(|x| x.abs()).sum::<f32>() / inputs.len().max(1) as f32;
        let activation = if head.coefficients.is_some() {
            mean.max(LEAST_COEFFICIENT)
        } else {
            MEAN_ACTIVATION
        };
        let output = LinearRates {
            weight: config.field * config.basis_share / (width * activation),
            bias: config.field * config.static_share,
        };
        let weights = &head.output.weight;
        let row = weights.iter().map(|x| x.abs()).sum::<f32>() / head.output.outputs as f32;
        let coefficient = config.field / row.max(1e-6);
        let hidden = head.second_norm.scale.len() as f32;
        let coefficients = LinearRates {
            weight: coefficient * config.coefficient_share / (hidden * MEAN_ACTIVATION),
            bias: coefficient * config.code_share,
        };
        Self { coefficients, output }
    }
}

/// Moments of every trainable parameter, and the number of steps taken.
#[derive(Clone, Debug)]
pub(crate) struct HyperOptimizer {
    adam: AdamConfig,
    rates: RateConfig,
    number: u32,
    head_rates: Vec<HeadRates>,
    encoder: Vec<LinearMoments>,
    person: Moments,
    heads: Vec<HeadMoments>,
}

#[derive(Clone, Debug)]
struct HeadMoments {
    first: LinearMoments,
    second: LinearMoments,
    norms: [NormMoments; 2],
    coefficients: Option<LinearMoments>,
    output: LinearMoments,
}

#[derive(Clone, Debug)]
struct NormMoments {
    scale: Moments,
    shift: Moments,
}

impl HyperOptimizer {
    /// Fresh moments; `inputs` are the output layers' inputs for typical poses, which the rates follow.
    pub(crate) fn new(network: &HyperNetwork, inputs: &[Vec<f32>], rates: &RateConfig) -> Self {
        let encoder = std::iter::once(&network.encoder.global)
            .chain(network.encoder.joints.iter().flatten())
            .map(LinearMoments::new)
            .collect();
        let head_rates = network
            .heads
            .iter()
            .zip(inputs)
            .map(|(head, inputs)| HeadRates::derive(head, inputs, rates))
            .collect();
        Self {
            adam: AdamConfig::default(),
            rates: *rates,
            number: 0,
            head_rates,
            encoder,
            person: Moments::zeros(network.person.len()),
            heads: network.heads.iter().map(HeadMoments::new).collect(),
        }
    }

    /// One step; `share` scales every rate (warm-up, decay).
    pub(crate) fn step(
        &mut self,
        network: &mut HyperNetwork,
        gradient: &HyperGradient,
        share: f32,
    ) {
        self.number += 1;
        let step = AdamStep::new(self.adam, self.number);
        self.step_encoder(network, &gradient.encoder, &step, share);
        self.step_person(network, &gradient.person, &step, share);
        let parts = network
            .heads
            .iter_mut()
            .zip(&gradient.heads)
            .zip(&self.head_rates);
        for (moments, ((head, gradient), rates)) in self.heads.iter_mut().zip(parts) {
            moments.step(
                head,
                gradient,
                &step,
                scaled(*rates, share),
                self.rates.trunk * share,
            );
        }
    }

    /// Everything a resumed training needs, as one vector: step number, rates, moments.
    pub(crate) fn state(&self) -> Vec<f32> {
        let mut state = vec![self.number as f32];
        for HeadRates { coefficients, output } in &self.head_rates {
            state.extend([
                coefficients.weight,
                coefficients.bias,
                output.weight,
                output.bias,
            ]);
        }
        let mut own = self.clone();
        own.all_moments().for_each(|moments| {
            state.extend(moments.mean.iter().chain(&moments.square));
        });
        state
    }

    /// Takes over a [`Self::state`] of the same shape; false if its length is wrong.
    pub(crate) fn restore(&mut self, state: &[f32]) -> bool {
        let rates = 1 + 4 * self.head_rates.len();
        let moments: usize = self
            .all_moments()
            .map(|moments| 2 * moments.mean.len())
            .sum();
        if state.len() != rates + moments {
            return false;
        }
        self.number = state[0] as u32;
        for (own, four) in self
            .head_rates
            .iter_mut()
            .zip(state[1..rates].chunks_exact(4))
        {
            own.coefficients = LinearRates { weight: four[0], bias: four[1] };
            own.output = LinearRates { weight: four[2], bias: four[3] };
        }
        let mut rest = &state[rates..];
        self.all_moments().for_each(|moments| {
            for vector in [&mut moments.mean, &mut moments.square] {
                let (own, after) = rest.split_at(vector.len());
                vector.copy_from_slice(own);
                rest = after;
            }
        });
        true
    }

    fn all_moments(&mut self) -> impl Iterator<Item = &mut Moments> {
        let encoder = self
            .encoder
            .iter_mut()
            .flat_map(|linear| [&mut linear.weight, &mut linear.bias]);
        let heads = self.heads.iter_mut().flat_map(|head| {
            let [first, second] = &mut head.norms;
            let norms = [
                &mut first.scale,
                &mut first.shift,
                &mut second.scale,
                &mut second.shift,
            ];
            let linear = [&mut head.first, &mut head.second, &mut head.output].into_iter();
            let linear = linear.chain(&mut head.coefficients);
            norms
                .into_iter()
                .chain(linear.flat_map(|l| [&mut l.weight, &mut l.bias]))
        });
        encoder.chain([&mut self.person]).chain(heads)
    }

    /// `rows`: gradients of the batch's poses; [poses, person]
    fn step_person(
        &mut self,
        network: &mut HyperNetwork,
        rows: &[f32],
        step: &AdamStep,
        share: f32,
    ) {
        let gradient = sum_of_rows(rows, network.person.len());
        let rate = self.rates.person * share;
        self.person.step(step, rate, &gradient, &mut network.person);
    }

    fn step_encoder(
        &mut self,
        network: &mut HyperNetwork,
        gradient: &EncoderGradient,
        step: &AdamStep,
        share: f32,
    ) {
        let rate = self.rates.encoder * share;
        let rates = LinearRates { weight: rate, bias: rate };
        let encoder = &mut network.encoder;
        let layers =
            std::iter::once(&mut encoder.global).chain(encoder.joints.iter_mut().flatten());
        let gradients = std::iter::once(&gradient.global).chain(gradient.joints.iter().flatten());
        for ((layer, gradient), moments) in layers.zip(gradients).zip(&mut self.encoder) {
            moments.step(step, rates, gradient, layer);
        }
    }
}

fn scaled(rates: HeadRates, share: f32) -> HeadRates {
    let scale =
        |rates: LinearRates| LinearRates { weight: rates.weight * share, bias: rates.bias * share };
    HeadRates { coefficients: scale(rates.coefficients), output: scale(rates.output) }
}

impl HeadMoments {
    fn new(head: &Head) -> Self {
        let norm = |norm: &LayerNorm| NormMoments {
            scale: Moments::zeros(norm.scale.len()),
            shift: Moments::zeros(norm.shift.len()),
        };
        Self {
            first: LinearMoments::new(&head.first),
            second: LinearMoments::new(&head.second),
            norms: [norm(&head.first_norm), norm(&head.second_norm)],
            coefficients: head.coefficients.as_ref().map(LinearMoments::new),
            output: LinearMoments::new(&head.output),
        }
    }

    fn step(
        &mut self,
        head: &mut Head,
        gradient: &HeadGradient,
        step: &AdamStep,
        rates: HeadRates,
        trunk: f32,
    ) {
        let trunk_rates = LinearRates { weight: trunk, bias: trunk };
        self.first
            .step(step, trunk_rates, &gradient.first, &mut head.first);
        self.second
            .step(step, trunk_rates, &gradient.second, &mut head.second);
        let norms = [&mut head.first_norm, &mut head.second_norm];
        let gradients = [&gradient.first_norm, &gradient.second_norm];
        for ((norm, gradient), moments) in norms.into_iter().zip(gradients).zip(&mut self.norms) {
            moments
                .scale
                .step(step, trunk, &gradient.scale, &mut norm.scale);
            moments
                .shift
                .step(step, trunk, &gradient.shift, &mut norm.shift);
        }
        let parts = (
            &mut head.coefficients,
            &gradient.coefficients,
            &mut self.coefficients,
        );
        if let (Some(layer), Some(gradient), Some(moments)) = parts {
            moments.step(step, rates.coefficients, gradient, layer);
        }
        self.output
            .step(step, rates.output, &gradient.output, &mut head.output);
    }
}
