//! What a user waits for: a recorded person, delivered as if live, through the whole program.

use anyhow::Context as _;
use effigy_sim_sensor::Scenario;

use super::Row;
use crate::{
    cli::{ChainArgs, ReplayArgs},
    commands::{chain, replay, simulate},
    pipeline::controls::Controls,
    report::Report,
};

/// Long enough for a turn, an avatar made beside it, and some seconds of driving it afterwards.
const SECONDS: f32 = 75.0;
const QUICK_SECONDS: f32 = 1.0;

pub(super) fn rows(quick: bool) -> anyhow::Result<Vec<Row>> {
    let folder = tempfile::tempdir().context("cannot make a temporary folder")?;
    let recording = folder.path().join("bench.mcap");
    let seconds = if quick { QUICK_SECONDS } else { SECONDS };
    let scenario = Scenario { seconds, ..Scenario::default() }.checked()?;
    simulate::record(&scenario, &recording)?;
    let args = ReplayArgs {
        input: recording,
        chain: ChainArgs::headless(&folder.path().join("out")),
        realtime: true,
    };
    let report = chain::report_of(replay::open(&args)?, &args.chain, None, &Controls::none())?;
    Ok(rows_of(&report))
}

fn rows_of(report: &Report) -> Vec<Row> {
    let mut rows = Vec::new();
    let mut add = |name: &str, value: Option<f64>, unit: &'static str| {
        rows.extend(value.map(|value| Row::new(name, value, unit)));
    };
    add("start-up to the first body", report.start_up_secs, "s");
    let latency = report.latency_ms.as_ref();
    add("latency, p50", latency.map(|of| of.p50), "ms");
    add("latency, p95", latency.map(|of| of.p95), "ms");
    add(
        "latency while driving, p50",
        latency.and_then(|of| of.p50_driving),
        "ms",
    );
    add(
        "latency while driving, p95",
        latency.and_then(|of| of.p95_driving),
        "ms",
    );
    add(
        "latency while fine-tuning, p95",
        latency.and_then(|of| of.p95_while_fine_tuning),
        "ms",
    );
    for stage in ["clean", "track", "drive"] {
        let times = report.stages_ms.get(stage);
        let stage = stage_name(stage, report);
        add(&format!("{stage}, p50"), times.map(|of| of.p50), "ms");
        add(&format!("{stage}, p95"), times.map(|of| of.p95), "ms");
    }
    let dropped: u64 = report.frames.dropped.values().sum();
    let while_tuning = report.frames.dropped_while_fine_tuning;
    let besides = dropped.saturating_sub(while_tuning);
    add("frames delivered", Some(report.frames.delivered as f64), "");
    add(
        "frames dropped while fine-tuning",
        Some(while_tuning as f64),
        "",
    );
    add("frames dropped otherwise", Some(besides as f64), "");
    let preview = report.preview.as_ref();
    add("time to the preview, live", preview.map(|of| of.secs), "s");
    add(
        "time to the first avatar, live",
        report.time_to_first_avatar_secs,
        "s",
    );
    let bare_cm = report.bare_body.and_then(|of| of.d_f_cm);
    for (name, scores) in [
        ("D_f of the preview", preview.map(|of| of.scores)),
        ("D_f of the avatar", report.avatar),
    ] {
        if let (Some(ours), Some(bare)) = (scores.and_then(|of| of.d_f_cm), bare_cm) {
            rows.push(Row::new(name, ours, "cm").against("the bare body's", bare / ours));
        }
    }
    rows
}

/// A drive on a graphics card names it.
fn stage_name(stage: &str, report: &Report) -> String {
    match &report.drive {
        Some(drive) if stage == "drive" && !drive.device.starts_with("CPU") => {
            format!("drive on {}", drive.device)
        }
        _ => stage.to_owned(),
    }
}
