//! `effigy replay`: a recording, a folder or a single frame through the whole chain.

use std::collections::BTreeMap;

use anyhow::Context as _;
use effigy_capture::{
    recording::{Player, Recording},
    source,
};
use effigy_registration::smpl::builtin;
use effigy_sim_sensor::{Scenario, Truth};

use super::{
    chain::{self, Input, Pace},
    simulate::SCENARIO_KEY,
};
use crate::{cli::ReplayArgs, pipeline::schedule::Schedule};

pub(crate) fn run(args: &ReplayArgs) -> anyhow::Result<()> {
    let pace = if args.realtime {
        Pace::RealTime
    } else {
        Pace::LockStep
    };
    let open = || {
        let input = open(args)?;
        Ok(Input { pace, ..input })
    };
    chain::run(open, &args.chain)
}

/// The source; of a recording, also the truth if a simulator left its scenario there, and what was decided live.
fn open(args: &ReplayArgs) -> anyhow::Result<Input> {
    let is_recording = args
        .input
        .extension()
        .is_some_and(|extension| extension == "mcap");
    if !is_recording {
        return Ok(Input {
            source: source::open(&args.input)?,
            truth: None,
            pace: Pace::LockStep,
            metadata: BTreeMap::new(),
            decided: None,
        });
    }
    let recording = Recording::open(&args.input)?;
    if let Some(damage) = recording.damage() {
        eprintln!("effigy: {}: {damage}", args.input.display());
    }
    let scenario = recording.metadata(SCENARIO_KEY);
    let truth = scenario.map(truth_of).transpose()?;
    let metadata = scenario.map(|text| (SCENARIO_KEY.to_owned(), text.to_owned()));
    let metadata = metadata.into_iter().collect();
    let decided =
        Schedule::recorded(recording.events()).with_context(|| args.input.display().to_string())?;
    Ok(Input {
        source: Box::new(Player::new(recording)),
        truth,
        pace: Pace::LockStep,
        metadata,
        decided,
    })
}

fn truth_of(scenario: &str) -> anyhow::Result<Truth> {
    let scenario: Scenario = serde_json::from_str(scenario).context(
        "the recording's scenario is from another version; its frames play without truth",
    )?;
    Ok(Truth::new(&scenario, builtin::body())?)
}
