//! Both stages, one after the other, with checkpoints.

use std::{ops::ControlFlow, path::Path};

use serde::{Deserialize, Serialize};

use super::{
    checkpoint::{self, State},
    config::PriorConfig,
    joint::Joint,
    reptile::Reptile,
    task::PersonSource,
};
use crate::{error::AvatarError, hyper::HyperNetwork, nn::Threads};

/// Which part of the training is under way.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Stage {
    Reptile,
    Joint,
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

/// Trains the prior. With a `checkpoint` path the state is written there now and then, and a run that finds
/// one there goes on from it to the same result as if it had not been interrupted. `None` if `on_progress`
/// stopped it (the checkpoint is then up to date).
pub fn train_prior(
    source: &dyn PersonSource,
    config: &PriorConfig,
    checkpoint: Option<&Path>,
    on_progress: &mut (dyn FnMut(&PriorProgress) -> ControlFlow<()> + Send),
) -> Result<Option<HyperNetwork>, AvatarError> {
    let threads = Threads::new(&config.threads, || {})?;
    threads.run(|| {
        let state = match checkpoint {
            Some(path) if path.exists() => checkpoint::read(path, config, source)?,
            _ => State::Reptile { step: 0, reptile: Box::new(Reptile::new(config)) },
        };
        Training { source, config, checkpoint, on_progress }.run(state)
    })
}

struct Training<'a> {
    source: &'a dyn PersonSource,
    config: &'a PriorConfig,
    checkpoint: Option<&'a Path>,
    on_progress: &'a mut (dyn FnMut(&PriorProgress) -> ControlFlow<()> + Send),
}

impl Training<'_> {
    fn run(mut self, state: State) -> Result<Option<HyperNetwork>, AvatarError> {
        let (mut step, mut joint) = match state {
            State::Reptile { step, reptile } => {
                let Some(phi) = self.reptile(step, reptile)? else {
                    return Ok(None);
                };
                (0, Box::new(Joint::new(phi, self.config, self.source)))
            }
            State::Joint { step, joint } => (step, joint),
        };
        let steps = self.config.joint.steps;
        while step < steps {
            let loss = joint.step(step, self.config)?;
            step += 1;
            let stop = self.report(Stage::Joint, step, steps, loss);
            if stop || step.is_multiple_of(self.config.checkpoint_every.max(1)) {
                self.save(|config| checkpoint::joint_bytes(step, &joint, config))?;
            }
            if stop {
                return Ok(None);
            }
        }
        Ok(Some(joint.finish()))
    }

    fn reptile(
        &mut self,
        mut step: u32,
        mut reptile: Box<Reptile>,
    ) -> Result<Option<Vec<f32>>, AvatarError> {
        let steps = self.config.reptile.warm_up_steps + self.config.reptile.outer_steps;
        while step < steps {
            let loss = reptile.step(step, self.config, self.source)?;
            step += 1;
            let stop = self.report(Stage::Reptile, step, steps, loss);
            if stop || step.is_multiple_of(self.config.checkpoint_every.max(1)) {
                self.save(|config| checkpoint::reptile_bytes(step, &reptile, config))?;
            }
            if stop {
                return Ok(None);
            }
        }
        Ok(Some(reptile.parameters))
    }

    fn report(&mut self, stage: Stage, step: u32, steps: u32, loss: f64) -> bool {
        (self.on_progress)(&PriorProgress { stage, step, steps, loss }).is_break()
    }

    fn save(
        &self,
        bytes: impl FnOnce(&PriorConfig) -> Result<Vec<u8>, AvatarError>,
    ) -> Result<(), AvatarError> {
        match self.checkpoint {
            Some(path) => checkpoint::write(path, &bytes(self.config)?),
            None => Ok(()),
        }
    }
}
