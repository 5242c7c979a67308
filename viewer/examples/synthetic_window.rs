//! The window on a made-up stream, to look at it without a sensor:
//! `cargo run --release -p effigy-viewer --features window --example synthetic_window -- --screenshot window.png`.

mod scene;

use std::{path::PathBuf, sync::Arc, thread, time::Duration};

use crossbeam::channel::Receiver;
use effigy_capture::{Calibration, Rigid3, SensorModel};
use effigy_registration::{RegisteredFrame, Tracking, smpl::BodyParams};
use effigy_viewer::{
    CauseCount, KeyframesView, PerformanceView, PlaybackView, Snapshot, SnapshotSlot, SourceView,
    StageTiming, TrackState, TrainingView, UiCommand, ViewerError, ViewerOptions, command_channel,
    run,
};
use scene::{CAMERA, Moment, Scene};

const FRAME_COUNT: u64 = 900;
const WANTED_KEYFRAMES: usize = 8;
/// Frames at which the made-up pipeline begins to learn, and has its first avatar.
const LEARNING_FROM: u64 = 60;
const LIVE_FROM: u64 = 90;
const STEPS: u32 = 400;

fn main() -> Result<(), ViewerError> {
    let options = options();
    let slot = Arc::new(SnapshotSlot::new());
    let (commands, wishes) = command_channel(16);
    let published = Arc::clone(&slot);
    let feeder = thread::Builder::new().name("feeder".to_owned());
    let empty = std::env::args().any(|argument| argument == "--empty");
    let feeder = feeder.spawn(move || {
        if !empty {
            feed(&published, &wishes);
        }
    });
    let feeder = feeder.expect("one more thread");
    let shown = run(slot, commands, options);
    // After an error nobody sends Quit: the process ends, and the thread with it.
    if shown.is_ok() {
        feeder.join().expect("the feeder does not panic");
    }
    shown
}

/// `--empty` shows the window before anything has arrived;
/// `--screenshot FILE [SECONDS]` takes a picture and closes the window.
fn options() -> ViewerOptions {
    let arguments: Vec<String> = std::env::args().collect();
    let Some(at) = arguments.iter().position(|a| a == "--screenshot") else {
        return ViewerOptions::default();
    };
    let path = arguments
        .get(at + 1)
        .map_or_else(|| PathBuf::from("window.png"), PathBuf::from);
    let after = arguments
        .get(at + 2)
        .and_then(|secs| secs.parse().ok())
        .unwrap_or(6.0);
    ViewerOptions {
        screenshot: Some((path, after)),
        exit_after_secs: Some(after + 2.0),
        screenshot_folder: None,
    }
}

fn feed(slot: &SnapshotSlot, wishes: &Receiver<UiCommand>) {
    let scene = Scene::new();
    let mut playback = PlaybackView { frame_count: Some(FRAME_COUNT), ..PlaybackView::default() };
    loop {
        let mut wanted = !playback.paused;
        for wish in wishes.try_iter() {
            match wish {
                UiCommand::Pause => playback.paused = true,
                UiCommand::Resume => playback.paused = false,
                UiCommand::Step => wanted = true,
                UiCommand::Seek { frame } => playback.frame = frame,
                UiCommand::Loop(_) => playback.looping = !playback.looping,
                UiCommand::Quit => return,
                other => slot.update(|s| s.message = Some(format!("asked for {other:?}").into())),
            }
        }
        if wanted {
            playback.frame = (playback.frame + 1) % FRAME_COUNT;
            let message = slot.latest().message.clone();
            let moment = scene.at(playback.frame);
            slot.publish(Snapshot { message, ..snapshot(&scene, moment, playback) });
        } else {
            slot.update(|s| s.playback = Some(playback));
        }
        thread::sleep(Duration::from_millis(33));
    }
}

fn snapshot(scene: &Scene, moment: Moment, playback: PlaybackView) -> Snapshot {
    let number = playback.frame;
    let tracking = Tracking::Tracked {
        params: BodyParams::ZERO,
        residual_rms_m: 0.006,
        joint_confidence: [1.0; 24],
    };
    let registered = RegisteredFrame {
        clean: Arc::clone(&moment.clean),
        world_from_camera: scene.world_from_camera,
        tracking,
    };
    let collected = ((number / 7) as usize).min(WANTED_KEYFRAMES);
    let hint = if number % 60 < 30 {
        "turn slowly to your left"
    } else {
        "raise your arms"
    };
    Snapshot {
        closing: false,
        source: Arc::new(SourceView {
            name: "synthetic figure".to_owned(),
            device: "CPU, 2 cores".to_owned(),
        }),
        calibration: Some(Arc::new(calibration(scene.world_from_camera))),
        playback: Some(playback),
        state: TrackState::Tracking { residual_rms_m: 0.006 },
        frame: Some(moment.frame),
        clean: Some(moment.clean),
        registered: Some(Arc::new(registered)),
        body: Some(moment.body),
        avatar: (number >= LIVE_FROM).then_some(moment.avatar),
        keyframes: Arc::new(KeyframesView {
            collected,
            wanted: WANTED_KEYFRAMES,
            hint: hint.to_owned(),
        }),
        training: (number >= LEARNING_FROM).then(|| Arc::new(training(number))),
        performance: Arc::new(performance(number)),
        message: None,
    }
}

fn training(number: u64) -> TrainingView {
    let step = ((number - LEARNING_FROM) as u32 * 3).min(STEPS);
    let curve = |from: f64, to: f64, wobble: f64| {
        let at = move |step: u32| {
            let share = f64::from(step) / 60.0;
            let value = to + (from - to) * (-share).exp() + wobble * (f64::from(step) * 1.3).sin();
            [f64::from(step), value]
        };
        (0..=step).step_by(5).map(at).collect()
    };
    TrainingView {
        step,
        steps: STEPS,
        loss: curve(0.09, 0.012, 0.002),
        held_out_mm: curve(9.5, 2.1, 0.08),
        seconds_left: Some((STEPS - step) as f32 * 0.06),
        running: step < STEPS,
        avatars_made: u32::from(number >= LIVE_FROM),
    }
}

fn performance(number: u64) -> PerformanceView {
    let sway = (number as f32 * 0.1).sin();
    let stages = [
        ("clean", 6.1),
        ("track", 11.8),
        ("drive", 7.4),
        ("publish", 0.2),
    ];
    let timing = |(name, ms): (&str, f32)| StageTiming {
        name: name.to_owned(),
        p50_ms: ms + 0.2 * sway,
        p95_ms: 1.4 * ms + 0.3 * sway,
    };
    PerformanceView {
        frames_per_sec: 29.6 + 0.3 * sway,
        latency_p50_ms: 31.0,
        latency_p95_ms: 44.0 + sway,
        stages: stages.into_iter().map(timing).collect(),
        drops: vec![CauseCount { cause: "tracking was busy".to_owned(), count: number / 100 }],
    }
}

fn calibration(world_from_camera: Rigid3) -> Calibration {
    Calibration {
        sensor_name: "synthetic".to_owned(),
        depth: CAMERA.into(),
        color: None,
        color_from_depth: Rigid3::IDENTITY,
        metres_per_unit: 0.001,
        range_m: [0.5, 4.0],
        rate_hz: 30.0,
        sensor: SensorModel::TimeOfFlight { floor_m: 0.001, slope: 0.0005 },
        world_from_camera: Some(world_from_camera),
    }
}
