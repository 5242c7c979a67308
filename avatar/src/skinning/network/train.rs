//! The training of the three networks: from clouds of simulated people to numbers, with checkpoints.

use std::{ops::ControlFlow, path::Path, sync::Arc};

use effigy_registration::{
    BodyModel, BodyParams,
    smpl::{BodyIdentity, JOINT_COUNT},
};
use glam::Vec3;
use rand::{SeedableRng as _, rngs::StdRng};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::{
    SkinningNetwork, SkinningNetworks, beside,
    learn::{Lesson, Outcome, Outcomes},
    loss::SkinningLossConfig,
};
use crate::{
    error::AvatarError,
    nn::{AdamConfig, AdamStep, Threads, ThreadsConfig, adam::Moments},
    skinning::{BoneWeights, ClosestBodyPoint, Warp},
};

mod checkpoint;

/// Settings of the training.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SkinningTrainConfig {
    pub seed: u64,
    pub steps: u32,
    /// Clouds of one step.
    pub clouds: usize,
    /// Points of a cloud.
    pub points: usize,
    pub rate: f32,
    /// Steps over which the rate rises to its full value.
    pub warm_up_steps: u32,
    /// The share of the rate that is left at the end, after half a cosine.
    pub final_share: f32,
    pub loss: SkinningLossConfig,
    /// Steps between two looks at the held-out people; a checkpoint is written at each.
    pub look_every: u32,
    /// Held-out clouds of a look.
    pub held_out_clouds: u64,
    /// Looks without anything better after which the training ends.
    pub patience: u32,
    pub threads: ThreadsConfig,
}

impl Default for SkinningTrainConfig {
    fn default() -> Self {
        Self {
            seed: 1,
            steps: 1200,
            clouds: 2,
            points: 1024,
            rate: 1.5e-3,
            warm_up_steps: 50,
            final_share: 0.02,
            loss: SkinningLossConfig::default(),
            look_every: 100,
            held_out_clouds: 18,
            patience: 8,
            threads: ThreadsConfig::default(),
        }
    }
}

/// Two kinds of cloud, as MetaAvatar's skinning networks are trained with both.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CloudKind {
    /// What one camera sees.
    SingleView,
    /// The whole surface.
    Surface,
}

/// A cloud with its truth; one of everything a point.
#[derive(Clone, Debug)]
pub struct TrainingCloud {
    pub kind: CloudKind,
    /// Which of the source's people.
    pub person: usize,
    /// In posed space, with noise.
    pub points: Vec<Vec3>,
    /// Unit, or zero where unknown.
    pub normals: Vec<Vec3>,
    /// Where the points truly are, without noise.
    pub truth_posed: Vec<Vec3>,
    /// Where the points truly lie in canonical space, and the surface's normals there.
    pub star: Vec<Vec3>,
    pub star_normals: Vec<Vec3>,
    pub weights: Vec<BoneWeights>,
    /// The body as registered, with noise.
    pub registered: BodyParams,
    /// The person's true warp.
    pub warp: Warp,
}

/// Where clouds come from. The same number always gives the same cloud.
pub trait CloudSource: Sync {
    /// The shape of each person.
    fn people(&self) -> Vec<[f32; 10]>;
    /// Of somebody to learn from.
    fn training(&self, number: u64) -> TrainingCloud;
    /// Of somebody held out.
    fn held_out(&self, number: u64) -> TrainingCloud;
}

/// A look at the held-out people: mean distances from where points should be, in metres.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Look {
    pub step: u32,
    /// Mean loss of the steps since the last look: of the inverse, forward and label network.
    pub losses: [f64; 3],
    pub inverse_m: f64,
    pub forward_m: f64,
    pub labels_m: f64,
    /// Inverse skinning by the closest body point.
    pub closest_m: f64,
}

impl Look {
    /// What early stopping watches, a network each.
    fn scores(&self) -> [f64; 3] {
        [self.inverse_m, self.forward_m, self.labels_m]
    }
}

/// Where the training stands.
#[derive(Clone, Copy, Debug)]
pub struct SkinningProgress<'a> {
    pub step: u32,
    pub steps: u32,
    /// Of this step.
    pub losses: [f64; 3],
    pub looks: &'a [Look],
}

/// Trains the networks. With a `checkpoint` path the state is written there at each look, and a run that finds one
/// there goes on from it to the same result as if it had not been interrupted. The second value has all looks.
/// `None` if `on_progress` stopped it (the checkpoint is then up to date).
pub fn train_skinning(
    model: &Arc<BodyModel>,
    source: &dyn CloudSource,
    config: &SkinningTrainConfig,
    checkpoint: Option<&Path>,
    on_progress: &mut (dyn FnMut(&SkinningProgress<'_>) -> ControlFlow<()> + Send),
) -> Result<Option<(SkinningNetworks, Vec<Look>)>, AvatarError> {
    let threads = Threads::new(&config.threads, || {})?;
    threads.run(|| {
        let state = match checkpoint {
            Some(path) if path.exists() => checkpoint::read(path, config)?,
            _ => State::new(config),
        };
        let people = source.people();
        let people = people
            .par_iter()
            .map(|betas| beside(Arc::clone(model), betas))
            .collect();
        let training = Training { source, config, checkpoint, people, body: model.identity };
        training.run(state, on_progress)
    })
}

/// Floating-point operations of a whole training run: forward, and twice that backward.
pub fn training_flops(config: &SkinningTrainConfig) -> f64 {
    let networks = SkinningNetworks::untrained(config.seed);
    let all = [&networks.inverse, &networks.forward, &networks.labels];
    let a_cloud: usize = all
        .iter()
        .map(|network| network.multiply_adds(config.points))
        .sum();
    6.0 * a_cloud as f64 * config.clouds as f64 * f64::from(config.steps)
}

/// Everything that changes from step to step.
struct State {
    step: u32,
    networks: SkinningNetworks,
    moments: [Moments; 3],
    /// The numbers that did best on held-out people.
    best: [Vec<f32>; 3],
    looks: Vec<Look>,
    /// Losses since the last look.
    losses: [f64; 3],
}

impl State {
    fn new(config: &SkinningTrainConfig) -> Self {
        let networks = SkinningNetworks::untrained(config.seed);
        let all = [&networks.inverse, &networks.forward, &networks.labels];
        let moments = all.map(|network| Moments::zeros(network.parameter_count()));
        let best = all.map(|network| network.parameters.clone());
        Self { step: 0, networks, moments, best, looks: Vec::new(), losses: [0.0; 3] }
    }

    fn all_mut(&mut self) -> [(&mut SkinningNetwork, &mut Moments); 3] {
        let SkinningNetworks { inverse, forward, labels, .. } = &mut self.networks;
        let [a, b, c] = &mut self.moments;
        [(inverse, a), (forward, b), (labels, c)]
    }

    /// Looks since the best one, of each network.
    fn looks_since_best(&self) -> [usize; 3] {
        [0, 1, 2].map(|which| {
            let scores = self.looks.iter().map(|look| look.scores()[which]);
            let best = scores
                .enumerate()
                .min_by(|a, b| a.1.total_cmp(&b.1))
                .map_or(0, |(index, _)| index);
            self.looks.len().saturating_sub(best + 1)
        })
    }

    /// Whether some network has got better lately.
    fn improves(&self, patience: u32) -> bool {
        self.looks_since_best()
            .iter()
            .any(|&looks| looks < patience as usize)
    }
}

struct Training<'a> {
    source: &'a dyn CloudSource,
    config: &'a SkinningTrainConfig,
    checkpoint: Option<&'a Path>,
    people: Vec<ClosestBodyPoint>,
    body: BodyIdentity,
}

impl Training<'_> {
    fn run(
        self,
        mut state: State,
        on_progress: &mut (dyn FnMut(&SkinningProgress<'_>) -> ControlFlow<()> + Send),
    ) -> Result<Option<(SkinningNetworks, Vec<Look>)>, AvatarError> {
        let config = self.config;
        while state.step < config.steps && state.improves(config.patience) {
            let losses = self.step(&mut state)?;
            let every = config.look_every.max(1);
            let is_look = state.step.is_multiple_of(every) || state.step == config.steps;
            if is_look {
                self.look(&mut state);
            }
            let progress = SkinningProgress {
                step: state.step,
                steps: config.steps,
                losses,
                looks: &state.looks,
            };
            let stop = on_progress(&progress).is_break();
            if let Some(path) = self.checkpoint
                && (stop || is_look)
            {
                checkpoint::write(path, &state, config)?;
            }
            if stop {
                return Ok(None);
            }
        }
        let best = std::mem::take(&mut state.best);
        for ((network, _), best) in state.all_mut().into_iter().zip(best) {
            network.parameters = best;
        }
        state.networks.provenance.body = Some(self.body);
        Ok(Some((state.networks, state.looks)))
    }

    fn step(&self, state: &mut State) -> Result<[f64; 3], AvatarError> {
        let config = self.config;
        let numbers: Vec<u64> = (0..config.clouds as u64)
            .map(|k| u64::from(state.step) * config.clouds as u64 + k)
            .collect();
        let networks = &state.networks;
        let parts: Vec<(Outcomes, [Vec<f32>; 3])> = numbers
            .par_iter()
            .map(|&number| {
                let cloud = self.source.training(number);
                let mut rng = rng_of(config.seed, number);
                let lesson = Lesson::new(&cloud, &self.people[cloud.person], &mut rng);
                let all = [&networks.inverse, &networks.forward, &networks.labels];
                let mut gradients = all.map(|network| vec![0.0; network.parameter_count()]);
                let outcomes = lesson.learn(networks, &config.loss, &mut gradients);
                (outcomes, gradients)
            })
            .collect();
        let mut losses = [0.0; 3];
        for (outcomes, _) in &parts {
            for (sum, Outcome { loss, .. }) in losses.iter_mut().zip(outcomes) {
                *sum += loss / parts.len() as f64;
            }
        }
        if losses.iter().any(|loss| !loss.is_finite()) {
            return Err(AvatarError::SkinningLossNotFinite { step: state.step, losses });
        }
        state.step += 1;
        let rate = rate(state.step, config);
        let adam = AdamStep::new(AdamConfig::default(), state.step);
        for (which, (network, moments)) in state.all_mut().into_iter().enumerate() {
            let mut sum = vec![0.0; network.parameter_count()];
            for (_, gradients) in &parts {
                let share = 1.0 / parts.len() as f32;
                sum.iter_mut()
                    .zip(&gradients[which])
                    .for_each(|(sum, x)| *sum += share * x);
            }
            moments.step(&adam, rate, &sum, &mut network.parameters);
        }
        for (sum, loss) in state.losses.iter_mut().zip(losses) {
            *sum += loss;
        }
        Ok(losses)
    }

    /// Measures the networks on held-out people and keeps the best numbers.
    fn look(&self, state: &mut State) {
        let config = self.config;
        let misses: Vec<[f64; 4]> = (0..config.held_out_clouds)
            .into_par_iter()
            .map(|number| {
                let cloud = self.source.held_out(number);
                let mut rng = rng_of(config.seed, number);
                let person = &self.people[cloud.person];
                Lesson::new(&cloud, person, &mut rng).misses_m(&state.networks)
            })
            .collect();
        let mean = |which: usize| {
            misses.iter().map(|miss| miss[which]).sum::<f64>() / misses.len().max(1) as f64
        };
        let since = state.looks.last().map_or(0, |look| look.step);
        let steps = f64::from((state.step - since).max(1));
        state.looks.push(Look {
            step: state.step,
            losses: state.losses.map(|sum| sum / steps),
            inverse_m: mean(0),
            forward_m: mean(1),
            labels_m: mean(2),
            closest_m: mean(3),
        });
        state.losses = [0.0; 3];
        let since_best = state.looks_since_best();
        let SkinningNetworks { inverse, forward, labels, .. } = &state.networks;
        for (which, network) in [inverse, forward, labels].into_iter().enumerate() {
            if since_best[which] == 0 {
                state.best[which].clone_from(&network.parameters);
            }
        }
    }
}

fn rate(step: u32, config: &SkinningTrainConfig) -> f32 {
    let warm = step as f32 / config.warm_up_steps.max(1) as f32;
    let done = step as f32 / config.steps.max(1) as f32;
    let cosine = 0.5 + 0.5 * (std::f32::consts::PI * done).cos();
    let share = config.final_share + (1.0 - config.final_share) * cosine;
    config.rate * warm.min(1.0) * share
}

/// Randomness by what it is for.
fn rng_of(seed: u64, number: u64) -> StdRng {
    StdRng::seed_from_u64(
        seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ number.wrapping_mul(0xd1b5_4a32_d192_ed03),
    )
}

const _: () = assert!(JOINT_COUNT == 24, "the networks have 24 outputs");
