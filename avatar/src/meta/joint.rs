//! Stage `Joint`: one hypernetwork for many people, each with a code of their own.
//!
//! One part of a person's code is added to the coefficients of every head, so that the shared basis spans both how people
//! differ and how their surfaces follow the pose. The heads see the other part beside the pose: what a pose does depends
//! on who it is and what they wear. Fine-tuning finds a new person's code in the coefficients' bias and the network's
//! person, which start at the mean of all codes.

use rand::{RngExt as _, rngs::StdRng, seq::SliceRandom as _};
use rayon::prelude::*;

use super::{
    batch::Batch,
    checkpoint::{Vectors, bytes_of, floats},
    config::PriorConfig,
    reptile::{person_number, rng_of},
    task::{PersonSource, Prepared},
    train::{Learner, Stage},
};
use crate::{
    error::AvatarError,
    fine_tune::sampling::values_at,
    hyper::{HyperNetwork, Precision, optimizer::HyperOptimizer},
    nn::{AdamConfig, AdamStep, adam::Moments},
    sdf::SirenField,
};

/// The stage in progress.
pub(super) struct Joint {
    network: HyperNetwork,
    optimizer: HyperOptimizer,
    /// One a person: the coefficients of all heads, one after the other, then what the heads see.
    codes: Vec<Vec<f32>>,
    code_moments: Vec<Moments>,
    /// Steps each code has taken.
    code_steps: Vec<u32>,
    people: Vec<Prepared>,
    batch: Batch,
}

impl Joint {
    pub(super) fn new(phi: Vec<f32>, config: &PriorConfig, source: &dyn PersonSource) -> Self {
        let mut rng = rng_of(config.seed, u64::MAX);
        let meta = SirenField::new(config.network.field, phi);
        let network = HyperNetwork::init(config.network, &meta, &mut rng);
        let people: Vec<_> = (0..config.joint.people.max(1) as u64)
            .into_par_iter()
            .map(|index| {
                Prepared::new(&source.person(person_number(500_000 + index), config.joint.frames))
            })
            .collect();
        let inputs = network.output_inputs(&people[0].poses);
        let size = network.code_size();
        Self {
            optimizer: HyperOptimizer::new(&network, &inputs, &config.joint.rates),
            codes: vec![vec![0.0; size]; people.len()],
            code_moments: vec![Moments::zeros(size); people.len()],
            code_steps: vec![0; people.len()],
            batch: Batch::new(config.network.field),
            network,
            people,
        }
    }

    /// Persons and frames of one step.
    fn choose(&self, config: &PriorConfig, rng: &mut StdRng) -> Vec<(usize, usize)> {
        let mut people: Vec<usize> = (0..self.people.len()).collect();
        let (chosen, _) = people.partial_shuffle(rng, config.joint.people_per_step);
        let mut list = Vec::new();
        for &mut person in chosen {
            let frames = self.people[person].poses.len();
            for _ in 0..config.joint.frames_per_person {
                list.push((person, rng.random_range(0..frames)));
            }
        }
        list
    }

    fn restore_codes(&mut self, values: &[f32]) -> bool {
        let size = self.network.code_size();
        let row = 3 * size + 1;
        if values.len() != self.codes.len() * row {
            return false;
        }
        for (person, row) in values.chunks_exact(row).enumerate() {
            self.codes[person].copy_from_slice(&row[..size]);
            let moments = &mut self.code_moments[person];
            moments.mean.copy_from_slice(&row[size..2 * size]);
            moments.square.copy_from_slice(&row[2 * size..3 * size]);
            self.code_steps[person] = row[3 * size] as u32;
        }
        true
    }

    fn step_codes(
        &mut self,
        chosen: &[(usize, usize)],
        bars: &[Vec<f32>],
        config: &PriorConfig,
        share: f32,
    ) {
        let joint = &config.joint;
        let rows = chosen
            .chunks(joint.frames_per_person)
            .zip(bars.chunks(joint.frames_per_person));
        for (frames, bars) in rows {
            let person = frames[0].0;
            let coefficients = self.network.coefficient_count();
            let code = &mut self.codes[person];
            let mut gradient: Vec<f32> = Vec::with_capacity(code.len());
            for part in [&code[..coefficients], &code[coefficients..]] {
                let penalty = 2.0 * joint.code_penalty / part.len().max(1) as f32;
                gradient.extend(part.iter().map(|x| penalty * x));
            }
            for bar in bars {
                gradient
                    .iter_mut()
                    .zip(bar)
                    .for_each(|(sum, bar)| *sum += bar);
            }
            self.code_steps[person] += 1;
            let step = AdamStep::new(AdamConfig::default(), self.code_steps[person]);
            let rates = [joint.code_rate * share, joint.person_rate * share];
            self.code_moments[person].step_parts(&step, (coefficients, rates), &gradient, code);
        }
    }
}

impl Learner for Joint {
    const STAGE: Stage = Stage::Joint;

    fn steps(config: &PriorConfig) -> u32 {
        config.joint.steps
    }

    fn step(
        &mut self,
        number: u32,
        config: &PriorConfig,
        _source: &dyn PersonSource,
    ) -> Result<f64, AvatarError> {
        let mut rng = rng_of(config.seed ^ 0x5eed, u64::from(number));
        let chosen = self.choose(config, &mut rng);
        let (poses, points): (Vec<_>, Vec<_>) = chosen
            .iter()
            .map(|&(person, frame)| {
                let person = &self.people[person];
                (person.poses[frame], &person.points[frame])
            })
            .unzip();
        self.batch.draw(&points, config, &mut rng);
        let codes: Vec<_> = chosen
            .iter()
            .map(|(person, _)| self.codes[*person].as_slice())
            .collect();
        let (cache, parameters) = self.network.forward_with_codes(&poses, &codes);
        let loss = self.batch.loss(&parameters, config, number)?;
        let gradient = self.network.backward(cache, &self.batch.bars());
        let share = rate_share(number, config);
        let code_bars = gradient.code_bars();
        self.optimizer.step(&mut self.network, &gradient, share);
        self.step_codes(&chosen, &code_bars, config, share);
        Ok(loss)
    }

    fn taught(&self) -> Option<f64> {
        const PEOPLE: usize = 16;
        const FRAMES: usize = 3;
        const POINTS: usize = 500;
        // Not every so many in a row: each fourth person may be of another kind.
        let chosen = (0..PEOPLE.min(self.people.len())).map(|k| k * self.people.len() / PEOPLE);
        let (mut sum, mut count) = (0.0, 0);
        for number in chosen {
            let (person, code) = (&self.people[number], &self.codes[number]);
            let frames = person.poses.len().div_ceil(FRAMES).max(1);
            let poses: Vec<_> = person.poses.iter().step_by(frames).copied().collect();
            let codes = vec![code.as_slice(); poses.len()];
            let (_, fields) = self.network.forward_with_codes(&poses, &codes);
            for (frame, parameters) in person.points.iter().step_by(frames).zip(fields) {
                let field = SirenField::new(self.network.config().field, parameters);
                let points = &frame.surface[..frame.surface.len().min(POINTS)];
                let values = values_at(&field, points);
                sum += values
                    .iter()
                    .map(|value| f64::from(value.abs()))
                    .sum::<f64>();
                count += values.len();
            }
        }
        (count > 0).then(|| sum / count as f64)
    }

    /// With the mean code in the coefficients' biases.
    fn network(&self, _config: &PriorConfig) -> HyperNetwork {
        let mut mean = vec![0.0; self.network.code_size()];
        for code in &self.codes {
            mean.iter_mut()
                .zip(code)
                .for_each(|(sum, x)| *sum += x / self.codes.len() as f32);
        }
        let mut network = self.network.clone();
        network.add_code(&mean);
        network
    }

    fn vectors(&self) -> Result<Vectors, AvatarError> {
        let mut codes = Vec::new();
        let moments = self.code_moments.iter().zip(&self.code_steps);
        for (code, (moments, steps)) in self.codes.iter().zip(moments) {
            codes.extend(code.iter().chain(&moments.mean).chain(&moments.square));
            codes.push(*steps as f32);
        }
        Ok(Vectors::from([
            ("network", self.network.to_bytes(Precision::F32)?),
            ("optimizer", bytes_of(&self.optimizer.state())),
            ("codes", bytes_of(&codes)),
        ]))
    }

    fn restore(&mut self, vectors: &Vectors) -> Result<bool, AvatarError> {
        let network = vectors.get("network").map_or(&[][..], Vec::as_slice);
        let network = HyperNetwork::from_bytes(network)?;
        // The field that the stage starts from is the caller's.
        if network.config() != self.network.config() || network.meta != self.network.meta {
            return Ok(false);
        }
        self.network = network;
        Ok(self.optimizer.restore(&floats(vectors, "optimizer"))
            && self.restore_codes(&floats(vectors, "codes")))
    }
}

fn rate_share(number: u32, config: &PriorConfig) -> f32 {
    let joint = &config.joint;
    let warm = (number + 1) as f32 / 50.0;
    let left = joint.steps.saturating_sub(number) as f32 / joint.steps.max(1) as f32;
    warm.min(1.0) * (left / joint.decay_share.max(1e-6)).min(1.0)
}

#[cfg(test)]
mod tests {
    use effigy_registration::smpl::JOINT_COUNT;
    use glam::{Mat3, Vec3};
    use rand::SeedableRng as _;

    use super::*;
    use crate::{
        PoseInput,
        fine_tune::{SamplingConfig, sampling::random_in_box},
        hyper::{HeadKind, HyperConfig, RateConfig},
        meta::{JointConfig, Person, PersonFrame},
        sdf::SirenConfig,
    };

    fn pose(bend_rad: f32) -> PoseInput {
        let mut rotations = [Mat3::IDENTITY; JOINT_COUNT];
        rotations[1] = Mat3::from_rotation_x(bend_rad);
        PoseInput { rotations, joints_in_unit: [Vec3::ZERO; JOINT_COUNT] }
    }

    /// A ball that a bent joint makes larger or smaller, depending on who it is.
    fn ball(number: u64, frames: usize) -> Person {
        let mut rng = StdRng::seed_from_u64(number);
        let gain = if (number / 2).is_multiple_of(2) {
            0.1
        } else {
            -0.1
        };
        let frame = |index: usize| {
            let bend_rad = index as f32 / (frames - 1) as f32;
            let normals: Vec<Vec3> = (0..300)
                .map(|_| random_in_box(&mut rng).normalize_or(Vec3::X))
                .collect();
            let points = normals
                .iter()
                .map(|n| *n * (0.5 + gain * bend_rad))
                .collect();
            PersonFrame { pose: pose(bend_rad), points_in_unit: points, normals }
        };
        Person { frames: (0..frames).map(frame).collect() }
    }

    /// Mean distance of all people's points to what was learned of them.
    fn error(person_numbers: usize) -> f32 {
        let config = PriorConfig {
            network: HyperConfig {
                field: SirenConfig { hidden: 16, layers: 3 },
                heads: HeadKind::LowRank(4),
                person: person_numbers,
            },
            sampling: SamplingConfig {
                surface: 96,
                near: 64,
                free: 0,
                uniform: 32,
                ..SamplingConfig::default()
            },
            joint: JointConfig {
                people: 6,
                frames: 4,
                steps: 600,
                people_per_step: 3,
                rates: RateConfig { field: 2e-3, trunk: 1e-3, ..JointConfig::default().rates },
                ..JointConfig::default()
            },
            ..PriorConfig::default()
        };
        let mut rng = StdRng::seed_from_u64(1);
        let start = SirenField::init(config.network.field, &mut rng);
        let mut joint = Joint::new(start.parameters().to_vec(), &config, &ball);
        for number in 0..config.joint.steps {
            joint.step(number, &config, &ball).unwrap();
        }
        let (mut sum, mut count) = (0.0, 0.0);
        for (person, code) in joint.people.iter().zip(&joint.codes) {
            let codes = vec![code.as_slice(); person.poses.len()];
            let (_, fields) = joint.network.forward_with_codes(&person.poses, &codes);
            for (frame, parameters) in person.points.iter().zip(fields) {
                let field = SirenField::new(config.network.field, parameters);
                let values = values_at(&field, &frame.surface);
                sum += values.iter().map(|value| value.abs()).sum::<f32>();
                count += values.len() as f32;
            }
        }
        sum / count
    }

    #[test]
    fn what_a_pose_does_depends_on_who_it_is() {
        let (told, untold) = (error(3), error(0));
        println!("{told} told who it is, {untold} untold");
        assert!(told < 0.5 * untold, "{told} {untold}");
    }
}
