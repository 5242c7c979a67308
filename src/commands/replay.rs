//! `effigy replay`: a recording, a folder or a single frame through the whole chain.

use std::{collections::BTreeMap, path::Path};

use anyhow::{Context as _, bail, ensure};
use effigy_capture::{
    recording::{Player, Recording},
    source,
};
use effigy_sim_sensor::{Scenario, Truth};

use super::{
    chain::{self, Input, Pace, SMOOTH_KEY},
    scene::truth,
    simulate::SCENARIO_KEY,
};
use crate::{cli::ReplayArgs, pipeline::schedule::Schedule};

pub(crate) fn run(args: &ReplayArgs) -> anyhow::Result<()> {
    if let Some(record) = &args.chain.record {
        ensure!(
            !is_same_file(&args.input, record),
            "{}: --record would overwrite what is being replayed; choose another file",
            record.display()
        );
    }
    chain::run(|_windowed| open(args), &args.chain)
}

/// The source; of a recording, also the truth if a simulator left its scenario there, and what was decided live.
pub(crate) fn open(args: &ReplayArgs) -> anyhow::Result<Input> {
    let pace = if args.realtime {
        Pace::RealTime
    } else {
        Pace::LockStep
    };
    if !source::is_recording(&args.input) {
        return Ok(Input {
            source: source::open(&args.input)?,
            truth: None,
            pace,
            metadata: BTreeMap::new(),
            decided: None,
            smoothed: None,
        });
    }
    let recording = Recording::open(&args.input)?;
    let scenario = recording.metadata(SCENARIO_KEY);
    let truth = scenario.and_then(|scenario| truth_of(scenario, &recording));
    let metadata = scenario.map(|text| (SCENARIO_KEY.to_owned(), text.to_owned()));
    let metadata = metadata.into_iter().collect();
    let decided =
        Schedule::recorded(recording.events()).with_context(|| args.input.display().to_string())?;
    let smoothed = recording
        .metadata(SMOOTH_KEY)
        .map(serde_json::from_str)
        .transpose();
    let smoothed = smoothed.with_context(|| {
        format!(
            "{}: `{SMOOTH_KEY}` in its metadata does not say how it was smoothed; record it again",
            args.input.display()
        )
    })?;
    let source = Box::new(Player::new(recording));
    Ok(Input { source, truth, pace, metadata, decided, smoothed })
}

/// What the simulator left there, if it can be made again here.
fn truth_of(scenario: &str, recording: &Recording) -> Option<Truth> {
    let made = || {
        let scenario = Scenario::from_json(scenario)?;
        let slots = scenario.frame_slots();
        let ids = (0..recording.frame_count()).filter_map(|index| recording.frame_at(index));
        if let Some((id, _)) = ids.into_iter().find(|(id, _)| id.0 >= slots) {
            bail!("frame {} is beyond the {slots} of its scenario", id.0);
        }
        Ok(truth(&scenario)?)
    };
    made()
        .inspect_err(|error| eprintln!("effigy: nothing is compared with the truth: {error}"))
        .ok()
        .flatten()
}

fn is_same_file(a: &Path, b: &Path) -> bool {
    let canonical = |path: &Path| path.canonicalize().ok();
    canonical(a).is_some_and(|a| canonical(b) == Some(a))
}
