//! What a frame of an Azure-sized depth camera costs to record and to play.
#![expect(
    clippy::unwrap_used,
    reason = "a bench that cannot set itself up has failed"
)]

use std::{collections::BTreeMap, hint::black_box, sync::Arc};

use criterion::{Criterion, criterion_group, criterion_main};
use effigy_capture::{
    Calibration, DepthImage, Frame, FrameId, Intrinsics, Rigid3, SensorModel, Timestamp,
    recording::{Recording, RecordingWriter},
};

const SIZE: [u32; 2] = [640, 576];
const FRAMES: u64 = 30;

fn calibration() -> Calibration {
    let [width, height] = SIZE;
    let camera = Intrinsics { width, height, fx: 504.0, fy: 504.0, cx: 320.0, cy: 288.0 };
    Calibration {
        sensor_name: "bench".to_owned(),
        depth: camera.into(),
        color: None,
        color_from_depth: Rigid3::IDENTITY,
        metres_per_unit: 0.001,
        range_m: [0.25, 5.5],
        rate_hz: 30.0,
        sensor: SensorModel::TimeOfFlight { floor_m: 0.001, slope: 0.0007 },
        world_from_camera: None,
    }
}

/// A round body before a wall, with a few millimetres of noise.
fn frame(number: u64) -> Frame {
    let [width, height] = SIZE;
    let mut state = number.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1;
    let mut noise = |most: u64| {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state % most) as f32
    };
    let pixels = (0..width * height).map(|index| {
        let radius = ((index % width) as f32 - 320.0).hypot((index / width) as f32 - 288.0);
        let depth = if radius < 150.0 {
            1500.0 + 0.01 * radius * radius + noise(9)
        } else {
            3000.0 + noise(25)
        };
        depth as u16
    });
    let depth = Arc::new(DepthImage::new(width, height, pixels.collect()).unwrap());
    Frame {
        id: FrameId(number),
        timestamp: Timestamp(number * 33_333_333),
        depth,
        color: None,
    }
}

fn bench(criterion: &mut Criterion) {
    let path = std::env::temp_dir().join("effigy_bench.mcap");
    let frames: Vec<Frame> = (0..FRAMES).map(frame).collect();
    let record = || {
        let writer = RecordingWriter::create(&path, &calibration(), &BTreeMap::new()).unwrap();
        for frame in &frames {
            writer.push_blocking(frame).unwrap();
        }
        writer.finish().unwrap()
    };
    criterion.bench_function("record 30 frames of 640x576", |bencher| {
        bencher.iter(record);
    });
    let mut recording = Recording::open(&path).unwrap();
    let mut index = 0;
    criterion.bench_function("play one frame of 640x576", |bencher| {
        bencher.iter(|| {
            index = (index + 1) % FRAMES as usize;
            black_box(recording.frame(index).unwrap())
        });
    });
    criterion.bench_function("open", |bencher| {
        bencher.iter(|| Recording::open(&path).unwrap());
    });
    std::fs::remove_file(&path).unwrap();
}

criterion_group!(benches, bench);
criterion_main!(benches);
