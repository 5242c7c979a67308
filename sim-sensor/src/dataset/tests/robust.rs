//! What the world does to files: full disks, flipped bits, missing and absurd arrays, files of earlier programs.

use std::{
    fs,
    io::{Cursor, Read as _, Write as _},
    sync::atomic::{AtomicU64, Ordering},
};

use effigy_capture::FrameId;
use effigy_registration::smpl::{BodyIdentity, JOINT_COUNT, VertexWeights, builtin};
use glam::Vec3;
use zip::{ZipArchive, ZipWriter, write::SimpleFileOptions};

use super::{made, plan, scenario_of};
use crate::dataset::{
    Dataset, DatasetPlan, Manifest, Sequence, SequenceFrame,
    archive::Packer,
    make,
    make::{Work, make_all},
    packing::{pack, unpack},
};

const BODY: BodyIdentity = BodyIdentity([7; 16]);
const STEP_M: f32 = 0.25e-3;

/// A ribbon of six vertices that swings for nine frames.
fn ribbon() -> Sequence {
    let frame = |number: u64| SequenceFrame {
        id: FrameId(number),
        theta: [Vec3::X * 0.1 * number as f32; JOINT_COUNT],
        trans: Vec3::Y,
        params_trans: Vec3::Y,
        star: (0..6)
            .map(|v| {
                Vec3::new(
                    0.1 * v as f32,
                    (0.3 * number as f32).sin(),
                    -0.05 * v as f32,
                )
            })
            .collect(),
        visible: (0..4)
            .map(|triangle| triangle as u64 != number % 4)
            .collect(),
    };
    Sequence {
        plan: plan().sequences[0].clone(),
        betas: [0.5; 10],
        rest_joints: [Vec3::Y; JOINT_COUNT],
        weights: (0..6)
            .map(|v| VertexWeights { bones: [v, 3, 0, 0], weights: [0.75, 0.25, 0.0, 0.0] })
            .collect(),
        layers: vec![0, 0, 0, 1, 1, 1],
        numbers: vec![0, 1, 5, 70_000, 70_001, 70_900],
        triangles: vec![[0, 1, 2], [1, 2, 3], [2, 3, 4], [3, 4, 5]],
        minimal: vec![Vec3::Z; 3],
        cloth: None,
        frames: (0..9).map(frame).collect(),
    }
}

/// The arrays of an archive, as files.
fn arrays(bytes: &[u8]) -> Vec<(String, Vec<u8>)> {
    let mut archive = ZipArchive::new(Cursor::new(bytes)).unwrap();
    let count = archive.len();
    let read = |index| {
        let mut entry = archive.by_index(index).unwrap();
        let mut bytes = Vec::new();
        entry.read_to_end(&mut bytes).unwrap();
        (entry.name().to_owned(), bytes)
    };
    (0..count).map(read).collect()
}

fn zipped(arrays: &[(String, Vec<u8>)]) -> Vec<u8> {
    let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
    for (name, bytes) in arrays {
        zip.start_file(name, SimpleFileOptions::default()).unwrap();
        zip.write_all(bytes).unwrap();
    }
    zip.finish().unwrap().into_inner()
}

#[test]
fn packing_keeps_everything_but_half_a_step() {
    let ribbon = ribbon();
    let again = unpack(&pack(&ribbon, BODY, STEP_M).unwrap()).unwrap();
    for (frame, expected) in again.frames.iter().zip(&ribbon.frames) {
        for (point, expected) in frame.star.iter().zip(&expected.star) {
            let off_m = (*point - *expected).abs().max_element();
            assert!(off_m <= 0.5001 * STEP_M, "{off_m} m");
        }
    }
    let mut expected = ribbon;
    for (frame, again) in expected.frames.iter_mut().zip(&again.frames) {
        frame.star.clone_from(&again.star);
    }
    for (weights, again) in expected.weights.iter_mut().zip(&again.weights) {
        let off = (weights.weights[0] - again.weights[0]).abs();
        assert!(off < 1.0 / 65535.0, "weights have 16 bits: {off}");
        *weights = *again;
    }
    assert_eq!(again, expected);
}

#[test]
fn surfaces_beyond_reason_are_not_packed() {
    for wrong in [f32::NAN, 1e9] {
        let mut ribbon = ribbon();
        ribbon.frames[3].star[2].y = wrong;
        let error = pack(&ribbon, BODY, STEP_M).unwrap_err();
        assert!(error.contains("vertex 2 of frame 3"), "{error}");
    }
}

#[test]
fn no_damage_panics_or_passes_for_an_archive() {
    let bytes = pack(&ribbon(), BODY, STEP_M).unwrap();
    for place in 0..bytes.len() {
        let mut damaged = bytes.clone();
        damaged[place] ^= 1 << (place % 8);
        // A flipped date or name of a file changes nothing; arrays carry checksums of their own.
        drop(unpack(&damaged));
        assert!(unpack(&bytes[..place]).is_err(), "cut after {place} bytes");
    }
}

#[test]
fn each_array_is_checked_before_it_is_believed() {
    let all = arrays(&pack(&ribbon(), BODY, STEP_M).unwrap());
    let absurd = b"\x93NUMPY\x01\x00\x76\x00{'descr': '|u1', 'fortran_order': False, 'shape': (4000000000, 4000000000), }";
    let mut absurd = absurd.to_vec();
    absurd.resize(128, b' ');
    let long_header = b"\x93NUMPY\x02\x00\xff\xff\xff\xff{'descr'".to_vec();
    for (number, (name, bytes)) in all.iter().enumerate() {
        let array = name.trim_end_matches(".npy");
        let mut without = all.clone();
        without.remove(number);
        // Programs of before left the body out, and an import needs nothing else to be told.
        if array != "body" {
            let error = unpack(&zipped(&without)).unwrap_err();
            assert!(error.contains(array), "without {array}: {error}");
        }
        let swapped = [
            absurd.clone(),
            long_header.clone(),
            bytes[..bytes.len() / 2].to_vec(),
            Vec::new(),
            all[(number + 3) % all.len()].1.clone(),
        ];
        for other in swapped {
            let mut damaged = all.clone();
            damaged[number].1 = other;
            drop(unpack(&zipped(&damaged)));
        }
        // Numbers that nobody wrote, in an array of the right shape.
        for pattern in [0x00, 0x7f, 0xff] {
            let mut damaged = all.clone();
            for byte in damaged[number].1.iter_mut().skip(128) {
                *byte = pattern;
            }
            drop(unpack(&zipped(&damaged)));
        }
    }
}

#[test]
fn sequences_of_the_first_schema_are_read() {
    let ribbon = ribbon();
    let flat = |vectors: &[Vec3]| -> Vec<f32> { vectors.iter().flat_map(Vec3::to_array).collect() };
    let frames = &ribbon.frames;
    let mean = vec![Vec3::ZERO; 6];
    let steps = frames.iter().flat_map(|frame| flat(&frame.star));
    let steps: Vec<i16> = steps
        .map(|metres| (metres / STEP_M).round() as i16)
        .collect();
    let plan = serde_json::to_vec(&ribbon.plan).unwrap();
    let mut zip = Packer::new();
    zip.add("plan", &[plan.len() as u64], plan).unwrap();
    zip.add("offset_step_m", &[1], [STEP_M]).unwrap();
    zip.add("betas", &[10], ribbon.betas).unwrap();
    zip.add("rest_joints", &[24, 3], flat(&ribbon.rest_joints))
        .unwrap();
    zip.add(
        "bones",
        &[6, 4],
        ribbon.weights.iter().flat_map(|w| w.bones),
    )
    .unwrap();
    zip.add(
        "weights",
        &[6, 4],
        ribbon.weights.iter().flat_map(|w| w.weights),
    )
    .unwrap();
    zip.add("layers", &[6], ribbon.layers.clone()).unwrap();
    zip.add(
        "triangles",
        &[4, 3],
        ribbon.triangles.iter().flatten().copied(),
    )
    .unwrap();
    zip.add("mean", &[6, 3], flat(&mean)).unwrap();
    zip.add("id", &[9], frames.iter().map(|frame| frame.id.0))
        .unwrap();
    zip.add(
        "theta",
        &[9, 24, 3],
        frames.iter().flat_map(|frame| flat(&frame.theta)),
    )
    .unwrap();
    zip.add(
        "trans",
        &[9, 3],
        frames.iter().flat_map(|frame| frame.trans.to_array()),
    )
    .unwrap();
    zip.add(
        "params_trans",
        &[9, 3],
        frames.iter().flat_map(|frame| frame.trans.to_array()),
    )
    .unwrap();
    let visible = frames
        .iter()
        .flat_map(|frame| &frame.visible)
        .map(|&seen| u8::from(seen));
    zip.add("visible", &[9, 4], visible).unwrap();
    zip.add("offset", &[9, 6, 3], steps).unwrap();
    let old = unpack(&zip.finish().unwrap()).unwrap();
    let new = unpack(&pack(&ribbon, BODY, STEP_M).unwrap()).unwrap();
    assert_eq!(old.frames, new.frames);
    assert_eq!(old.triangles, new.triangles);
    assert_eq!(old.numbers, [0, 1, 2, 3, 4, 5], "it has no others");
}

/// `/dev/full` says what a full disk says.
#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_is_named_and_a_second_run_goes_on() {
    let (folder, whole) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let plan = plan();
    let unfinished = folder
        .path()
        .join(format!("{}.unfinished", plan.sequences[1].name));
    std::os::unix::fs::symlink("/dev/full", &unfinished).unwrap();
    let error = make(&plan, &builtin::body(), folder.path(), &|_| true)
        .unwrap_err()
        .to_string();
    let name = &plan.sequences[1].name;
    assert!(
        error.contains(name.as_str()) && error.contains("room"),
        "{error}"
    );
    assert!(!unfinished.exists(), "half a file is of no use");
    assert!(
        Dataset::open(folder.path(), &builtin::body()).is_err(),
        "it is not complete"
    );
    let again = made(&plan, folder.path());
    assert_eq!(again.manifest(), made(&plan, whole.path()).manifest());
}

#[test]
fn a_folder_keeps_its_data_set_and_what_another_generator_made_is_made_again() {
    let folder = tempfile::tempdir().unwrap();
    let plan = plan();
    let whole = made(&plan, folder.path());
    let other = DatasetPlan { seed: plan.seed + 1, ..plan.clone() };
    let error = make(&other, &builtin::body(), folder.path(), &|_| true)
        .unwrap_err()
        .to_string();
    assert!(error.contains("another data set"), "{error}");
    assert_eq!(made(&plan, folder.path()).manifest(), whole.manifest());

    let manifest = folder.path().join("manifest.json");
    fs::write(&manifest, "{").unwrap();
    let error = make(&plan, &builtin::body(), folder.path(), &|_| true)
        .unwrap_err()
        .to_string();
    assert!(error.contains("cannot be told"), "{error}");

    let mut newer = plan.clone();
    fs::remove_file(&manifest).unwrap();
    scenario_of(&mut newer.sequences[1]).seed += 1;
    fs::remove_file(
        folder
            .path()
            .join(format!("{}.npz", newer.sequences[0].name)),
    )
    .unwrap();
    let error = make(&newer, &builtin::body(), folder.path(), &|_| true)
        .unwrap_err()
        .to_string();
    let name = &newer.sequences[1].name;
    assert!(
        error.contains(name.as_str()) && error.contains("another data set"),
        "{error}"
    );
    let files = fs::read_dir(folder.path()).unwrap().count();
    assert_eq!(
        files,
        plan.sequences.len() - 1,
        "nothing was made before it was refused"
    );
    let other_body = Work { plan: &plan, body: BODY, folder: folder.path(), go_on: &|_| true };
    let error = make_all(&other_body, &|_, _| Ok(None))
        .unwrap_err()
        .to_string();
    assert!(error.contains("another data set"), "{error}");
    scenario_of(&mut newer.sequences[1]).seed -= 1;
    made(&newer, folder.path());

    newer.sequences[0].generator += 1;
    let found = AtomicU64::new(0);
    make(&newer, &builtin::body(), folder.path(), &|now| {
        found.fetch_max(now.frames_found, Ordering::Relaxed);
        true
    })
    .unwrap();
    let others = newer.sequences[1..].iter().map(|s| u64::from(s.frames));
    assert_eq!(found.into_inner(), others.sum::<u64>());
}

#[test]
fn a_manifest_of_another_kind_is_refused_and_cannot_reach_outside_its_folder() {
    let folder = tempfile::tempdir().unwrap();
    let dataset = made(&plan(), folder.path());
    let mut entry = dataset.manifest().sequences[0].clone();
    entry.file = "../secret.npz".to_owned();
    let error = dataset.load(&entry).unwrap_err().to_string();
    assert!(error.contains("in the folder"), "{error}");
    let opened = |manifest: &Manifest| {
        let text = serde_json::to_string(manifest).unwrap();
        fs::write(folder.path().join("manifest.json"), text).unwrap();
        Dataset::open(folder.path(), &builtin::body())
            .map(|_| ())
            .map_err(|error| error.to_string())
    };
    let whole = dataset.manifest().clone();
    let error =
        opened(&Manifest { schema: "effigy.dataset/9".to_owned(), ..whole.clone() }).unwrap_err();
    assert!(error.contains("effigy.dataset/9"), "{error}");
    let error = opened(&Manifest { body: BODY, ..whole.clone() }).unwrap_err();
    assert!(error.contains("another body model"), "{error}");
    opened(&Manifest { schema: "effigy.dataset/1".to_owned(), ..whole }).unwrap();
}
