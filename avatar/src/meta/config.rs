//! Settings of the prior's training.

use serde::{Deserialize, Serialize};

use crate::{
    fine_tune::SamplingConfig,
    hyper::{HyperConfig, PRIOR_CONFIG, RateConfig},
    nn::ThreadsConfig,
    sdf::loss::LossConfig,
};

/// The whole training.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PriorConfig {
    pub seed: u64,
    pub network: HyperConfig,
    pub loss: LossConfig,
    /// Drawn from one frame in one step.
    pub sampling: SamplingConfig,
    pub reptile: ReptileConfig,
    pub joint: JointConfig,
    pub adapt: AdaptConfig,
    pub threads: ThreadsConfig,
    /// Steps between two checkpoints.
    pub checkpoint_every: u32,
    /// Share of a stage's steps between two validations.
    pub validate_share: f32,
    /// A stage ends early when so many validations in a row were not better than the best.
    pub patience: u32,
}

impl Default for PriorConfig {
    fn default() -> Self {
        Self {
            seed: 1,
            network: PRIOR_CONFIG,
            loss: LossConfig::default(),
            sampling: SamplingConfig {
                surface: 512,
                near: 256,
                near_deviation: 0.03,
                free: 0,
                free_at_least: 0.0,
                uniform: 256,
            },
            reptile: ReptileConfig::default(),
            joint: JointConfig::default(),
            adapt: AdaptConfig::default(),
            threads: ThreadsConfig::default(),
            checkpoint_every: 500,
            validate_share: 0.1,
            patience: 4,
        }
    }
}

/// The field alone.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ReptileConfig {
    /// Plain steps over random people at the start: they find a body before Reptile refines the start.
    pub warm_up_steps: u32,
    /// Rate of the plain steps.
    pub warm_up_rate: f32,
    pub outer_steps: u32,
    /// People of one outer step.
    pub people: usize,
    /// Adam steps on each, from fresh moments (MetaAvatar).
    pub inner_steps: u32,
    pub inner_rate: f32,
    /// The share of the way to the adapted fields that an outer step goes; falls linearly to a tenth.
    pub outer_share: f32,
}

impl Default for ReptileConfig {
    fn default() -> Self {
        Self {
            warm_up_steps: 1500,
            warm_up_rate: 5e-4,
            outer_steps: 60,
            people: 4,
            inner_steps: 24,
            inner_rate: 2e-4,
            outer_share: 0.5,
        }
    }
}

/// The hypernetwork, over all people together.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct JointConfig {
    /// People that are learned together; 0 is for whoever asks for the training to replace by all that there are.
    pub people: usize,
    /// Poses of each.
    pub frames: usize,
    pub steps: u32,
    /// People of one step, and poses of each.
    pub people_per_step: usize,
    pub frames_per_person: usize,
    /// Rates of a person's code: of its coefficients, and of what the heads see of it.
    pub code_rate: f32,
    pub person_rate: f32,
    /// Weight of the code's mean square in the loss: keeps people near each other, so that a new one is near.
    pub code_penalty: f32,
    pub rates: RateConfig,
    /// Share of the steps at the end over which the rates fall to zero.
    pub decay_share: f32,
}

impl Default for JointConfig {
    fn default() -> Self {
        Self {
            people: 0,
            frames: 56,
            steps: 24_000,
            people_per_step: 4,
            frames_per_person: 2,
            code_rate: 5e-3,
            person_rate: 2e-2,
            code_penalty: 1e-3,
            rates: RateConfig {
                field: 3e-4,
                static_share: 0.3,
                trunk: 5e-5,
                // Everybody has a person of their own.
                person: 0.0,
                ..RateConfig::everything()
            },
            decay_share: 0.5,
        }
    }
}

/// The hypernetwork again: to be a good start for fine-tuning.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct AdaptConfig {
    pub outer_steps: u32,
    pub outer: OuterStep,
    /// People of one outer step, one after the other.
    pub people: usize,
    /// Frames of each to adapt to, seen from one side each, and as many others to be judged on.
    pub frames: usize,
    /// Fine-tuning steps on each.
    pub inner_steps: u32,
    pub inner_rates: RateConfig,
    /// Inner rates fall to zero over this share of the inner steps.
    pub inner_decay_share: f32,
}

impl Default for AdaptConfig {
    fn default() -> Self {
        Self {
            outer_steps: 0,
            outer: OuterStep::FirstOrder { rate: 1e-4 },
            people: 1,
            frames: 8,
            inner_steps: 24,
            inner_rates: RateConfig { field: 4e-4, ..RateConfig::everything() },
            inner_decay_share: 0.5,
        }
    }
}

/// What an outer step learns from having adapted.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum OuterStep {
    /// Goes this share of the way to the adapted network (Reptile, algorithm B.2 of the seed paper).
    Reptile { share: f32 },
    /// An Adam step that moves the field by `rate`, along the gradient which the adapted network has on whole
    /// surfaces in other poses (first-order MAML, Finn et al. 2017).
    FirstOrder { rate: f32 },
}
