//! Settings of fine-tuning.

use serde::{Deserialize, Serialize};

pub use super::sampling::SamplingConfig;
use crate::{hyper::RateConfig, nn::ThreadsConfig, sdf::loss::LossConfig};

/// How a person is learned.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct FineTuneConfig {
    pub seed: u64,
    /// Adam steps.
    pub steps: u32,
    /// The first so many of them look for who it is among the people that the prior knows, by `code_rates`: what is
    /// found there comes with what poses do to such clothes.
    pub code_steps: u32,
    pub code_rates: RateConfig,
    /// From then on a point this far from the surface of whoever was found counts half, a farther one less, metres: no
    /// clothes are there, the keyframe's pose is wrong. 0 for no doubts.
    pub doubt_m: f32,
    /// Keyframes that a step learns from, drawn anew each time; 0 for all of them. With a few it is all: only where
    /// hundreds are learned from would each step take too long.
    pub frames_per_step: usize,
    /// Steps over which the rates rise from zero: the moments are still empty.
    pub warm_up_steps: u32,
    /// The share of the steps at the end over which the rates fall to zero; the absolute values in the
    /// loss keep a constant rate from settling.
    pub decay_share: f32,
    /// The share of each keyframe's points that is held out to measure the residual.
    pub held_out_share: f32,
    /// Steps between two measurements of the held-out residual.
    pub held_out_every: u32,
    /// What is drawn from a keyframe in a step.
    pub sampling: SamplingConfig,
    pub rates: RateConfig,
    pub loss: LossConfig,
    /// Whether the loss has its term of normals. Those of a depth map err where the surface bends, and eight frames of points
    /// say more without them (docs/evaluation.md); but a network that knows nobody is told by them alone what is inside.
    pub learns_normals: bool,
    pub threads: ThreadsConfig,
}

impl Default for FineTuneConfig {
    fn default() -> Self {
        Self {
            seed: 1,
            steps: 150,
            code_steps: 75,
            code_rates: RateConfig::of_code(),
            doubt_m: 0.02,
            frames_per_step: 0,
            warm_up_steps: 10,
            decay_share: 0.5,
            held_out_share: 0.1,
            held_out_every: 50,
            sampling: SamplingConfig::default(),
            rates: RateConfig::default(),
            loss: LossConfig::default(),
            learns_normals: false,
            threads: ThreadsConfig { count: 0 },
        }
    }
}

impl FineTuneConfig {
    /// For a network that knows nobody, or does not know them apart: there is no code to look for, and all that no pose
    /// changes has to be learned.
    pub fn without_code(self) -> Self {
        let rates = RateConfig {
            static_share: 1.0,
            code_share: self.rates.coefficient_share,
            ..self.rates
        };
        Self { code_steps: 0, rates, ..self }
    }

    /// What a step minimises.
    pub(crate) fn loss_of_step(&self) -> LossConfig {
        if self.learns_normals {
            self.loss
        } else {
            LossConfig { normal: 0.0, ..self.loss }
        }
    }

    /// The share of the rates at a step, counted from zero.
    pub(crate) fn rate_share(&self, step: u32) -> f32 {
        let code_steps = self.code_steps.min(self.steps);
        let (step, steps) = if step < code_steps {
            (step, code_steps)
        } else {
            (step - code_steps, self.steps - code_steps)
        };
        let warm = (step + 1) as f32 / self.warm_up_steps.max(1) as f32;
        let left = steps.saturating_sub(step) as f32 / steps.max(1) as f32;
        let decay = if self.decay_share > 0.0 {
            left / self.decay_share
        } else {
            1.0
        };
        warm.min(1.0) * decay.min(1.0)
    }
}
