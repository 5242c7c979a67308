//! Stage `Adapt`: the hypernetwork as a start for fine-tuning.
//!
//! An outer step fine-tunes the network on some frames of a person, each seen from one side only, as an avatar
//! is made. Then the start moves: towards where fine-tuning ended (Reptile), or so that what it ended with is
//! better on whole surfaces in other poses (first-order MAML).

use std::f32::consts::TAU;

use glam::Vec3;
use rand::{RngExt as _, rngs::StdRng};

use super::{
    batch::Batch,
    checkpoint::{Vectors, bytes_of, floats},
    config::{AdaptConfig, OuterStep, PriorConfig},
    reptile::{person_number, rng_of},
    task::{Person, PersonFrame, PersonSource, Prepared},
    train::{Learner, Stage},
};
use crate::{
    error::AvatarError,
    fine_tune::sampling::KeyframePoints,
    hyper::{
        HyperNetwork, Precision, RateConfig, network::HyperGradient, optimizer::HyperOptimizer,
    },
};

/// The stage in progress.
pub(super) struct Adapt {
    network: HyperNetwork,
    /// As the stage found it.
    start: HyperNetwork,
    /// Of outer steps by gradient.
    optimizer: HyperOptimizer,
    batch: Batch,
}

impl Adapt {
    pub(super) fn new(
        network: HyperNetwork,
        config: &PriorConfig,
        source: &dyn PersonSource,
    ) -> Self {
        let person = source.person(person_number(500_000), config.adapt.frames);
        let poses: Vec<_> = person.frames.iter().map(|frame| frame.pose).collect();
        let rate = match config.adapt.outer {
            OuterStep::Reptile { .. } => 0.0,
            OuterStep::FirstOrder { rate } => rate,
        };
        let rates = RateConfig { field: rate, ..config.joint.rates };
        let inputs = network.output_inputs(&poses);
        Self {
            optimizer: HyperOptimizer::new(&network, &inputs, &rates),
            batch: Batch::new(config.network.field),
            start: network.clone(),
            network,
        }
    }

    /// The network, fine-tuned on some frames.
    fn adapted(
        &mut self,
        number: u32,
        seen: &Prepared,
        config: &PriorConfig,
        rng: &mut StdRng,
    ) -> Result<HyperNetwork, AvatarError> {
        let AdaptConfig { inner_steps, inner_rates, inner_decay_share, .. } = config.adapt;
        let mut network = self.network.clone();
        let inputs = network.output_inputs(&seen.poses);
        let mut optimizer = HyperOptimizer::new(&network, &inputs, &inner_rates);
        for inner in 0..inner_steps {
            let (_, gradient) = self.gradient(&network, seen, number, config, rng)?;
            let left = (inner_steps - inner) as f32 / inner_steps as f32;
            let share = (left / inner_decay_share.max(1e-6)).min(1.0);
            optimizer.step(&mut network, &gradient, share);
        }
        Ok(network)
    }

    /// Loss and gradient on a fresh draw of some frames' points.
    fn gradient(
        &mut self,
        network: &HyperNetwork,
        frames: &Prepared,
        number: u32,
        config: &PriorConfig,
        rng: &mut StdRng,
    ) -> Result<(f64, HyperGradient), AvatarError> {
        let points: Vec<_> = frames.points.iter().collect();
        self.batch.draw(&points, config, rng);
        let (cache, parameters) = network.forward(&frames.poses);
        let loss = self.batch.loss(&parameters, config, number)?;
        Ok((loss, network.backward(cache, &self.batch.bars())))
    }
}

impl Learner for Adapt {
    const STAGE: Stage = Stage::Adapt;

    fn steps(config: &PriorConfig) -> u32 {
        config.adapt.outer_steps
    }

    /// One outer step by its number; the loss on what was not adapted to.
    fn step(
        &mut self,
        number: u32,
        config: &PriorConfig,
        source: &dyn PersonSource,
    ) -> Result<f64, AvatarError> {
        let mut rng = rng_of(config.seed ^ 0xada9, u64::from(number));
        let adapt = &config.adapt;
        let left = 1.0 - number as f32 / adapt.outer_steps.max(1) as f32;
        let mut loss = 0.0;
        for _ in 0..adapt.people.max(1) {
            let person = source.person(person_number(rng.random()), 2 * adapt.frames);
            let (seen, others) = split(person, &mut rng);
            let adapted = self.adapted(number, &seen, config, &mut rng)?;
            let (judged, gradient) = self.gradient(&adapted, &others, number, config, &mut rng)?;
            loss += judged / adapt.people.max(1) as f64;
            match adapt.outer {
                OuterStep::Reptile { share } => {
                    let share = share * left.max(0.1) / adapt.people.max(1) as f32;
                    move_towards(&mut self.network, adapted, share);
                }
                OuterStep::FirstOrder { .. } => {
                    self.optimizer.step(&mut self.network, &gradient, left);
                }
            }
        }
        Ok(loss)
    }

    fn network(&self, _config: &PriorConfig) -> HyperNetwork {
        self.network.clone()
    }

    fn vectors(&self) -> Result<Vectors, AvatarError> {
        Ok(Vectors::from([
            ("start", self.start.to_bytes(Precision::F32)?),
            ("network", self.network.to_bytes(Precision::F32)?),
            ("optimizer", bytes_of(&self.optimizer.state())),
        ]))
    }

    fn restore(&mut self, vectors: &Vectors) -> Result<bool, AvatarError> {
        let network = vectors.get("network").map_or(&[][..], Vec::as_slice);
        let network = HyperNetwork::from_bytes(network)?;
        if network.config() != self.network.config() || network.meta != self.network.meta {
            return Ok(false);
        }
        self.network = network;
        Ok(self.optimizer.restore(&floats(vectors, "optimizer")))
    }
}

/// Every other frame as seen from one side, an eighth of a turn on from frame to frame; the others whole.
fn split(person: Person, rng: &mut StdRng) -> (Prepared, Prepared) {
    let first_rad = rng.random_range(0.0..TAU);
    let mut seen = Prepared::default();
    let mut others = Prepared::default();
    for (index, frame) in person.frames.into_iter().enumerate() {
        if index % 2 == 0 {
            let heading_rad = first_rad + (index / 2) as f32 * TAU / 8.0;
            seen.poses.push(frame.pose);
            seen.points.push(one_side(&frame, heading_rad));
        } else {
            others.push(&frame);
        }
    }
    (seen, others)
}

/// Roughly what a camera at this heading sees: what faces it in star pose.
fn one_side(frame: &PersonFrame, heading_rad: f32) -> KeyframePoints {
    /// Grazing rays see nothing.
    const LEAST_COSINE: f32 = 0.2;
    let towards_camera = Vec3::new(heading_rad.sin(), 0.0, heading_rad.cos());
    let facing = frame.points_in_unit.iter().zip(&frame.normals);
    let (points, normals): (Vec<Vec3>, Vec<Vec3>) = facing
        .filter(|(_, normal)| normal.dot(towards_camera) > LEAST_COSINE)
        .unzip();
    KeyframePoints::whole(&points, &normals)
}

fn move_towards(start: &mut HyperNetwork, mut end: HyperNetwork, share: f32) {
    for (start, end) in start.values_mut().into_iter().zip(end.values_mut()) {
        for (start, end) in start.iter_mut().zip(end) {
            *start += share * (*end - *start);
        }
    }
}
