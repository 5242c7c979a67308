//! Fine-tuning on a ball whose size depends on the pose: the truth is a formula.

use std::ops::ControlFlow;

use effigy_registration::smpl::{JOINT_COUNT, rotation_from_axis_angle};
use glam::Vec3;
use rand::{SeedableRng as _, rngs::StdRng};

use super::{FineTuneConfig, FineTuner, SamplingConfig, fine_tune, sampling::random_in_box};
use crate::{
    AvatarError, CanonicalSamples, PoseInput, SignedDistanceField as _,
    hyper::{HeadKind, HyperConfig, HyperNetwork, RateConfig},
    nn::{Threads, ThreadsConfig},
    sdf::{SirenConfig, SirenField},
};

const SMALL: HyperConfig = HyperConfig {
    field: SirenConfig { hidden: 32, layers: 4 },
    heads: HeadKind::LowRank(4),
    person: 3,
};

/// A keyframe with the elbow bent by this much; the ball grows with it.
fn keyframe(bend_rad: f32) -> CanonicalSamples {
    let mut theta = [Vec3::ZERO; JOINT_COUNT];
    theta[18].y = bend_rad;
    let mut rng = StdRng::seed_from_u64(u64::from(bend_rad.to_bits()));
    let normals: Vec<Vec3> = (0..800)
        .map(|_| random_in_box(&mut rng).normalize_or(Vec3::X))
        .collect();
    let radius = radius(bend_rad);
    CanonicalSamples {
        theta,
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

fn radius(bend_rad: f32) -> f32 {
    0.5 + 0.05 * bend_rad
}

pub(crate) fn config() -> FineTuneConfig {
    FineTuneConfig {
        steps: 120,
        held_out_every: 40,
        sampling: SamplingConfig {
            surface: 160,
            near: 64,
            free: 32,
            uniform: 64,
            ..Default::default()
        },
        rates: RateConfig { field: 2e-3, ..RateConfig::everything() },
        // Nobody told this network what is inside.
        learns_normals: true,
        ..FineTuneConfig::default().without_code()
    }
}

pub(crate) fn network() -> HyperNetwork {
    let mut rng = StdRng::seed_from_u64(3);
    let meta = SirenField::init(SMALL.field, &mut rng);
    HyperNetwork::init(SMALL, &meta, &mut rng)
}

pub(crate) fn keyframes() -> Vec<CanonicalSamples> {
    [0.0, 0.5, 1.0].map(keyframe).to_vec()
}

fn learned(config: &FineTuneConfig) -> HyperNetwork {
    let mut ignore = |_: &_, _: &_| ControlFlow::Continue(());
    fine_tune(network(), &keyframes(), 1.0, config, &|| 0.0, &mut ignore).unwrap()
}

#[test]
fn a_ball_that_grows_with_the_pose_is_learned_with_its_sign() {
    let mut residuals_m = Vec::new();
    let mut report = |now: &super::FineTuneProgress, _: &_| {
        residuals_m.push(now.held_out_residual_m);
        ControlFlow::Continue(())
    };
    let config = FineTuneConfig { steps: 400, ..config() };
    let network = fine_tune(network(), &keyframes(), 1.0, &config, &|| 0.0, &mut report).unwrap();
    // A network of 32 units after 400 steps: a hundredth of the ball's radius.
    assert!(*residuals_m.last().unwrap() < 0.006, "{residuals_m:?}");
    for bend_rad in [0.0, 0.75] {
        let radius = radius(bend_rad);
        let points = [Vec3::X * (radius - 0.05), Vec3::X * (radius + 0.05)];
        let mut values = [0.0; 2];
        network.field(&pose(bend_rad)).values(&points, &mut values);
        assert!(values[0] < -0.03 && values[1] > 0.03, "{values:?}");
    }
}

#[test]
fn the_result_depends_on_the_seed_alone_not_on_the_threads() {
    let config = FineTuneConfig { steps: 12, ..config() };
    let on = |count: usize| {
        let threads = Threads::new(&ThreadsConfig { count }, || {}).unwrap();
        threads.run(|| learned(&config))
    };
    let one = on(1);
    assert_eq!(one, on(3));
    assert_ne!(one, learned(&FineTuneConfig { seed: 2, ..config }));
}

#[test]
fn steps_over_some_keyframes_at_a_time_learn_all_of_them() {
    let config = FineTuneConfig { steps: 400, frames_per_step: 2, ..config() };
    let network = learned(&config);
    for samples in keyframes() {
        let mut values = vec![0.0; samples.points_in_unit.len()];
        network
            .field(&samples.pose)
            .values(&samples.points_in_unit, &mut values);
        let mean = values.iter().map(|value| value.abs()).sum::<f32>() / values.len() as f32;
        // As when every step sees all three: a hundredth of the ball's radius, with some leeway.
        assert!(mean < 0.01, "{mean}");
    }
}

#[test]
fn few_poses_say_little_about_what_poses_do() {
    let moved = |rates: RateConfig| {
        let rates = RateConfig { field: 2e-3, ..rates };
        let network = learned(&FineTuneConfig { rates, ..config() });
        let values = [0.0, 1.0].map(|bend_rad| {
            let mut value = [0.0];
            network
                .field(&pose(bend_rad))
                .values(&[Vec3::X * 0.5], &mut value);
            value[0]
        });
        (values[0] - values[1]).abs()
    };
    let (few, many) = (
        moved(RateConfig::of_poses(8)),
        moved(RateConfig::of_poses(128)),
    );
    println!("the surface moves by {few} of {many}");
    assert!(few < 0.5 * many, "{few} {many}");
    assert_eq!(RateConfig::of_poses(500), RateConfig::everything());
    assert_eq!(RateConfig::default(), RateConfig::of_poses(8));
}

#[test]
fn the_first_steps_look_for_who_it_is_and_leave_all_else() {
    let of_code = FineTuneConfig { steps: 20, code_steps: 20, ..config() };
    // Somebody is known already: an untrained basis says nothing of anybody.
    let start = learned(&config());
    let learned = |config: &FineTuneConfig| {
        let mut ignore = |_: &_, _: &_| ControlFlow::Continue(());
        fine_tune(
            start.clone(),
            &keyframes(),
            1.0,
            config,
            &|| 0.0,
            &mut ignore,
        )
        .unwrap()
    };
    let mut found = learned(&of_code);
    assert_ne!(found.person, start.person);
    found.person.clone_from(&start.person);
    for (own, start) in found.heads.iter_mut().zip(&start.heads) {
        let own = own.coefficients.as_mut().expect("a low-rank head");
        let start = start.coefficients.as_ref().expect("a low-rank head");
        assert_ne!(own.bias, start.bias);
        own.bias.clone_from(&start.bias);
    }
    assert_eq!(found, start);
    let longer = learned(&FineTuneConfig { steps: 40, ..of_code });
    assert_ne!(longer.heads[0].output, start.heads[0].output);
}

#[test]
fn points_far_from_whoever_was_found_count_less() {
    // A third of the points are where a keyframe with another arm would have them.
    let mut spoiled = keyframes();
    for samples in &mut spoiled {
        for (point, normal) in samples
            .points_in_unit
            .iter_mut()
            .zip(&samples.normals)
            .step_by(3)
        {
            *point += *normal * 0.3;
        }
    }
    let start = learned(&FineTuneConfig { steps: 300, ..config() });
    let off = |doubt_m| {
        let config = FineTuneConfig { steps: 100, code_steps: 1, doubt_m, ..config() };
        let mut ignore = |_: &_, _: &_| ControlFlow::Continue(());
        let network =
            fine_tune(start.clone(), &spoiled, 1.0, &config, &|| 0.0, &mut ignore).unwrap();
        let points: Vec<Vec3> = keyframes()[1].points_in_unit.clone();
        let mut values = vec![0.0; points.len()];
        network.field(&pose(0.5)).values(&points, &mut values);
        values.iter().map(|value| value.abs()).sum::<f32>() / values.len() as f32
    };
    let (doubted, believed) = (off(0.02), off(0.0));
    println!("{doubted} with doubts, {believed} without");
    assert!(doubted < 0.8 * believed, "{doubted} {believed}");
}

#[test]
fn normals_say_nothing_unless_they_are_learned() {
    let mut lying = keyframes();
    for samples in &mut lying {
        samples.normals.fill(Vec3::X);
    }
    let learned_from = |samples: &[CanonicalSamples], learns_normals| {
        // Points beside the surface lie along normals.
        let sampling = SamplingConfig { near: 0, ..config().sampling };
        let config = FineTuneConfig { steps: 3, sampling, learns_normals, ..config() };
        let mut ignore = |_: &_, _: &_| ControlFlow::Continue(());
        fine_tune(network(), samples, 1.0, &config, &|| 0.0, &mut ignore).unwrap()
    };
    let both = |learns| {
        (
            learned_from(&keyframes(), learns),
            learned_from(&lying, learns),
        )
    };
    let (honest, misled) = both(false);
    assert_eq!(honest, misled);
    let (honest, misled) = both(true);
    assert_ne!(honest, misled);
}

#[test]
fn points_of_weight_zero_are_never_drawn() {
    let mut spoiled = keyframes();
    for samples in &mut spoiled {
        samples.points_in_unit.push(Vec3::splat(0.9));
        samples.normals.push(Vec3::X);
        samples.weights.push(0.0);
    }
    let config = FineTuneConfig { steps: 5, held_out_share: 0.0, ..config() };
    let mut ignore = |_: &_, _: &_| ControlFlow::Continue(());
    let with = fine_tune(network(), &spoiled, 1.0, &config, &|| 0.0, &mut ignore).unwrap();
    assert_eq!(with, learned(&config));
}

#[test]
fn rates_that_blow_up_end_in_an_error() {
    let mut config = config();
    config.rates.field = 1e30;
    config.warm_up_steps = 1;
    let mut ignore = |_: &_, _: &_| ControlFlow::Continue(());
    let error = fine_tune(network(), &keyframes(), 1.0, &config, &|| 0.0, &mut ignore).unwrap_err();
    assert!(
        matches!(error, AvatarError::LossNotFinite { .. }),
        "{error}"
    );
}

#[test]
fn unusable_keyframes_are_named() {
    let refuse = |samples: &[CanonicalSamples]| {
        FineTuner::new(network(), samples, 1.0, &config())
            .err()
            .expect("it is refused")
            .to_string()
    };
    assert!(refuse(&[]).contains("at least one keyframe"));
    let mut empty = keyframes();
    empty[1].weights.fill(0.0);
    assert!(refuse(&empty).contains("keyframe 1"));
    let mut uneven = keyframes();
    uneven[2].normals.pop();
    assert!(refuse(&uneven).contains("keyframe 2"));
    let mut broken = keyframes();
    broken[0].points_in_unit[5].y = f32::NAN;
    assert!(refuse(&broken).contains("not finite"));
}
