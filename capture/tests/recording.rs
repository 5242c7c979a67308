//! Recordings: what is written is read back, and every refusal says why.
#![expect(
    clippy::unwrap_used,
    reason = "a test that cannot set itself up has failed"
)]

mod common;

use std::{collections::BTreeMap, fs, path::Path, sync::Arc};

use common::{SIZE, assert_same, calibration, frame, play_all, record, written};
use effigy_capture::{
    Calibration, DepthImage, Frame, FrameSource as _,
    recording::{ColorCodec, Player, Pushed, RecordConfig, Recording, RecordingWriter, Repeat},
};
use serde_json::json;

#[test]
fn frames_ids_times_calibration_metadata_and_events_survive_exactly() {
    let dir = tempfile::tempdir().unwrap();
    let mut recording = Recording::open(&written(&dir, 100)).unwrap();
    assert_eq!(recording.damage(), None);
    assert_eq!(recording.verify().unwrap(), None);
    assert_eq!(*recording.calibration(), calibration());
    assert_eq!(recording.metadata("scenario"), Some("{\"seed\":7}"));
    assert_eq!(recording.frame_count(), 100);
    assert_eq!(recording.events().len(), 2);
    assert_eq!(recording.events()[1].value, json!({ "frame": 79 }));
    assert_eq!(recording.events()[1].timestamp, frame(79).timestamp);
    for number in 0..100 {
        assert_same(&recording.frame(number as usize).unwrap(), &frame(number));
    }
}

#[test]
fn the_same_frames_make_the_same_bytes() {
    let dir = tempfile::tempdir().unwrap();
    let (a, b) = (dir.path().join("a.mcap"), dir.path().join("b.mcap"));
    record(&a, 40);
    record(&b, 40);
    assert_eq!(fs::read(a).unwrap(), fs::read(b).unwrap());
}

#[test]
fn a_player_seeks_and_loops() {
    let dir = tempfile::tempdir().unwrap();
    let recording = Recording::open(&written(&dir, 12)).unwrap();
    let mut player = Player::new(recording);
    player.repeat(Repeat::Loop);
    player.seek(11);
    for number in [11, 0, 1] {
        assert_same(&player.next_frame().unwrap().unwrap(), &frame(number));
    }
    assert_eq!(player.position(), 2);
    player.repeat(Repeat::Once);
    player.seek(99);
    assert!(player.next_frame().unwrap().is_none());
}

#[test]
fn an_empty_recording_opens_and_a_missing_frame_is_named() {
    let dir = tempfile::tempdir().unwrap();
    let mut recording = Recording::open(&written(&dir, 0)).unwrap();
    assert_eq!(
        (recording.frame_count(), recording.duration_secs()),
        (0, 0.0)
    );
    let message = recording.frame(3).unwrap_err().to_string();
    assert!(
        message.contains("has 0 frames, there is none with index 3"),
        "{message}"
    );
}

#[test]
fn jpeg_colour_leaves_depth_exact() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("jpeg.mcap");
    let color = ColorCodec::Jpeg { quality_percent: 90 };
    let config = RecordConfig { color, ..RecordConfig::default() };
    let writer =
        RecordingWriter::create_with(&path, &calibration(), &BTreeMap::new(), config).unwrap();
    writer.push_blocking(&frame(0)).unwrap();
    writer.finish().unwrap();
    let got = Recording::open(&path).unwrap().frame(0).unwrap();
    assert_eq!(got.depth, frame(0).depth);
    assert_eq!(got.color.unwrap().width(), SIZE[0]);
}

#[test]
fn a_full_queue_drops_and_counts_and_never_waits() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("live.mcap");
    let config = RecordConfig { queue_frames: 1, ..RecordConfig::default() };
    let writer =
        RecordingWriter::create_with(&path, &calibration(), &BTreeMap::new(), config).unwrap();
    let pushed: Vec<Pushed> = (0..300)
        .map(|number| writer.push(&frame(number)).unwrap())
        .collect();
    let queued = pushed
        .iter()
        .filter(|pushed| **pushed == Pushed::Queued)
        .count() as u64;
    let summary = writer.finish().unwrap();
    assert_eq!(
        (summary.frames, summary.dropped.frames_queue_full),
        (queued, 300 - queued)
    );
    assert_eq!(Recording::open(&path).unwrap().frame_count() as u64, queued);
}

#[test]
fn frames_of_another_size_are_refused() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("size.mcap");
    let writer = RecordingWriter::create(&path, &calibration(), &BTreeMap::new()).unwrap();
    let depth = Arc::new(DepthImage::new(3, 2, vec![0; 6]).unwrap());
    let small = Frame { depth, color: None, ..frame(0) };
    let message = writer.push(&small).unwrap_err().to_string();
    assert!(
        message.contains("3x2") && message.contains("24x16"),
        "{message}"
    );
}

#[test]
fn unwritable_places_and_nonsense_calibrations_are_refused_at_once() {
    let nowhere = Path::new("/nonexistent/folder/x.mcap");
    let error = RecordingWriter::create(nowhere, &calibration(), &BTreeMap::new())
        .err()
        .unwrap();
    assert!(
        error
            .to_string()
            .contains("cannot create /nonexistent/folder/x.mcap"),
        "{error}"
    );
    let broken = Calibration { metres_per_unit: f32::NAN, ..calibration() };
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("nan.mcap");
    let error = RecordingWriter::create(&path, &broken, &BTreeMap::new())
        .err()
        .unwrap();
    assert!(
        error.to_string().contains("metres_per_unit is NaN"),
        "{error}"
    );
    assert!(!path.exists());
}

#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_is_reported_and_nobody_waits_for_the_dead_thread() {
    let full = Path::new("/dev/full");
    let error = RecordingWriter::create(full, &calibration(), &BTreeMap::new())
        .err()
        .unwrap();
    assert!(error.to_string().contains("the disk is full"), "{error}");
}

#[test]
fn recordings_that_other_tools_compressed_or_cut_up_play_the_same() {
    for (compression, chunk_bytes) in [
        (Some(mcap::Compression::Zstd), 1 << 20),
        (Some(mcap::Compression::Lz4), 3000),
        (None, 500),
    ] {
        let dir = tempfile::tempdir().unwrap();
        let path = written(&dir, 30);
        let bytes = fs::read(&path).unwrap();
        let summary = mcap::Summary::read(&bytes).unwrap().unwrap();
        let out = dir.path().join("rewritten.mcap");
        let options = mcap::WriteOptions::new()
            .compression(compression)
            .chunk_size(Some(chunk_bytes));
        let mut writer = options.create(fs::File::create(&out).unwrap()).unwrap();
        writer
            .write_metadata(&mcap::read::metadata(&bytes, &summary.metadata_indexes[0]).unwrap())
            .unwrap();
        for message in mcap::MessageStream::new(&bytes).unwrap() {
            writer.write(&message.unwrap()).unwrap();
        }
        writer.finish().unwrap();
        let mut player = Player::open(&out).unwrap();
        assert_eq!(player.recording().damage(), None);
        let frames = play_all(&mut player);
        assert_eq!(frames.len(), 30);
        for (number, got) in frames.iter().enumerate() {
            assert_same(got, &frame(number as u64));
        }
    }
}

#[test]
fn an_mcap_file_of_somebody_else_is_named_as_such() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("other.mcap");
    let mut writer = mcap::Writer::new(fs::File::create(&path).unwrap()).unwrap();
    writer.finish().unwrap();
    drop(writer);
    let message = Recording::open(&path).err().unwrap().to_string();
    assert!(
        message.contains("effigy.recording") && message.contains("other.mcap"),
        "{message}"
    );
}

#[test]
fn info_counts_frames_events_and_damage() {
    let dir = tempfile::tempdir().unwrap();
    let path = written(&dir, 90);
    let info = effigy_capture::recording::info(&path).unwrap();
    assert_eq!(
        (info.frames, info.events["swap"], info.depth_px),
        (90, 2, SIZE)
    );
    approx::assert_abs_diff_eq!(info.rate_hz, 4.0, epsilon = 1e-3);
    let mut bytes = fs::read(&path).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    fs::write(&path, bytes).unwrap();
    let damage = effigy_capture::recording::info(&path)
        .unwrap()
        .damage
        .unwrap();
    assert_eq!(damage.broken_chunks, 1);
}
