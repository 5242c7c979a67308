//! Damaged recordings: a cut or a flipped byte costs only what it hits, and never silently.
#![expect(
    clippy::unwrap_used,
    reason = "a test that cannot set itself up has failed"
)]

mod common;

use std::{fs, path::Path};

use common::{assert_same, frame, play_all, written};
use effigy_capture::{
    CaptureError,
    recording::{Player, Recording},
};
use proptest::prelude::*;

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
