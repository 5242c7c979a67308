//! The prior's training on balls: each person is a ball of another size.

use std::{ops::ControlFlow, path::Path};

use effigy_registration::smpl::JOINT_COUNT;
use glam::{Mat3, Vec3};
use rand::{RngExt as _, SeedableRng as _, rngs::StdRng};

use super::{
    AdaptConfig, HeldOut, JointConfig, OuterStep, Person, PersonFrame, PriorConfig, ReptileConfig,
    TrainEvent, Training, Validation, train_field, train_hyper,
};
use crate::{
    AvatarError, CanonicalSamples, PoseInput, SignedDistanceField as _,
    fine_tune::sampling::random_in_box,
    hyper::{HeadKind, HyperConfig, HyperNetwork},
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
            person: 3,
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
        adapt: AdaptConfig { outer_steps: 6, frames: 2, inner_steps: 3, ..AdaptConfig::default() },
        checkpoint_every: 1000,
        patience: 1000,
        ..PriorConfig::default()
    }
}

/// One ball that training never sees, and short fine-tunings on it.
fn validation() -> Validation {
    let person = ball(1, 2);
    let seen = person.frames.iter().map(|frame| CanonicalSamples {
        theta: [Vec3::ZERO; JOINT_COUNT],
        pose: frame.pose,
        points_in_unit: frame.points_in_unit.clone(),
        normals: frame.normals.clone(),
        weights: vec![1.0; frame.normals.len()],
        free_in_unit: Vec::new(),
    });
    let people =
        vec![HeldOut { seen: seen.collect(), judged: ball(1, 1).frames, metres_per_unit: 1.0 }];
    let mut validation = Validation::new(people);
    validation.fine_tune.steps = 3;
    validation
}

/// Both commands, one after the other; stops after so many events in all.
fn train(
    config: &PriorConfig,
    folder: Option<&Path>,
    mut events: usize,
) -> Result<Option<HyperNetwork>, AvatarError> {
    let validation = validation();
    let paths = folder.map(|folder| ["field", "hyper"].map(|name| folder.join(name)));
    let mut on_event = |_: &TrainEvent<'_>| {
        events -= 1;
        if events == 0 {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    };
    let checkpoint = |part: usize| paths.as_ref().map(|paths| paths[part].as_path());
    let field = train_field(Training {
        source: &ball,
        config,
        validation: Some(&validation),
        checkpoint: checkpoint(0),
        on_event: &mut on_event,
    })?;
    let Some(field) = field else {
        return Ok(None);
    };
    let training = Training {
        source: &ball,
        config,
        validation: Some(&validation),
        checkpoint: checkpoint(1),
        on_event: &mut on_event,
    };
    train_hyper(&field, training)
}

#[test]
fn a_prior_over_balls_is_a_ball_of_middling_size() {
    for outer in [
        OuterStep::FirstOrder { rate: 1e-4 },
        OuterStep::Reptile { share: 0.3 },
    ] {
        let mut config = config();
        config.adapt.outer = outer;
        let prior = train(&config, None, usize::MAX).unwrap().unwrap();
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
}

#[test]
fn interrupted_training_resumes_to_the_same_prior() {
    let config = config();
    let whole = train(&config, None, usize::MAX).unwrap().unwrap();
    // Once within each stage: the first has 64 steps and 11 validations, the second 30 and 10.
    for interruption in [62, 75 + 11, 75 + 40 + 5] {
        let folder = tempfile::tempdir().unwrap();
        let stopped = train(&config, Some(folder.path()), interruption).unwrap();
        assert!(stopped.is_none(), "stopped after {interruption} events");
        let resumed = train(&config, Some(folder.path()), usize::MAX)
            .unwrap()
            .unwrap();
        assert!(resumed == whole, "interrupted after {interruption} events");
    }
}

#[test]
fn a_checkpoint_of_another_configuration_is_refused() {
    let config = config();
    let folder = tempfile::tempdir().unwrap();
    assert!(train(&config, Some(folder.path()), 1).unwrap().is_none());
    let other = PriorConfig { seed: 2, ..config };
    let error = train(&other, Some(folder.path()), 1)
        .unwrap_err()
        .to_string();
    assert!(error.contains("another configuration"), "{error}");
}

#[test]
fn training_ends_early_with_its_best_network_when_nothing_gets_better() {
    let mut config = config();
    // One worse validation is enough; with these few points there soon is one.
    (config.patience, config.validate_share) = (0, 0.05);
    let validation = validation();
    let (mut scores, mut early) = (Vec::new(), false);
    let field = train_field(Training {
        source: &ball,
        config: &config,
        validation: Some(&validation),
        checkpoint: None,
        on_event: &mut |event| {
            match event {
                TrainEvent::Validated(_, validated) => scores.push(validated.held_out_mm),
                TrainEvent::EndsEarly(_) => early = true,
                TrainEvent::Step(_) => {}
            }
            ControlFlow::Continue(())
        },
    });
    let field = field.unwrap().unwrap();
    assert!(early, "{scores:?}");
    let best = scores.iter().copied().fold(f64::INFINITY, f64::min);
    assert_eq!(validation.of(&field, None).unwrap().held_out_mm, best);
}
