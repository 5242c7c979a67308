//! Learning a conditioned field: the samples, draws, losses and schedule of fine-tuning, on other networks.

use std::{ops::ControlFlow, sync::Arc};

use glam::Vec3;
use rand::{SeedableRng as _, rngs::StdRng};

use super::{BodyLabels, ConditionedField, occupancy::occupancy_loss};
use crate::{
    CanonicalSamples,
    error::AvatarError,
    fine_tune::{
        FineTuneConfig,
        sampling::{self, KeyframePoints},
    },
    nn::{
        AdamConfig, AdamStep,
        adam::Moments,
        field_mlp::{MlpFrame, MlpGradients},
    },
    sdf::loss::{LossPoint, point_loss},
};

/// Learns from some frames; `config.rates.field` is Adam's rate. `labels` say where the minimal body of each sample is,
/// which only occupancy needs; others give none. Ends early, with what is learned so far, when `go_on` breaks.
pub fn fit(
    field: &mut ConditionedField,
    samples: &[CanonicalSamples],
    labels: &[Arc<BodyLabels>],
    config: &FineTuneConfig,
    go_on: &mut dyn FnMut() -> ControlFlow<()>,
) -> Result<(), AvatarError> {
    if samples.is_empty() {
        return Err(AvatarError::NoKeyframes);
    }
    let mut rng = StdRng::seed_from_u64(config.seed);
    let keyframes = sampling::keyframes(samples, 0.0, &mut rng);
    let mut moments = Moments::zeros(field.mlp.parameters.len());
    let mut gradients = MlpGradients::default();
    let loss = config.loss_of_step();
    for step in 0..config.steps {
        let drawn = draw(&keyframes, labels, config, &mut rng);
        let codes: Vec<_> = drawn
            .iter()
            .map(|drawn| field.codes(&samples[drawn.keyframe].pose))
            .collect();
        let frames: Vec<_> = drawn
            .iter()
            .zip(&codes)
            .map(|(drawn, codes)| MlpFrame {
                codes: &**codes,
                points: &drawn.points,
                known: &drawn.known,
            })
            .collect();
        let is_occupancy = field.architecture.is_occupancy();
        let terms = gradients.compute(&field.mlp, &frames, &|scale, point, value, gradient| {
            if is_occupancy {
                occupancy_loss(scale, point, value)
            } else {
                point_loss(&loss, scale, point, value, gradient)
            }
        });
        if !terms.total().is_finite() {
            return Err(AvatarError::LossNotFinite { step, terms });
        }
        drop(codes);
        let rate = config.rates.field * config.rate_share(step);
        let adam = AdamStep::new(AdamConfig::default(), step + 1);
        moments.step(&adam, rate, &gradients.sum, &mut field.mlp.parameters);
        if go_on().is_break() {
            break;
        }
    }
    Ok(())
}

/// One step's points of one keyframe.
struct Drawn {
    keyframe: usize,
    points: Vec<Vec3>,
    known: Vec<LossPoint>,
}

fn draw(
    keyframes: &[KeyframePoints],
    labels: &[Arc<BodyLabels>],
    config: &FineTuneConfig,
    rng: &mut StdRng,
) -> Vec<Drawn> {
    let numbers = sampling::choose(keyframes.len(), config.frames_per_step, rng);
    let mut drawn = Vec::with_capacity(numbers.len());
    for keyframe in numbers {
        let (mut points, mut known) = (Vec::new(), Vec::new());
        keyframes[keyframe].draw(&config.sampling, rng, &mut points, &mut known);
        if let Some(labels) = labels.get(keyframe) {
            labels.fill(&mut points, &mut known, rng);
        }
        drawn.push(Drawn { keyframe, points, known });
    }
    drawn
}

#[cfg(test)]
mod tests {
    use effigy_registration::smpl::{JOINT_COUNT, rotation_from_axis_angle};

    use super::*;
    use crate::{
        PoseField as _, PoseInput,
        baselines::Architecture,
        fine_tune::{SamplingConfig, sampling::random_in_box},
        hyper::RateConfig,
    };

    /// A ball of this radius in unit space, seen from all sides; the elbow's bend makes it grow.
    fn keyframe(bend_rad: f32) -> CanonicalSamples {
        let mut rng = StdRng::seed_from_u64(3);
        let normals: Vec<Vec3> = (0..800)
            .map(|_| random_in_box(&mut rng).normalize_or(Vec3::X))
            .collect();
        let radius = 0.5 + 0.1 * bend_rad;
        CanonicalSamples {
            theta: [Vec3::ZERO; JOINT_COUNT],
            pose: pose(bend_rad),
            points_in_unit: normals.iter().map(|n| *n * radius).collect(),
            weights: vec![1.0; normals.len()],
            free_in_unit: normals.iter().map(|n| *n * (radius + 0.1)).collect(),
            normals,
        }
    }

    fn pose(bend_rad: f32) -> PoseInput {
        let mut rotations = [glam::Mat3::IDENTITY; JOINT_COUNT];
        rotations[18] = rotation_from_axis_angle(Vec3::Y * bend_rad);
        PoseInput { rotations, joints_in_unit: [Vec3::ZERO; JOINT_COUNT] }
    }

    #[test]
    fn a_siren_that_is_told_the_pose_learns_a_ball_that_grows_with_it() {
        let sampling =
            SamplingConfig { surface: 160, near: 64, free: 32, uniform: 64, ..Default::default() };
        let config = FineTuneConfig {
            steps: 800,
            sampling,
            rates: RateConfig { field: 2e-4, ..RateConfig::default() },
            learns_normals: true,
            ..FineTuneConfig::default()
        };
        let mut field = ConditionedField::new(Architecture::Siren, 1);
        let samples = [0.0, 1.0].map(keyframe);
        let mut go_on = || ControlFlow::Continue(());
        fit(&mut field, &samples, &[], &config, &mut go_on).unwrap();
        for bend_rad in [0.0, 1.0] {
            let radius = 0.5 + 0.1 * bend_rad;
            let mut values = [0.0; 2];
            let points = [Vec3::X * (radius - 0.04), Vec3::X * (radius + 0.04)];
            field.field(&pose(bend_rad)).values(&points, &mut values);
            assert!(values[0] < 0.0 && values[1] > 0.0, "{bend_rad}: {values:?}");
        }
    }
}
