//! The prior's training on balls: each person is a ball of another size.

use std::ops::ControlFlow;

use effigy_registration::smpl::JOINT_COUNT;
use glam::{Mat3, Vec3};
use rand::{RngExt as _, SeedableRng as _, rngs::StdRng};

use super::{JointConfig, Person, PersonFrame, PriorConfig, ReptileConfig, train_prior};
use crate::{
    PoseInput, SignedDistanceField as _,
    fine_tune::sampling::random_in_box,
    hyper::{HeadKind, HyperConfig},
    sdf::SirenConfig,
};

fn ball(number: u64, frames: usize) -> Person {
    let mut rng = StdRng::seed_from_u64(number);
    let radius = rng.random_range(0.4_f32..0.6);
    let frames = (0..frames)
        .map(|_| {
            let normals: Vec<Vec3> = (0..300)
                .map(|_| random_in_box(&mut rng).normalize_or(Vec3::X))
                .collect();
            PersonFrame {
                pose: PoseInput {
                    rotations: [Mat3::IDENTITY; JOINT_COUNT],
                    joints_in_unit: [Vec3::ZERO; JOINT_COUNT],
                },
                points_in_unit: normals.iter().map(|n| *n * radius).collect(),
                normals,
            }
        })
        .collect();
    Person { frames }
}

fn config() -> PriorConfig {
    let sampling = crate::fine_tune::SamplingConfig {
        surface: 96,
        near: 64,
        free: 0,
        uniform: 32,
        ..Default::default()
    };
    PriorConfig {
        network: HyperConfig {
            field: SirenConfig { hidden: 16, layers: 3 },
            heads: HeadKind::LowRank(4),
        },
        sampling,
        reptile: ReptileConfig {
            warm_up_steps: 60,
            warm_up_rate: 3e-3,
            outer_steps: 4,
            people: 2,
            inner_steps: 3,
            ..ReptileConfig::default()
        },
        joint: JointConfig {
            people: 4,
            frames: 2,
            steps: 30,
            people_per_step: 2,
            ..JointConfig::default()
        },
        checkpoint_every: 1000,
        ..PriorConfig::default()
    }
}

#[test]
fn a_prior_over_balls_is_a_ball_of_middling_size() {
    let mut ignore = |_: &_| ControlFlow::Continue(());
    let prior = train_prior(&ball, &config(), None, &mut ignore)
        .unwrap()
        .unwrap();
    let mut values = [0.0; 3];
    let points = [Vec3::ZERO, Vec3::X * 0.3, Vec3::X * 0.75];
    prior
        .field(&ball(1, 1).frames[0].pose)
        .values(&points, &mut values);
    assert!(
        values[0] < 0.0 && values[1] < 0.0 && values[2] > 0.0,
        "{values:?}"
    );
}

#[test]
fn interrupted_training_resumes_to_the_same_prior() {
    let config = config();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    let mut ignore = |_: &_| ControlFlow::Continue(());
    let whole = train_prior(&ball, &config, None, &mut ignore)
        .unwrap()
        .unwrap();
    // Once within each stage: after 62 steps of the first, and 11 of the second.
    for interruption in [62, 64 + 11] {
        let path = path.join(format!("{interruption}.checkpoint"));
        let mut reports = 0;
        let mut stop = |_: &_| {
            reports += 1;
            if reports == interruption {
                ControlFlow::Break(())
            } else {
                ControlFlow::Continue(())
            }
        };
        assert!(
            train_prior(&ball, &config, Some(&path), &mut stop)
                .unwrap()
                .is_none()
        );
        let resumed = train_prior(&ball, &config, Some(&path), &mut ignore)
            .unwrap()
            .unwrap();
        assert!(resumed == whole, "interrupted after {interruption} steps");
    }
}

#[test]
fn a_checkpoint_of_another_configuration_is_refused() {
    let config = config();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("prior.checkpoint");
    let mut stop = |_: &_| ControlFlow::Break(());
    assert!(
        train_prior(&ball, &config, Some(&path), &mut stop)
            .unwrap()
            .is_none()
    );
    let other = PriorConfig { seed: 2, ..config };
    let error = train_prior(&ball, &other, Some(&path), &mut stop)
        .unwrap_err()
        .to_string();
    assert!(error.contains("another configuration"), "{error}");
}
