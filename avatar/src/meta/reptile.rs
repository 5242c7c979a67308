//! Stage `Field`: Reptile (Nichol et al. 2018) on the field alone.
//!
//! An outer step adapts the field to some people with a few Adam steps each, and moves the start part of the
//! way to the mean of where they ended.

use std::sync::Arc;

use rand::{RngExt as _, SeedableRng as _, rngs::StdRng};
use rayon::prelude::*;

use super::{
    batch::Batch,
    checkpoint::{Vectors, bytes_of, floats},
    config::PriorConfig,
    task::{PersonSource, Prepared},
    train::{Learner, Stage},
};
use crate::{
    error::AvatarError,
    hyper::HyperNetwork,
    nn::{AdamConfig, AdamStep, adam::Moments},
    sdf::SirenField,
};

/// The stage in progress; the whole state is the field, the warm-up's moments and the step number.
pub(super) struct Reptile {
    parameters: Vec<f32>,
    moments: Moments,
    cohort: Option<(u32, Arc<Vec<Prepared>>)>,
    batch: Batch,
}

/// Warm-up steps with the same people.
const COHORT_STEPS: u32 = 25;

impl Reptile {
    pub(super) fn new(config: &PriorConfig) -> Self {
        let mut rng = rng_of(config.seed, 0);
        let field = SirenField::init(config.network.field, &mut rng);
        let parameters = field.parameters().to_vec();
        Self {
            moments: Moments::zeros(parameters.len()),
            parameters,
            cohort: None,
            batch: Batch::new(config.network.field),
        }
    }

    fn warm_up(
        &mut self,
        number: u32,
        config: &PriorConfig,
        source: &dyn PersonSource,
    ) -> Result<f64, AvatarError> {
        let mut rng = rng_of(config.seed, 1 + u64::from(number));
        let cohort = self.cohort(number / COHORT_STEPS, config, source);
        let parameters = self.parameters.clone();
        let frames: Vec<_> = cohort
            .iter()
            .map(|person| (person, parameters.as_slice()))
            .collect();
        let loss = self.loss_gradient(&frames, config, &mut rng, number)?;
        let bars = self.batch.bars();
        let mut gradient = bars[0].to_vec();
        for part in &bars[1..] {
            gradient
                .iter_mut()
                .zip(*part)
                .for_each(|(sum, part)| *sum += part);
        }
        let left = 1.0 - number as f32 / config.reptile.warm_up_steps as f32;
        let rate = config.reptile.warm_up_rate * left.min(0.5) * 2.0;
        let step = AdamStep::new(AdamConfig::default(), number + 1);
        self.moments
            .step(&step, rate, &gradient, &mut self.parameters);
        Ok(loss)
    }

    /// The people that some warm-up steps share: making a surface can take longer than a step.
    fn cohort(
        &mut self,
        epoch: u32,
        config: &PriorConfig,
        source: &dyn PersonSource,
    ) -> Arc<Vec<Prepared>> {
        match &self.cohort {
            Some((of, cohort)) if *of == epoch => Arc::clone(cohort),
            _ => {
                let size = config.reptile.people as u64;
                let person = |i| source.person(person_number(u64::from(epoch) * size + i), 1);
                let cohort: Vec<_> = (0..size)
                    .into_par_iter()
                    .map(|i| Prepared::new(&person(i)))
                    .collect();
                let cohort = Arc::new(cohort);
                self.cohort = Some((epoch, Arc::clone(&cohort)));
                cohort
            }
        }
    }

    fn outer(
        &mut self,
        number: u32,
        config: &PriorConfig,
        source: &dyn PersonSource,
    ) -> Result<f64, AvatarError> {
        let mut rng = rng_of(config.seed, 1 + u64::from(number));
        let reptile = &config.reptile;
        let numbers: Vec<u64> = (0..reptile.people)
            .map(|_| person_number(rng.random()))
            .collect();
        let people: Vec<_> = numbers
            .par_iter()
            .map(|n| Prepared::new(&source.person(*n, 1)))
            .collect();
        let mut adapted = vec![self.parameters.clone(); people.len()];
        let mut moments = vec![Moments::zeros(self.parameters.len()); people.len()];
        let mut loss = 0.0;
        for inner in 0..reptile.inner_steps {
            let frames: Vec<_> = people
                .iter()
                .zip(&adapted)
                .map(|(person, own)| (person, own.as_slice()))
                .collect();
            loss = self.loss_gradient(&frames, config, &mut rng, number)?;
            let step = AdamStep::new(AdamConfig::default(), inner + 1);
            let own = adapted.iter_mut().zip(&mut moments);
            for (bar, (own, moments)) in self.batch.bars().into_iter().zip(own) {
                moments.step(&step, reptile.inner_rate, bar, own);
            }
        }
        let outer = number - reptile.warm_up_steps;
        let left = 1.0 - outer as f32 / reptile.outer_steps as f32;
        let share = reptile.outer_share * left.max(0.1) / people.len() as f32;
        for (index, start) in self.parameters.iter_mut().enumerate() {
            let moved: f32 = adapted.iter().map(|own| own[index] - *start).sum();
            *start += share * moved;
        }
        Ok(loss)
    }

    fn loss_gradient(
        &mut self,
        people: &[(&Prepared, &[f32])],
        config: &PriorConfig,
        rng: &mut StdRng,
        number: u32,
    ) -> Result<f64, AvatarError> {
        let (points, fields): (Vec<_>, Vec<_>) = people
            .iter()
            .map(|(person, parameters)| (&person.points[0], *parameters))
            .unzip();
        self.batch.draw(&points, config, rng);
        self.batch.loss(&fields, config, number)
    }
}

impl Learner for Reptile {
    const STAGE: Stage = Stage::Field;

    fn steps(config: &PriorConfig) -> u32 {
        config.reptile.warm_up_steps + config.reptile.outer_steps
    }

    /// Warm-up or outer.
    fn step(
        &mut self,
        number: u32,
        config: &PriorConfig,
        source: &dyn PersonSource,
    ) -> Result<f64, AvatarError> {
        if number < config.reptile.warm_up_steps {
            self.warm_up(number, config, source)
        } else {
            self.outer(number, config, source)
        }
    }

    fn network(&self, config: &PriorConfig) -> HyperNetwork {
        let field = SirenField::new(config.network.field, self.parameters.clone());
        HyperNetwork::init(config.network, &field, &mut rng_of(config.seed, u64::MAX))
    }

    fn vectors(&self) -> Result<Vectors, AvatarError> {
        let Self { parameters, moments, .. } = self;
        Ok(Vectors::from([
            ("parameters", bytes_of(parameters)),
            ("mean", bytes_of(&moments.mean)),
            ("square", bytes_of(&moments.square)),
        ]))
    }

    fn restore(&mut self, vectors: &Vectors) -> Result<bool, AvatarError> {
        let Moments { mean, square } = &mut self.moments;
        let own = [&mut self.parameters, mean, square];
        for (own, name) in own.into_iter().zip(["parameters", "mean", "square"]) {
            let values = floats(vectors, name);
            if values.len() != own.len() {
                return Ok(false);
            }
            *own = values;
        }
        Ok(true)
    }
}

/// Training people have even numbers; odd ones are for whoever measures the prior.
pub(super) fn person_number(draw: u64) -> u64 {
    (draw % 1_000_000) * 2
}

/// A generator of its own for every step, so that training resumes exactly.
pub(super) fn rng_of(seed: u64, step: u64) -> StdRng {
    StdRng::seed_from_u64(
        seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ step.wrapping_mul(0xd1b5_4a32_d192_ed03),
    )
}
