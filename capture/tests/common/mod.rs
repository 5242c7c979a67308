//! A small recording with everything in it, made and compared.

use std::{
    collections::BTreeMap,
    fs,
    path::{Path, PathBuf},
    sync::Arc,
};

use effigy_capture::{
    Calibration, CameraModel, ColorImage, DepthImage, Distortion, Frame, FrameId, FrameSource as _,
    Intrinsics, Rigid3, SensorModel, Timestamp,
    recording::{Player, RecordingWriter},
};
use glam::{Quat, vec3};
use serde_json::json;

pub(crate) const SIZE: [u32; 2] = [24, 16];

pub(crate) fn calibration() -> Calibration {
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
pub(crate) fn frame(number: u64) -> Frame {
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

pub(crate) fn record(path: &Path, frames: u64) {
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

pub(crate) fn assert_same(got: &Frame, expected: &Frame) {
    assert_eq!((got.id, got.timestamp), (expected.id, expected.timestamp));
    assert_eq!(got.depth, expected.depth);
    assert_eq!(got.color, expected.color);
}

pub(crate) fn play_all(player: &mut Player) -> Vec<Frame> {
    std::iter::from_fn(|| player.next_frame().unwrap()).collect()
}

pub(crate) fn written(dir: &tempfile::TempDir, frames: u64) -> PathBuf {
    let path = dir.path().join("test.mcap");
    record(&path, frames);
    path
}
