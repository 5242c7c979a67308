//! The stages one after the other, with validation, checkpoints and an early end.

use std::{ops::ControlFlow, path::Path};

use glam::Vec3;
use rand::{SeedableRng as _, rngs::StdRng};
use serde::{Deserialize, Serialize};

use super::{
    adapt::Adapt,
    checkpoint::{self, Checkpoint, Vectors},
    config::PriorConfig,
    joint::Joint,
    reptile::Reptile,
    task::PersonSource,
    validation::{Validated, Validation},
};
use crate::{
    error::AvatarError,
    hyper::HyperNetwork,
    nn::Threads,
    sdf::{
        SirenField,
        batch::{FieldFrame, FieldGradients},
        loss::{Known, LossPoint},
    },
};

/// Which part of the training is under way.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Stage {
    /// Reptile on the field alone.
    Field,
    /// The hypernetwork over all people together.
    Joint,
    /// The hypernetwork as a start for fine-tuning.
    Adapt,
}

/// Where the training stands.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PriorProgress {
    pub stage: Stage,
    /// Steps done in this stage, of `steps`.
    pub step: u32,
    pub steps: u32,
    /// Loss of the last step.
    pub loss: f64,
}

/// Something that the caller may want to show.
#[derive(Clone, Copy, Debug)]
pub enum TrainEvent<'a> {
    Step(PriorProgress),
    /// A validation after the given progress.
    Validated(PriorProgress, &'a Validated),
    /// No validation was better for a long time: the stage ends here.
    EndsEarly(PriorProgress),
}

/// What a training needs.
pub struct Training<'a> {
    pub source: &'a dyn PersonSource,
    pub config: &'a PriorConfig,
    pub validation: Option<&'a Validation>,
    /// The state is written there now and then, and a run that finds one there goes on from it to the same
    /// result as if it had not been interrupted.
    pub checkpoint: Option<&'a Path>,
    /// May stop the training.
    pub on_event: &'a mut (dyn FnMut(&TrainEvent<'_>) -> ControlFlow<()> + Send),
}

/// One stage in progress.
pub(super) trait Learner: Sized + Send {
    const STAGE: Stage;

    fn steps(config: &PriorConfig) -> u32;

    /// One step by its number; its loss.
    fn step(
        &mut self,
        number: u32,
        config: &PriorConfig,
        source: &dyn PersonSource,
    ) -> Result<f64, AvatarError>;

    /// Mean distance of taught people's points to what was learned of them, unit lengths; `None` where nobody is known apart.
    fn taught(&self) -> Option<f64> {
        None
    }

    /// What has been learned so far.
    fn network(&self, config: &PriorConfig) -> HyperNetwork;

    /// The whole state, exact to the last bit.
    fn vectors(&self) -> Result<Vectors, AvatarError>;

    /// Takes over a state; false if it does not fit.
    fn restore(&mut self, vectors: &Vectors) -> Result<bool, AvatarError>;
}

/// Meta-learns the field: a network that gives it for every pose. `None` if `on_event` stopped it (the
/// checkpoint is then up to date).
pub fn train_field(mut training: Training<'_>) -> Result<Option<HyperNetwork>, AvatarError> {
    let threads = Threads::new(&training.config.threads, || {})?;
    threads.run(|| {
        let found = training.found()?;
        training.run(Reptile::new(training.config), found)
    })
}

/// Meta-learns the hypernetwork that starts from a field; both its stages. `None` as [`train_field`].
pub fn train_hyper(
    start: &HyperNetwork,
    mut training: Training<'_>,
) -> Result<Option<HyperNetwork>, AvatarError> {
    let threads = Threads::new(&training.config.threads, || {})?;
    threads.run(|| {
        let found = training.found()?;
        let joined = match &found {
            Some(found) if found.stage == Stage::Adapt => found.network("start")?,
            _ => {
                let Training { source, config, .. } = training;
                let joint = Joint::new(start.meta.clone(), config, source);
                let Some(joined) = training.run(joint, found.clone())? else {
                    return Ok(None);
                };
                joined
            }
        };
        if training.config.adapt.outer_steps == 0 {
            return Ok(Some(joined));
        }
        let found = found.filter(|found| found.stage == Stage::Adapt);
        let adapt = Adapt::new(joined, training.config, training.source);
        training.run(adapt, found)
    })
}

/// Sends one step's points of a few frames through a random field, forwards and backwards; how many frames.
/// What a training costs can be told from the time that this takes.
pub fn time_one_step(config: &PriorConfig) -> usize {
    const FRAMES: usize = 4;
    let field = SirenField::init(config.network.field, &mut StdRng::seed_from_u64(0));
    let points = vec![Vec3::splat(0.1); config.sampling.points_per_frame()];
    let known = vec![LossPoint { known: Known::Nothing, weight: 1.0 }; points.len()];
    let frame = FieldFrame { parameters: field.parameters(), points: &points, known: &known };
    FieldGradients::new(config.network.field).compute(&[frame; FRAMES], &config.loss);
    FRAMES
}

/// The best network so far, and how long it has been that.
#[derive(Clone, Debug, Default)]
pub(super) struct Best {
    pub(super) held_out_mm: Option<f64>,
    pub(super) network: Option<HyperNetwork>,
    /// Validations since.
    pub(super) stale: u32,
}

impl Training<'_> {
    fn found(&self) -> Result<Option<Checkpoint>, AvatarError> {
        match self.checkpoint {
            Some(path) if path.exists() => checkpoint::read(path, self.config).map(Some),
            _ => Ok(None),
        }
    }

    fn run<L: Learner>(
        &mut self,
        mut learner: L,
        found: Option<Checkpoint>,
    ) -> Result<Option<HyperNetwork>, AvatarError> {
        let (mut step, mut best) = (0, Best::default());
        if let Some(found) = found {
            if found.stage != L::STAGE || !learner.restore(&found.vectors)? {
                return Err(found.broken("it belongs to another stage or network"));
            }
            (step, best) = (found.step, found.best);
        }
        let steps = L::steps(self.config);
        let every = ((steps as f32 * self.config.validate_share).round() as u32).max(1);
        while step < steps {
            let loss = learner.step(step, self.config, self.source)?;
            step += 1;
            let now = PriorProgress { stage: L::STAGE, step, steps, loss };
            let mut stop = self.tell(&TrainEvent::Step(now));
            if step.is_multiple_of(every) || step == steps {
                stop |= self.validate(&learner, now, &mut best)?;
            }
            let ends_early = best.stale > self.config.patience;
            if stop || ends_early || step.is_multiple_of(self.config.checkpoint_every.max(1)) {
                self.save(&learner, step, &best)?;
            }
            if stop {
                return Ok(None);
            }
            if ends_early {
                self.tell(&TrainEvent::EndsEarly(now));
                break;
            }
        }
        Ok(Some(
            best.network.unwrap_or_else(|| learner.network(self.config)),
        ))
    }

    /// Judges what has been learned; whether the caller wants to stop.
    fn validate<L: Learner>(
        &mut self,
        learner: &L,
        now: PriorProgress,
        best: &mut Best,
    ) -> Result<bool, AvatarError> {
        let Some(validation) = self.validation else {
            return Ok(false);
        };
        let network = learner.network(self.config);
        let validated = validation.of(&network, learner.taught())?;
        let is_better = |best: f64| validated.held_out_mm < best;
        if best.held_out_mm.is_none_or(is_better) {
            let held_out_mm = Some(validated.held_out_mm);
            *best = Best { held_out_mm, network: Some(network), stale: 0 };
        } else {
            best.stale += 1;
        }
        Ok(self.tell(&TrainEvent::Validated(now, &validated)))
    }

    fn tell(&mut self, event: &TrainEvent<'_>) -> bool {
        (self.on_event)(event).is_break()
    }

    fn save<L: Learner>(&self, learner: &L, step: u32, best: &Best) -> Result<(), AvatarError> {
        match self.checkpoint {
            Some(path) => checkpoint::write(path, L::STAGE, step, best, learner, self.config),
            None => Ok(()),
        }
    }
}
