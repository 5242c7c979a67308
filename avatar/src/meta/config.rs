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
    pub threads: ThreadsConfig,
    /// Steps between two checkpoints.
    pub checkpoint_every: u32,
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
            threads: ThreadsConfig::default(),
            checkpoint_every: 500,
        }
    }
}

/// Stage 1: the meta-learned field.
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

/// Stage 2: the hypernetwork.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct JointConfig {
    /// People that are learned together.
    pub people: usize,
    /// Poses of each.
    pub frames: usize,
    pub steps: u32,
    /// People of one step, and poses of each.
    pub people_per_step: usize,
    pub frames_per_person: usize,
    /// Rate of a person's code.
    pub code_rate: f32,
    /// Weight of the code's mean square in the loss: keeps people near each other, so that a new one is near.
    pub code_penalty: f32,
    pub rates: RateConfig,
    /// Share of the steps at the end over which the rates fall to zero.
    pub decay_share: f32,
}

impl Default for JointConfig {
    fn default() -> Self {
        Self {
            people: 64,
            frames: 16,
            steps: 6000,
            people_per_step: 4,
            frames_per_person: 2,
            code_rate: 5e-3,
            code_penalty: 1e-3,
            rates: RateConfig {
                field: 3e-4,
                static_share: 0.3,
                trunk: 5e-5,
                ..RateConfig::default()
            },
            decay_share: 0.5,
        }
    }
}
