//! What the demo and a replay share: source in, avatar and report out.

use std::{collections::BTreeMap, path::Path, sync::Arc};

use anyhow::Context as _;
use effigy_capture::{Calibration, FrameSource};
use effigy_registration::{BodyModel, SmoothConfig, smpl::builtin};
use effigy_sim_sensor::Truth;
use effigy_viewer::SnapshotSlot;

#[cfg(feature = "window")]
use crate::window;
use crate::{
    cli::ChainArgs,
    interrupt,
    machine::{Machine, peak_memory_mb},
    pipeline::{
        avatar_stage::AvatarStage,
        clock::{Clock, percentile},
        controls::Controls,
        devices::Devices,
        evaluate::evaluate,
        lock_step,
        outputs::Outputs,
        publish::Publisher,
        real_time,
        recorder::{Recorder, WhenDiskIsSlow},
        run_log::{FrameLatency, RunLog},
        schedule::Schedule,
        settings::Settings,
    },
    report::{
        DriveFigures, FineTuneFigures, FrameCounts, Latency, PreviewScores, Report, SCHEMA,
        SurfaceScores,
    },
    say::say,
};

pub(crate) struct Input {
    pub(crate) source: Box<dyn FrameSource>,
    pub(crate) truth: Option<Truth>,
    pub(crate) pace: Pace,
    /// What a recording of this run says about where it comes from.
    pub(crate) metadata: BTreeMap<String, String>,
    /// What was decided when this recording was made.
    pub(crate) decided: Option<Schedule>,
    /// How poses were smoothed then.
    pub(crate) smoothed: Option<SmoothConfig>,
}

/// Where a recording of a run keeps how its poses were smoothed, so that a replay repeats it.
pub(crate) const SMOOTH_KEY: &str = "effigy.smooth";

/// Who sets the pace.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Pace {
    /// The slowest stage: no frame is dropped.
    LockStep,
    /// The source's clock: what comes too late is dropped and counted.
    RealTime,
}

/// With a window if that is wished and possible, headless otherwise; `open` is told which.
pub(crate) fn run(
    open: impl Fn(bool) -> anyhow::Result<Input> + Sync,
    args: &ChainArgs,
) -> anyhow::Result<()> {
    #[cfg(feature = "window")]
    if !args.headless {
        let picture = args
            .screenshot
            .clone()
            .map(|path| (path, args.screenshot_after));
        let exit_after_secs = args.exit_after;
        let shown = window::show(picture, &args.out, exit_after_secs, |slot, controls| {
            // A window shows things as they happen.
            let input = Input { pace: Pace::RealTime, ..open(true)? };
            run_chain(input, args, Some(slot), &controls)
        })?;
        match shown {
            window::Shown::Closed => return Ok(()),
            window::Shown::Impossible(reason) => eprintln!("effigy: {reason}; going on headless"),
        }
    }
    run_chain(open(false)?, args, None, &Controls::none())
}

fn run_chain(
    input: Input,
    args: &ChainArgs,
    window: Option<Arc<SnapshotSlot>>,
    controls: &Controls,
) -> anyhow::Result<()> {
    let report = report_of(input, args, window, controls)?;
    say!("{report}\nwritten to {}", args.out.display());
    Ok(())
}

/// Runs the chain to its end; the report is written where `args` say, and returned.
pub(crate) fn report_of(
    mut input: Input,
    args: &ChainArgs,
    window: Option<Arc<SnapshotSlot>>,
    controls: &Controls,
) -> anyhow::Result<Report> {
    let clock = Clock::start();
    let body = body_model(args.body.as_deref())?;
    let mut settings = Settings::load(args.config.as_deref())?;
    settings.keyframes.count = args.keyframes.unwrap_or(settings.keyframes.count);
    settings.clean.segment.pick = args.pick.or(settings.clean.segment.pick);
    let smooth = *settings
        .smooth
        .get_or_insert(match (input.pace, input.smoothed) {
            (Pace::RealTime, _) => SmoothConfig::default(),
            (Pace::LockStep, then) => then.unwrap_or(SmoothConfig::Off),
        });
    let smooth = serde_json::to_string(&smooth).context("a setting is plain data")?;
    input.metadata.insert(SMOOTH_KEY.to_owned(), smooth);
    let name = input.source.name();
    let calibration = input.source.calibration().clone();
    // A window is closed when somebody closes it.
    let frame_count = input.source.frame_count().filter(|_| window.is_none());
    let schedule = match input.pace {
        Pace::LockStep => input.decided.take().unwrap_or(Schedule::AfterFrames),
        Pace::RealTime => Schedule::WhenReady,
    };
    let devices = Devices::choose(settings.wishes(), &schedule, window.as_deref())?;
    let mut outputs = Outputs::new(args, &calibration, frame_count, &body)?;
    if let Some(slot) = window {
        outputs.publish(Publisher::new(
            slot,
            name.clone(),
            &calibration,
            &body,
            clock,
        ));
    }
    if input.truth.is_some() && body.identity != builtin::body().identity {
        eprintln!("effigy: the truth is about the built-in body: nothing is compared with it");
        input.truth = None;
    }
    if let Some(path) = &args.record {
        outputs.record_to(recorder(path, &input, &calibration)?);
    }
    let depth = calibration.depth;
    let mut avatar = AvatarStage::new(
        Arc::clone(&body),
        depth,
        &settings,
        devices,
        schedule,
        clock,
    );
    let stages = (&mut avatar, &mut outputs);
    let log = match input.pace {
        Pace::LockStep => lock_step::run(&mut *input.source, &body, &settings, stages, clock)?,
        Pace::RealTime => {
            real_time::run(input.source, &body, &settings, stages, (clock, controls))?
        }
    };
    let mut report = report(name, &log);
    if interrupt::requested() {
        eprintln!("effigy: stopping; pictures and figures of what there is follow");
    }
    outputs.finish(&log, avatar.avatar(), input.truth.as_ref())?;
    evaluate(
        &mut report,
        &log,
        &body,
        (&avatar, &settings.canonicalise),
        input.truth.as_ref(),
    )?;
    report.drive = avatar.driver().map(|driver| DriveFigures {
        device: driver.device(),
        gave_up: driver.gave_up().map(str::to_owned),
    });
    report.seconds_total = clock.secs();
    report.peak_memory_mb = peak_memory_mb();
    report.write(&args.out.join("report.json"))?;
    if let Some(path) = &args.json {
        report.write(path)?;
    }
    Ok(report)
}

fn recorder(path: &Path, input: &Input, calibration: &Calibration) -> anyhow::Result<Recorder> {
    let when_slow = match input.pace {
        Pace::LockStep => WhenDiskIsSlow::Wait,
        Pace::RealTime => WhenDiskIsSlow::LeaveOut,
    };
    Recorder::create(path, calibration, &input.metadata, when_slow)
}

/// The built-in body, or a file's.
pub(crate) fn body_model(path: Option<&Path>) -> anyhow::Result<Arc<BodyModel>> {
    match path {
        Some(path) => Ok(Arc::new(BodyModel::load(path)?)),
        None => Ok(builtin::body()),
    }
}

fn report(source: String, log: &RunLog) -> Report {
    Report {
        schema: SCHEMA,
        source,
        machine: Machine::this(),
        seconds_total: 0.0,
        peak_memory_mb: None,
        frames: FrameCounts {
            delivered: log.delivered,
            tracked: log.tracked.len() as u64,
            partial: log.partial,
            lost: log.lost,
            dropped_while_fine_tuning: log.dropped_while_fine_tuning,
            dropped: log.dropped.clone(),
        },
        start_up_secs: log.start_up_secs,
        time_to_first_track_secs: log.time_to_first_track_secs(),
        tracked_fraction: log.tracked_fraction(),
        keyframes: log.keyframes.len(),
        avatars: log.jobs.len(),
        fine_tune: log.jobs.last().map(|job| FineTuneFigures {
            device: job.device.clone(),
            gave_up: job.gave_up.clone(),
            steps: job.steps,
            seconds: job.fine_tune_secs,
            loss: job.loss,
            held_out_mm: job.held_out_mm,
            map_p95_mm: job.map_p95_mm,
        }),
        drive: None,
        time_to_first_avatar_secs: log.jobs.first().map(|job| job.total_secs),
        preview: log.preview.map(|preview| PreviewScores {
            secs: preview.secs,
            steps: preview.steps,
            map_p95_mm: preview.map_p95_mm,
            scores: SurfaceScores::default(),
        }),
        latency_ms: latency(log),
        stages_ms: log.timings.summary(),
        body: None,
        avatar: None,
        avatar_tracked: None,
        bare_body: None,
        bare_body_tracked: None,
        truth: None,
    }
}

/// `None` where nobody's clock set the pace.
fn latency(log: &RunLog) -> Option<Latency> {
    let of = |wanted: &dyn Fn(&FrameLatency) -> bool| -> Vec<f32> {
        let picked = log.latencies.iter().filter(|latency| wanted(latency));
        picked.map(|latency| latency.milliseconds).collect()
    };
    let alone = of(&|latency| !latency.fine_tuning);
    let driving = of(&|latency| latency.driving && !latency.fine_tuning);
    let tuning = of(&|latency| latency.fine_tuning);
    Some(Latency {
        p50: percentile(&alone, 0.5)?,
        p95: percentile(&alone, 0.95)?,
        p95_while_fine_tuning: percentile(&tuning, 0.95),
        p50_driving: percentile(&driving, 0.5),
        p95_driving: percentile(&driving, 0.95),
    })
}
