//! A data set is what was simulated, whoever makes it and however often it is interrupted.

use std::{
    fs,
    path::Path,
    sync::atomic::{AtomicU32, Ordering},
};

use effigy_capture::FrameId;
use effigy_registration::smpl::builtin;

use super::*;
use crate::{OutfitKind, Truth};

/// Two frames of each sequence, in clothes that need no simulation.
fn plan() -> DatasetPlan {
    let mut plan = DatasetPlan::new(DatasetPreset::Small, 5);
    for sequence in &mut plan.sequences {
        sequence.frames = 2;
        sequence.outfit = OutfitKind::Loose;
        sequence.scenario.outfit = OutfitKind::Loose;
    }
    plan
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
        let truth = Truth::new(&entry.plan.scenario, builtin::body())
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
    for preset in [DatasetPreset::Prior, DatasetPreset::CapeLike] {
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
            assert!(
                test.iter()
                    .all(|other| other.scenario.seed != sequence.scenario.seed)
            );
        }
        for other in test
            .iter()
            .filter(|other| other.role == Role::Extrapolation)
        {
            let same = |sequence: &&&SequencePlan| {
                sequence.role == Role::FineTune
                    && sequence.scenario.seed == other.scenario.seed
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
