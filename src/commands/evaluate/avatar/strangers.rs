//! Characters of other makers, who know nothing of our body: the whole chain follows them, makes an avatar of eight of
//! its own keyframes, and is judged by the depth of frames that the avatar did not learn from.

use std::{
    collections::BTreeMap,
    fs,
    path::{Path, PathBuf},
};

use effigy_registration::smpl::builtin;
use effigy_sim_sensor::{Scenario, SensorPreset, SimulatedSensor, StrangerChoice};

use super::{
    plan::{Keyframes, Method, Poses, Table},
    rows::{Row, Scores},
    subject::Task,
};
use crate::{
    cli::ChainArgs,
    commands::chain::{Input, Pace, report_of},
    pipeline::controls::Controls,
    report::SurfaceScores,
};

/// Seen from the repository; the tables are without strangers where the data sets are not.
const DATA: &str = "../shared/data";
const FILES: [&str; 4] = [
    "rocketbox/glb/Male_Adult_08.glb",
    "rocketbox/glb/Female_Adult_05.glb",
    "quaternius-animated/Smooth_Male_Casual.glb",
    "quaternius-animated/Smooth_Female_Casual.glb",
];
const SECONDS: f32 = 16.0;

pub(super) fn files(quick: bool) -> Vec<PathBuf> {
    let all = FILES.iter().map(|file| Path::new(DATA).join(file));
    let there = all.filter(|file| file.exists());
    there.take(if quick { 1 } else { FILES.len() }).collect()
}

pub(super) fn name(file: &Path) -> String {
    let stem = file.file_stem().unwrap_or_default();
    stem.to_string_lossy().into_owned()
}

/// Avatar and bare body of one character.
pub(super) fn rows(file: &Path, config: Option<&Path>) -> anyhow::Result<Vec<Row>> {
    let scenario = Scenario {
        sensor: SensorPreset::Azure,
        seconds: SECONDS,
        stranger: Some(StrangerChoice { path: file.to_owned(), clip: None, height_m: None }),
        ..Scenario::default()
    }
    .checked()?;
    let input = Input {
        source: Box::new(SimulatedSensor::new(&scenario, builtin::body())?),
        truth: None,
        pace: Pace::LockStep,
        metadata: BTreeMap::new(),
        decided: None,
        smoothed: None,
    };
    let name = name(file);
    let out = std::env::temp_dir().join(format!("effigy-{}-{name}", std::process::id()));
    let args = ChainArgs { config: config.map(Path::to_owned), ..ChainArgs::headless(&out) };
    let report = report_of(input, &args, None, &Controls::none());
    // Its pictures are of no use here.
    fs::remove_dir_all(&out).ok();
    let report = report?;
    let seconds = report
        .fine_tune
        .as_ref()
        .map_or(0.0, |figures| figures.seconds);
    let row = |method, scores: Option<SurfaceScores>, seconds| Row {
        table: Table::Strangers,
        method,
        data: format!("{} frames", report.keyframes),
        poses: Poses::Fitted,
        sensor: scenario.sensor.name().to_owned(),
        keyframes: Keyframes::Single,
        outfit: name.clone(),
        subject: name.clone(),
        task: Task::Interpolation,
        seed: scenario.seed,
        learned_from: report.keyframes,
        frames: report.frames.tracked as usize,
        scores: Scores {
            observed_mm: scores.and_then(|scores| scores.observed_mm),
            ..Scores::default()
        },
        seconds,
        history_floor_cm: None,
    };
    Ok(vec![
        row(Method::BareBody, report.bare_body, 0.0),
        row(Method::Effigy, report.avatar, seconds),
    ])
}
