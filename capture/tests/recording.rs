//! Recordings: what is written is read back, and damage costs only what it hits.

#![expect(
    clippy::unwrap_used,
    reason = "a test that cannot set itself up has failed"
)]

use std::{
    collections::BTreeMap,
    fs,
    path::{Path, PathBuf},
    sync::Arc,
};

use effigy_capture::{
    Calibration, CameraModel, CaptureError, ColorImage, DepthImage, Distortion, Frame, FrameId,
    FrameSource as _, Intrinsics, Rigid3, SensorModel, Timestamp,
    recording::{
        ColorCodec, Played, Player, Pushed, RecordConfig, Recording, RecordingWriter, Repeat,
    },
};
use glam::{Quat, vec3};
use proptest::prelude::*;
use serde_json::json;

const SIZE: [u32; 2] = [24, 16];

fn calibration() -> Calibration {
    let [width, height] = SIZE;
    let intrinsics = Intrinsics { width, height, fx: 20.1, fy: 20.3, cx: 11.7, cy: 8.1 };
    let lens = Distortion::BrownConrady([0.1, -0.2, 1e-3, 3e-4, 0.05, 0.3, 0.02, 0.001]);
    Calibration {
        sensor_name: "test".to_owned(),
        depth: CameraModel { intrinsics, distortion: lens },
        color: Some(intrinsics.into()),
        color_from_depth: Rigid3 {
            rotation: Quat::from_rotation_y(0.01),
            translation: vec3(0.032, 0.0, 0.001),
        },
        metres_per_unit: 0.001,
        range_m: [0.25, 5.46],
        rate_hz: 30.0,
        sensor: SensorModel::TimeOfFlight { floor_m: 0.001, slope: 0.0007 },
        world_from_camera: Some(Rigid3 {
            rotation: Quat::from_rotation_x(std::f32::consts::PI),
            translation: vec3(0.0, 1.1, 2.3),
        }),
    }
}

/// Frames with gaps in their ids, jittering times and pixels that differ from frame to frame; four a second, so that a
/// chunk holds five.
fn frame(number: u64) -> Frame {
    let [width, height] = SIZE;
    let noise = |i: u32| (u64::from(i) * 2654435761 + number * 40503) as u32;
    let depth = (0..width * height).map(|i| noise(i) as u16).collect();
    let color = (0..width * height)
        .map(|i| noise(i).to_le_bytes())
        .map(|[r, g, b, _]| [r, g, b]);
    let color = ColorImage::new(width, height, color.collect()).unwrap();
    Frame {
        id: FrameId((1 << 40) + number * 3 / 2),
        timestamp: Timestamp(1_700_000_000_123_456_789 + number * 250_000_000 + number % 7),
        depth: Arc::new(DepthImage::new(width, height, depth).unwrap()),
        color: number.is_multiple_of(2).then(|| Arc::new(color)),
    }
}

fn record(path: &Path, frames: u64) {
    let metadata = BTreeMap::from([("scenario".to_owned(), "{\"seed\":7}".to_owned())]);
    let writer = RecordingWriter::create(path, &calibration(), &metadata).unwrap();
    for number in 0..frames {
        writer.push_blocking(&frame(number)).unwrap();
        if number % 40 == 39 {
            let time = frame(number).timestamp;
            writer
                .event("swap", time, &json!({ "frame": number }))
                .unwrap();
        }
    }
    let summary = writer.finish().unwrap();
    assert_eq!(summary.frames, frames);
    assert_eq!(summary.bytes, fs::metadata(path).unwrap().len());
}

fn assert_same(got: &Frame, expected: &Frame) {
    assert_eq!((got.id, got.timestamp), (expected.id, expected.timestamp));
    assert_eq!(got.depth, expected.depth);
    assert_eq!(got.color, expected.color);
}

fn play_all(player: &mut Player) -> Vec<Frame> {
    std::iter::from_fn(|| player.next_frame().unwrap()).collect()
}

fn written(dir: &tempfile::TempDir, frames: u64) -> PathBuf {
    let path = dir.path().join("test.mcap");
    record(&path, frames);
    path
}

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
fn a_player_seeks_steps_pauses_and_loops() {
    let dir = tempfile::tempdir().unwrap();
    let recording = Recording::open(&written(&dir, 12)).unwrap();
    let mut player = Player::new(recording).repeating(Repeat::Loop);
    assert!(player.seek_id(frame(7).id));
    assert_same(&player.next_frame().unwrap().unwrap(), &frame(7));
    player.seek_time(Timestamp(frame(3).timestamp.0 - 5));
    player.pause();
    assert!(matches!(player.poll().unwrap(), Played::Paused));
    player.step();
    assert!(matches!(player.poll().unwrap(), Played::Frame(got) if got.id == frame(3).id));
    assert!(matches!(player.poll().unwrap(), Played::Paused));
    player.resume();
    player.seek(11);
    for number in [11, 0, 1] {
        assert!(matches!(player.poll().unwrap(), Played::Frame(got) if got.id == frame(number).id));
    }
    assert!(!player.seek_id(FrameId(1)));
    assert_eq!(player.position(), 2);
    let mut once = Player::open(player.recording().path()).unwrap();
    once.seek(99);
    assert!(matches!(once.poll().unwrap(), Played::Ended));
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

/// Chunks as MCAP's own library sees them: where each ends, and how many frames have ended by then.
fn chunk_ends(bytes: &[u8]) -> Vec<(usize, usize)> {
    let summary = mcap::Summary::read(bytes).unwrap().unwrap();
    let depth = summary
        .channels
        .values()
        .find(|channel| channel.topic == "/depth/image")
        .unwrap()
        .id;
    let mut frames = 0;
    let ends = summary.chunk_indexes.iter().map(|index| {
        let indexes = summary.read_message_indexes(bytes, index).unwrap();
        frames += indexes
            .iter()
            .filter(|(channel, _)| channel.id == depth)
            .map(|(_, all)| all.len())
            .sum::<usize>();
        (
            (index.chunk_start_offset + index.chunk_length) as usize,
            frames,
        )
    });
    ends.collect()
}

fn assert_plays_up_to_last_whole_chunk(
    path: &Path,
    bytes: &[u8],
    ends: &[(usize, usize)],
    cut: usize,
) {
    fs::write(path, &bytes[..cut]).unwrap();
    let opened = Player::open(path);
    let Ok(mut player) = opened else {
        let error = opened.err().unwrap();
        assert!(cut < ends[0].0, "cut at {cut}: {error}");
        assert!(matches!(
            error,
            CaptureError::NoCalibration { .. } | CaptureError::NotARecording { .. }
        ));
        return;
    };
    let expected = ends
        .iter()
        .rfind(|(end, _)| *end <= cut)
        .map_or(0, |(_, frames)| *frames);
    let frames = play_all(&mut player);
    assert_eq!(frames.len(), expected, "cut at {cut}");
    for (number, got) in frames.iter().enumerate() {
        assert_same(got, &frame(number as u64));
    }
    let damage = player.recording().damage().unwrap();
    assert!(
        damage.unfinished && damage.at_byte + damage.unreadable_bytes == cut as u64,
        "{damage}"
    );
}

#[test]
fn a_recording_cut_near_every_chunk_border_plays_up_to_the_last_whole_chunk() {
    let dir = tempfile::tempdir().unwrap();
    let path = written(&dir, 30);
    let bytes = fs::read(&path).unwrap();
    let ends = chunk_ends(&bytes);
    assert!(ends.len() > 5, "{ends:?}");
    let cut_path = dir.path().join("cut.mcap");
    let near = ends
        .iter()
        .flat_map(|(end, _)| (end.saturating_sub(40)..end + 40).step_by(3));
    for cut in near.chain(0..600).chain(bytes.len() - 300..bytes.len()) {
        assert_plays_up_to_last_whole_chunk(&cut_path, &bytes, &ends, cut.min(bytes.len() - 1));
    }
}

#[test]
fn a_cut_says_how_much_is_missing() {
    let dir = tempfile::tempdir().unwrap();
    let path = written(&dir, 30);
    let bytes = fs::read(&path).unwrap();
    let ends = chunk_ends(&bytes);
    let (last, _) = ends[ends.len() - 1];
    fs::write(&path, &bytes[..last - 100]).unwrap();
    let damage = Recording::open(&path).unwrap().damage().unwrap().clone();
    assert_eq!(damage.missing_bytes, 100);
    assert_eq!(
        damage.reason,
        "the file ends inside a chunk with 0.25 s of frames"
    );
    let text = damage.to_string();
    assert!(
        text.contains("at least 100 are missing") && text.contains("never finished"),
        "{text}"
    );
}

/// Whatever happened to the bytes: every frame that comes out is one that went in, and a loss is never silent.
fn assert_nothing_wrong_comes_out(path: &Path, frames_written: usize) {
    let Ok(mut player) = Player::open(path) else {
        return;
    };
    let frames = play_all(&mut player);
    for got in &frames {
        let number = (0..200).find(|number| frame(*number).timestamp == got.timestamp);
        assert_same(got, &frame(number.expect("a time that was recorded")));
    }
    let known = player.recording().damage().is_some() || player.skipped() > 0;
    assert!(
        frames.len() == frames_written || known,
        "{} frames and no damage",
        frames.len()
    );
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 200, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn a_recording_cut_anywhere_plays_up_to_the_last_whole_chunk(cuts in prop::collection::vec(0.0..1.0, 8)) {
        let (bytes, ends) = &*SAMPLE;
        let dir = tempfile::tempdir().unwrap();
        for cut in cuts {
            let cut = (cut * bytes.len() as f64) as usize;
            assert_plays_up_to_last_whole_chunk(&dir.path().join("cut.mcap"), bytes, ends, cut);
        }
    }

    #[test]
    fn flipped_bytes_cost_frames_but_never_change_them(
        flips in prop::collection::vec((0.0..1.0, 1..=255u8), 1..4),
        finished in any::<bool>(),
    ) {
        let (bytes, ends) = &*SAMPLE;
        let mut bytes = if finished { bytes.clone() } else { bytes[..ends[ends.len() - 1].0].to_vec() };
        let length = bytes.len() as f64;
        for (place, flip) in flips {
            bytes[(place * length) as usize] ^= flip;
        }
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("flip.mcap");
        fs::write(&path, bytes).unwrap();
        assert_nothing_wrong_comes_out(&path, 30);
    }

    #[test]
    fn flips_between_the_chunks_are_survived(at in 0usize..2000, flip in 1..=255u8, finished in any::<bool>()) {
        let (bytes, ends) = &*SAMPLE;
        let mut bytes = if finished { bytes.clone() } else { bytes[..ends[ends.len() - 1].0].to_vec() };
        // The records between two chunks, and the start of the next chunk.
        let (end, _) = ends[at % (ends.len() - 1)];
        let place = (end + at / ends.len()).min(bytes.len() - 1);
        bytes[place] ^= flip;
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("flip.mcap");
        fs::write(&path, bytes).unwrap();
        assert_nothing_wrong_comes_out(&path, 30);
    }

    #[test]
    fn random_bytes_are_refused_or_empty(bytes in prop::collection::vec(any::<u8>(), 0..300), magic in any::<bool>()) {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("random.mcap");
        let magic: &[u8] = if magic { mcap::MAGIC } else { &[] };
        fs::write(&path, [magic, &bytes].concat()).unwrap();
        prop_assert!(Recording::open(&path).is_err());
    }
}

/// A recording's bytes, with its chunks' ends and frames.
type Sample = (Vec<u8>, Vec<(usize, usize)>);

static SAMPLE: std::sync::LazyLock<Sample> = std::sync::LazyLock::new(|| {
    let dir = tempfile::tempdir().unwrap();
    let bytes = fs::read(written(&dir, 30)).unwrap();
    let ends = chunk_ends(&bytes);
    (bytes, ends)
});

#[test]
fn a_recording_without_its_index_plays_all_frames() {
    let dir = tempfile::tempdir().unwrap();
    let path = written(&dir, 30);
    let mut bytes = fs::read(&path).unwrap();
    let last = bytes.len() - 1;
    bytes[last] = 0;
    fs::write(&path, bytes).unwrap();
    let mut player = Player::open(&path).unwrap();
    assert_eq!(play_all(&mut player).len(), 30);
    let damage = player.recording().damage().unwrap();
    assert_eq!(damage.reason, "the closing index is cut off or damaged");
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
