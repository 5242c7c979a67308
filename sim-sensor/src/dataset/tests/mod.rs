//! A data set is what was simulated, whoever makes it and however often it is interrupted.

use std::{
    fs,
    path::Path,
    sync::atomic::{AtomicU32, Ordering},
};

use effigy_capture::FrameId;
use effigy_fusion::mesh::closest_point::ClosestPoint;
use effigy_registration::smpl::builtin;
use glam::vec3;

use super::*;
use crate::{Noise, OutfitKind, Room, Scenario, SensorPreset, Truth};

mod robust;

/// Two frames of each sequence, in clothes that need no simulation.
fn plan() -> DatasetPlan {
    let mut plan = DatasetPlan::new(DatasetPreset::Small, 5);
    for sequence in &mut plan.sequences {
        sequence.frames = 2;
        sequence.outfit = OutfitKind::Loose.into();
        scenario_of(sequence).outfit = OutfitKind::Loose;
    }
    plan
}

fn scenario_of(plan: &mut SequencePlan) -> &mut Scenario {
    plan.scenario.as_mut().unwrap()
}

fn seed_of(plan: &SequencePlan) -> u64 {
    plan.scenario.as_ref().unwrap().seed
}

fn made(plan: &DatasetPlan, folder: &Path) -> Dataset {
    make(plan, &builtin::body(), folder, &|_| true)
        .unwrap()
        .unwrap();
    Dataset::open(folder, &builtin::body()).unwrap()
}

#[test]
fn what_is_loaded_is_the_truth_to_half_a_step() {
    let folder = tempfile::tempdir().unwrap();
    let plan = plan();
    let dataset = made(&plan, folder.path());
    for entry in &dataset.manifest().sequences {
        let sequence = dataset.load(entry).unwrap();
        let truth = Truth::new(entry.plan.scenario.as_ref().unwrap(), builtin::body())
            .unwrap()
            .at(FrameId(1));
        assert_eq!(sequence.params(1), truth.params);
        // Nothing of this outfit is hidden, so vertices keep their numbers.
        let posed = sequence.posed_mesh(1);
        let pairs = posed.vertices.iter().zip(&truth.clothed_in_world.vertices);
        let largest_m = pairs.map(|(a, b)| a.distance(*b)).fold(0.0, f32::max);
        // Half a step in each of three directions, and a blend of bones may stretch it a little.
        assert!(
            largest_m < 0.6 * plan.offset_step_m * 3.0_f32.sqrt(),
            "{largest_m} m"
        );
    }
}

#[test]
fn an_interrupted_run_goes_on_and_gives_the_same_files() {
    let (whole, torn) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let plan = plan();
    let expected = made(&plan, whole.path()).manifest().clone();
    let left = AtomicU32::new(3);
    let stop_soon = |_: MakeProgress| left.fetch_sub(1, Ordering::Relaxed) > 1;
    let stopped = make(&plan, &builtin::body(), torn.path(), &stop_soon).unwrap();
    assert!(stopped.is_none());
    assert!(
        Dataset::open(torn.path(), &builtin::body()).is_err(),
        "it is not complete"
    );
    assert_eq!(*made(&plan, torn.path()).manifest(), expected);
}

#[test]
fn damage_is_found_and_named() {
    let folder = tempfile::tempdir().unwrap();
    let dataset = made(&plan(), folder.path());
    let entry = &dataset.manifest().sequences[0];
    let path = folder.path().join(&entry.file);
    let mut bytes = fs::read(&path).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 0x10;
    fs::write(&path, &bytes).unwrap();
    let error = dataset.load(entry).unwrap_err().to_string();
    assert!(
        error.contains(&entry.file) && error.contains("checksum"),
        "{error}"
    );
    fs::write(&path, &bytes[..middle]).unwrap();
    let error = dataset.load(entry).unwrap_err().to_string();
    assert!(error.contains("bytes"), "{error}");
    let renamed = SequenceEntry {
        plan: SequencePlan { subject: 7, ..entry.plan.clone() },
        ..dataset.manifest().sequences[1].clone()
    };
    let error = dataset.load(&renamed).unwrap_err().to_string();
    assert!(error.contains("about itself"), "{error}");
    // Made again, as if it had never been damaged.
    assert_eq!(made(&plan(), folder.path()).manifest(), dataset.manifest());
}

#[test]
fn the_protocol_sees_a_whole_person_from_every_side() {
    let folder = tempfile::tempdir().unwrap();
    let dataset = made(&plan(), folder.path());
    let sequence = dataset.load(&dataset.manifest().sequences[0]).unwrap();
    for eighth in 0..8 {
        let yaw_rad = eighth as f32 * std::f32::consts::FRAC_PI_4;
        let (depth, world_from_camera) = sequence.protocol_depth(0, yaw_rad);
        let seen = depth
            .pixels()
            .iter()
            .filter(|&&millimetres| millimetres > 0)
            .count();
        // The paper speaks of 3 to 5 thousand points a frame.
        assert!((2000..8000).contains(&seen), "{seen} pixels");
        let pelvis = sequence.rest_joints[0] + sequence.frames[0].trans;
        let in_camera = world_from_camera.inverse() * pelvis;
        assert!((in_camera.z - 3.0).abs() < 1e-4, "{in_camera}");
    }
}

#[test]
fn no_test_person_and_no_blazer_is_ever_learned_from() {
    for preset in [
        DatasetPreset::Prior,
        DatasetPreset::PriorActions,
        DatasetPreset::CapeLike,
    ] {
        let plan = DatasetPlan::new(preset, 1);
        let of = |split| -> Vec<&SequencePlan> {
            plan.sequences
                .iter()
                .filter(|sequence| sequence.split == split)
                .collect()
        };
        let (train, test) = (of(Split::Train), of(Split::Test));
        for sequence in &train {
            assert_ne!(sequence.outfit, OutfitKind::BlazerTrousers);
            assert!(test.iter().all(|other| seed_of(other) != seed_of(sequence)));
        }
        for other in test
            .iter()
            .filter(|other| other.role == Role::Extrapolation)
        {
            let same = |sequence: &&&SequencePlan| {
                sequence.role == Role::FineTune
                    && seed_of(sequence) == seed_of(other)
                    && sequence.action == other.action
            };
            assert!(
                !test.iter().any(|sequence| same(&sequence)),
                "{}",
                other.name
            );
        }
        let mut names: Vec<&str> = plan.sequences.iter().map(|s| s.name.as_str()).collect();
        names.sort_unstable();
        names.dedup();
        assert_eq!(
            names.len(),
            plan.sequences.len(),
            "files would overwrite each other"
        );
    }
}

#[test]
fn a_prior_of_actions_sees_everybody_free_many_in_two_actions_and_most_actions_in_every_outfit() {
    let plan = DatasetPlan::new(DatasetPreset::PriorActions, 1);
    let mut seen = std::collections::BTreeSet::new();
    let people = plan.sequences.chunk_by(|a, b| seed_of(a) == seed_of(b));
    let mut count = 0;
    for person in people {
        assert_eq!(person.len(), if count < 81 { 3 } else { 1 });
        assert_eq!(person[person.len() - 1].action, "freestyle");
        count += 1;
        for sequence in person {
            assert_eq!(sequence.outfit, person[0].outfit);
            seen.insert((sequence.outfit.name(), sequence.action.as_str()));
        }
    }
    assert_eq!(count, 144);
    let all = 9 * 13;
    assert!(seen.len() > all * 9 / 10, "{} of {all}", seen.len());
}

#[test]
fn every_sensor_sees_the_surface_from_where_its_calibration_says() {
    let folder = tempfile::tempdir().unwrap();
    let dataset = made(&plan(), folder.path());
    let sequence = dataset.load(&dataset.manifest().sequences[1]).unwrap();
    let surface = ClosestPoint::from_mesh(&sequence.posed_mesh(1)).unwrap();
    let yaws_rad = [0.0, 0.8, 2.4, -1.6].into_iter().cycle();
    for (sensor, yaw_rad) in SensorPreset::ALL.into_iter().zip(yaws_rad) {
        let ideal = SensorShot { sensor, yaw_rad, noise: Noise::None, room: Room::Empty, seed: 7 };
        let (frame, calibration) = sequence.sensor_frame(1, &ideal);
        let world_from_camera = calibration.world_from_camera.unwrap();
        let mut seen = 0;
        for (pixel, &raw) in frame
            .depth
            .pixels()
            .iter()
            .enumerate()
            .filter(|(_, raw)| **raw > 0)
        {
            let (x, y) = (
                pixel as u32 % frame.depth.width(),
                pixel as u32 / frame.depth.width(),
            );
            let camera = calibration.depth.intrinsics;
            let ray = vec3(
                (x as f32 - camera.cx) / camera.fx,
                (y as f32 - camera.cy) / camera.fy,
                1.0,
            );
            let point = world_from_camera * (ray * f32::from(raw) * calibration.metres_per_unit);
            seen += 1;
            if pixel % 101 == 0 {
                let distance_m = surface.query(point).distance;
                // Half a millimetre of the sensor's units, along a ray at most 1.2 times as long as its depth.
                assert!(distance_m < 0.7e-3, "{sensor:?}: {distance_m} m");
            }
        }
        assert!(seen > 8000, "{sensor:?} sees {seen} pixels of the person");
        let noisy = SensorShot { noise: Noise::Sensor, room: Room::FloorAndWall, ..ideal };
        let (first, _) = sequence.sensor_frame(1, &noisy);
        let again = sequence.sensor_frame(1, &noisy).0;
        assert_eq!(first.depth, again.depth, "the seed decides");
        let other = SensorShot { seed: 8, ..noisy };
        assert_ne!(first.depth, sequence.sensor_frame(1, &other).0.depth);
    }
}

#[test]
fn a_frame_has_its_minimal_body_posed_and_in_star_pose() {
    let folder = tempfile::tempdir().unwrap();
    let dataset = made(&plan(), folder.path());
    let entry = &dataset.manifest().sequences[0];
    let sequence = dataset.load(entry).unwrap();
    let body = builtin::body();
    let truth = Truth::new(entry.plan.scenario.as_ref().unwrap(), builtin::body()).unwrap();
    let minimal = sequence.minimal_body(&body).unwrap();
    let frame = &sequence.frames[1];
    let posed = minimal.posed(&frame.theta, frame.trans);
    let (expected, _) = truth.minimal(FrameId(1));
    let pairs = posed.vertices.iter().zip(&expected.vertices);
    let largest_m = pairs.map(|(a, b)| a.distance(*b)).fold(0.0, f32::max);
    // The pelvis's place is a difference of two of them: rounding of numbers around 1 m.
    assert!(largest_m < 1e-6, "{largest_m} m");
    let star = minimal.star(&frame.theta);
    let expected = truth.person().minimal_canonical(&frame.theta);
    assert_eq!(star, expected);
}

#[test]
fn a_skirt_knows_where_it_came_from_and_the_manifest_says_by_how_much() {
    let (one, three) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let mut plan = plan();
    plan.sequences
        .retain(|sequence| sequence.split == Split::Test);
    plan.sequences.truncate(1);
    let sequence = &mut plan.sequences[0];
    sequence.frames = 10;
    sequence.outfit = OutfitKind::Skirt.into();
    scenario_of(sequence).outfit = OutfitKind::Skirt;
    let on_threads = |count, folder: &Path| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(count)
            .build()
            .unwrap();
        pool.install(|| made(&plan, folder).manifest().clone())
    };
    let manifest = on_threads(1, one.path());
    let facts = manifest.sequences[0].cloth.unwrap();
    let floor_cm = facts.history_floor_cm.unwrap();
    // A skirt of 60 cm swings by centimetres and is measured with the trunk, which does not.
    assert!((0.02..2.0).contains(&floor_cm), "{floor_cm} cm");
    assert!(
        facts.strained_share < 0.01 && facts.deep_share < 1e-3,
        "{facts:?}"
    );
    assert!(
        facts.strays_p90_mm > facts.strays_rms_mm && facts.strays_rms_mm > 1.0,
        "{facts:?}"
    );
    let skirt = OutfitName::from(OutfitKind::Skirt);
    let of_wearer = manifest.history_floor_cm(Split::Test, 0, skirt).unwrap();
    assert_eq!(of_wearer, floor_cm);
    assert_eq!(manifest.history_floor_cm(Split::Train, 0, skirt), None);
    assert_eq!(
        on_threads(3, three.path()),
        manifest,
        "same bits on any number of threads"
    );
}

#[test]
fn settings_are_chosen_on_people_whom_neither_training_nor_tests_meet() {
    let dev = DatasetPlan::new(DatasetPreset::Dev, 1);
    for preset in [
        DatasetPreset::Prior,
        DatasetPreset::PriorActions,
        DatasetPreset::CapeLike,
    ] {
        for other in &DatasetPlan::new(preset, 1).sequences {
            let met = dev
                .sequences
                .iter()
                .any(|ours| seed_of(ours) == seed_of(other));
            assert!(!met, "{}", other.name);
        }
    }
}

#[test]
fn a_part_of_a_data_set_is_made_and_the_rest_later_but_no_part_of_it_again() {
    let folder = tempfile::tempdir().unwrap();
    let mut part = plan();
    part.keep_only(&["train-".to_owned()]);
    assert_eq!(part.sequences.len(), 1);
    let first = made(&part, folder.path()).manifest().sequences[0].clone();
    let whole = made(&plan(), folder.path());
    assert_eq!(whole.manifest().sequences.len(), plan().sequences.len());
    assert_eq!(whole.manifest().sequences[0].sha256, first.sha256);
    let error = make(&part, &builtin::body(), folder.path(), &|_| true).unwrap_err();
    assert!(error.to_string().contains("other sequences"), "{error}");
}
