//! `effigy replay`: a recording, a folder or a single frame through the whole chain.

use anyhow::Context as _;
use effigy_capture::{
    FrameSource,
    recording::{Player, Recording},
    source,
};
use effigy_registration::smpl::builtin;
use effigy_sim_sensor::{Scenario, Truth};

use super::{
    chain::{self, Input, Pace},
    simulate::SCENARIO_KEY,
};
use crate::cli::ReplayArgs;

pub(crate) fn run(args: &ReplayArgs) -> anyhow::Result<()> {
    let pace = if args.realtime {
        Pace::RealTime
    } else {
        Pace::LockStep
    };
    let open = || {
        let (source, truth) = open(args)?;
        Ok(Input { source, truth, pace })
    };
    chain::run(open, &args.chain)
}

/// The source, and the truth if a simulator left its scenario in the recording.
fn open(args: &ReplayArgs) -> anyhow::Result<(Box<dyn FrameSource>, Option<Truth>)> {
    let is_recording = args
        .input
        .extension()
        .is_some_and(|extension| extension == "mcap");
    if !is_recording {
        return Ok((source::open(&args.input)?, None));
    }
    let recording = Recording::open(&args.input)?;
    if let Some(damage) = recording.damage() {
        eprintln!("effigy: {}: {damage}", args.input.display());
    }
    let truth = recording.metadata(SCENARIO_KEY).map(truth_of).transpose()?;
    Ok((Box::new(Player::new(recording)), truth))
}

fn truth_of(scenario: &str) -> anyhow::Result<Truth> {
    let scenario: Scenario = serde_json::from_str(scenario).context(
        "the recording's scenario is from another version; its frames play without truth",
    )?;
    Ok(Truth::new(&scenario, builtin::body())?)
}
