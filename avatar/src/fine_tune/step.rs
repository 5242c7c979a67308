//! The stage itself: one Adam step at a time, over all keyframes or some of them.

use std::ops::ControlFlow;
#[cfg(feature = "gpu")]
use std::sync::Arc;

use glam::Vec3;
use rand::{SeedableRng as _, rngs::StdRng};
use serde::{Deserialize, Serialize};

use super::{
    FineTuneConfig,
    live_gradients::LiveGradients,
    sampling::{self, KeyframePoints, values_at},
};
#[cfg(feature = "gpu")]
use crate::gpu::Gpu;
use crate::{
    CanonicalSamples, PoseInput,
    error::AvatarError,
    hyper::{HyperNetwork, optimizer::HyperOptimizer},
    sdf::{
        SirenField,
        batch::FieldFrame,
        loss::{LossPoint, LossTerms},
    },
};

/// Most held-out points a keyframe that a measurement evaluates.
const HELD_OUT_POINTS: usize = 512;

/// Where fine-tuning stands.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct FineTuneProgress {
    /// Steps done, of `steps`.
    pub step: u32,
    pub steps: u32,
    /// Loss of the last step.
    pub loss: LossTerms,
    /// Mean distance of the held-out points to the surface at the last measurement.
    pub held_out_residual_m: f32,
    pub elapsed_secs: f64,
    pub left_secs: f64,
}

/// Fine-tunes until all steps are done, or until `on_progress`, which sees the network as it is after each step, says to
/// stop: the network learned so far is returned in either case. `clock` gives seconds from any origin.
pub fn fine_tune(
    network: HyperNetwork,
    samples: &[CanonicalSamples],
    metres_per_unit: f32,
    config: &FineTuneConfig,
    clock: &dyn Fn() -> f64,
    on_progress: &mut dyn FnMut(&FineTuneProgress, &HyperNetwork) -> ControlFlow<()>,
) -> Result<HyperNetwork, AvatarError> {
    let mut tuner = FineTuner::new(network, samples, metres_per_unit, config)?;
    tuner.run(clock, on_progress)?;
    Ok(tuner.into_network())
}

/// Fine-tuning, one step at a time. Runs in the current rayon pool.
pub struct FineTuner {
    network: HyperNetwork,
    optimizer: HyperOptimizer,
    /// Of the steps that look for who it is, as long as they last.
    code_optimizer: Option<HyperOptimizer>,
    gradients: LiveGradients,
    config: FineTuneConfig,
    metres_per_unit: f32,
    poses: Vec<PoseInput>,
    keyframes: Vec<KeyframePoints>,
    rng: StdRng,
    step: u32,
    points: Vec<Vec<Vec3>>,
    known: Vec<Vec<LossPoint>>,
}

impl FineTuner {
    /// Checks the samples and takes the network as its start.
    pub fn new(
        network: HyperNetwork,
        samples: &[CanonicalSamples],
        metres_per_unit: f32,
        config: &FineTuneConfig,
    ) -> Result<Self, AvatarError> {
        check(samples)?;
        let mut rng = StdRng::seed_from_u64(config.seed);
        let keyframes = sampling::keyframes(samples, config.held_out_share, &mut rng);
        let poses: Vec<_> = samples.iter().map(|s| s.pose).collect();
        let inputs = network.output_inputs(&poses);
        let code_optimizer = || HyperOptimizer::new(&network, &inputs, &config.code_rates);
        Ok(Self {
            code_optimizer: (config.code_steps > 0).then(code_optimizer),
            optimizer: HyperOptimizer::new(&network, &inputs, &config.rates),
            gradients: LiveGradients::on_cpu(network.config().field),
            network,
            config: *config,
            metres_per_unit,
            points: vec![Vec::new(); poses.len()],
            known: vec![Vec::new(); poses.len()],
            poses,
            keyframes,
            rng,
            step: 0,
        })
    }

    /// Computes on the device from now on, for as long as it is well.
    #[cfg(feature = "gpu")]
    pub fn lend(&mut self, gpu: &Arc<Gpu>) {
        self.gradients.lend(gpu, self.network.config().field);
    }

    /// Gives a lent device up unless it computes what the processor does, and sooner; moves nothing. `clock` as that of
    /// [`fine_tune`].
    #[cfg(feature = "gpu")]
    pub fn try_out(&mut self, clock: &dyn Fn() -> f64) {
        let of_steps = std::mem::replace(&mut self.rng, StdRng::seed_from_u64(self.config.seed));
        let poses = self.draw();
        self.rng = of_steps;
        let (_, parameters) = self.network.forward(&poses);
        let frames = frames(&parameters, &self.points, &self.known);
        self.gradients
            .try_out(&frames, &self.config.loss_of_step(), clock);
    }

    /// What computes steps: "CPU", "AMD Radeon RX 7600".
    pub fn device(&self) -> &str {
        self.gradients.device()
    }

    /// Why a device that was lent does not compute.
    pub fn gave_up(&self) -> Option<&str> {
        self.gradients.gave_up()
    }

    /// All steps that are left, as [`fine_tune`] does them.
    pub fn run(
        &mut self,
        clock: &dyn Fn() -> f64,
        on_progress: &mut dyn FnMut(&FineTuneProgress, &HyperNetwork) -> ControlFlow<()>,
    ) -> Result<(), AvatarError> {
        let (steps, every) = (self.config.steps, self.config.held_out_every.max(1));
        let start_secs = clock();
        let mut progress = FineTuneProgress {
            steps,
            held_out_residual_m: self.held_out_residual_m(),
            ..FineTuneProgress::default()
        };
        while progress.step < steps {
            progress.loss = self.step()?;
            progress.step += 1;
            let is_last = progress.step == steps;
            if is_last || progress.step.is_multiple_of(every) {
                progress.held_out_residual_m = self.held_out_residual_m();
            }
            progress.elapsed_secs = clock() - start_secs;
            let left = f64::from(steps - progress.step) / f64::from(progress.step);
            progress.left_secs = progress.elapsed_secs * left;
            if on_progress(&progress, &self.network).is_break() {
                break;
            }
        }
        Ok(())
    }

    /// What the next step learns from, into `points` and `known`; the poses of the keyframes taken.
    fn draw(&mut self) -> Vec<PoseInput> {
        let wanted = self.config.frames_per_step;
        let taken = sampling::choose(self.keyframes.len(), wanted, &mut self.rng);
        let drawn = self.points.iter_mut().zip(&mut self.known);
        for (&keyframe, (points, known)) in taken.iter().zip(drawn) {
            self.keyframes[keyframe].draw(&self.config.sampling, &mut self.rng, points, known);
        }
        taken.iter().map(|&keyframe| self.poses[keyframe]).collect()
    }

    /// One Adam step over all keyframes, or as many as a step takes; the loss before it.
    pub fn step(&mut self) -> Result<LossTerms, AvatarError> {
        let poses = self.draw();
        let (cache, parameters) = self.network.forward(&poses);
        let frames = frames(&parameters, &self.points, &self.known);
        let terms = self.gradients.compute(&frames, &self.config.loss_of_step());
        if !terms.total().is_finite() {
            return Err(AvatarError::LossNotFinite { step: self.step, terms });
        }
        let bars: Vec<_> = (0..frames.len())
            .map(|frame| self.gradients.frame(frame))
            .collect();
        let gradient = self.network.backward(cache, &bars);
        let share = self.config.rate_share(self.step);
        let optimizer = self.code_optimizer.as_mut().unwrap_or(&mut self.optimizer);
        optimizer.step(&mut self.network, &gradient, share);
        self.step += 1;
        if self.step == self.config.code_steps {
            self.code_optimizer = None;
            self.doubt();
        }
        Ok(terms)
    }

    /// Takes weight from points that are far from the surface of whoever was found.
    fn doubt(&mut self) {
        let half = self.config.doubt_m / self.metres_per_unit;
        if half <= 0.0 {
            return;
        }
        let (_, parameters) = self.network.forward(&self.poses);
        for (keyframe, parameters) in self.keyframes.iter_mut().zip(parameters) {
            let field = SirenField::new(self.network.config().field, parameters);
            let values = values_at(&field, &keyframe.surface);
            for (at, value) in keyframe.surface.iter_mut().zip(values) {
                at.weight /= 1.0 + (value / half).powi(2);
            }
        }
    }

    /// Mean distance to the surface of points that no step has seen, weighted as the loss weighs them.
    pub fn held_out_residual_m(&self) -> f32 {
        let (_, parameters) = self.network.forward(&self.poses);
        let (mut sum, mut weights) = (0.0_f64, 0.0_f64);
        for (keyframe, parameters) in self.keyframes.iter().zip(parameters) {
            let held_out = &keyframe.held_out[..keyframe.held_out.len().min(HELD_OUT_POINTS)];
            let field = SirenField::new(self.network.config().field, parameters);
            let values = values_at(&field, held_out);
            for (value, at) in values.iter().zip(held_out) {
                sum += f64::from(value.abs() * at.weight);
                weights += f64::from(at.weight);
            }
        }
        if weights > 0.0 {
            (sum / weights) as f32 * self.metres_per_unit
        } else {
            f32::NAN
        }
    }

    pub fn network(&self) -> &HyperNetwork {
        &self.network
    }

    pub fn into_network(self) -> HyperNetwork {
        self.network
    }
}

/// Each keyframe's field and what is known of it.
fn frames<'a>(
    parameters: &'a [Vec<f32>],
    points: &'a [Vec<Vec3>],
    known: &'a [Vec<LossPoint>],
) -> Vec<FieldFrame<'a>> {
    parameters
        .iter()
        .zip(points.iter().zip(known))
        .map(|(parameters, (points, known))| FieldFrame { parameters, points, known })
        .collect()
}

fn check(samples: &[CanonicalSamples]) -> Result<(), AvatarError> {
    if samples.is_empty() {
        return Err(AvatarError::NoKeyframes);
    }
    for (keyframe, samples) in samples.iter().enumerate() {
        let points = samples.points_in_unit.len();
        let (normals, weights) = (samples.normals.len(), samples.weights.len());
        if points != normals || points != weights {
            return Err(AvatarError::SampleCounts { keyframe, points, normals, weights });
        }
        if samples.weights.iter().all(|weight| *weight <= 0.0) {
            return Err(AvatarError::EmptyKeyframe { keyframe, points });
        }
        let all = samples.points_in_unit.iter().chain(&samples.normals);
        if !all.chain(&samples.free_in_unit).all(|p| p.is_finite())
            || !samples.weights.iter().all(|w| w.is_finite())
        {
            return Err(AvatarError::KeyframeNotFinite { keyframe });
        }
    }
    Ok(())
}
