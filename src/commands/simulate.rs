//! `effigy simulate`: a simulated sensor, recorded.

use std::{collections::BTreeMap, path::Path};

use anyhow::Context as _;
use effigy_capture::{FrameSource as _, recording::RecordingWriter};
use effigy_registration::smpl::builtin;
use effigy_sim_sensor::{Scenario, SimulatedSensor};

use super::scene::{SECONDS, scenario};
use crate::{
    cli::SimulateArgs,
    files,
    interrupt::{self, Stopped},
    progress::Progress,
    say::say,
};

/// Where a recording keeps the scenario it was made from: the truth, to be computed again.
pub(crate) const SCENARIO_KEY: &str = "effigy.scenario";

pub(crate) fn run(args: &SimulateArgs) -> anyhow::Result<()> {
    let scenario = match &args.scenario {
        Some(path) => read_scenario(path)?,
        None => scenario(&args.scene, SECONDS)?,
    };
    let frames = record(&scenario, &args.out)?;
    if interrupt::requested() {
        return Err(Stopped::short(&args.out, frames).into());
    }
    say!("{}: {frames} frames", args.out.display());
    Ok(())
}

fn read_scenario(path: &Path) -> anyhow::Result<Scenario> {
    /// A scenario has some lines.
    const MOST_BYTES: u64 = 1 << 20;
    let text = files::read_text(path, MOST_BYTES)?;
    Scenario::from_json(&text).with_context(|| path.display().to_string())
}

/// Writes what the sensor sees, with the scenario beside it; how many frames it was.
pub(crate) fn record(scenario: &Scenario, out: &Path) -> anyhow::Result<u64> {
    let text = serde_json::to_string(scenario).context("a scenario is plain data")?;
    let metadata = BTreeMap::from([(SCENARIO_KEY.to_owned(), text)]);
    let mut sensor = SimulatedSensor::new(scenario, builtin::body())?;
    let writer = RecordingWriter::create(out, sensor.calibration(), &metadata)?;
    let progress = Progress::new("simulating", sensor.frame_count());
    while !interrupt::requested() {
        let Some(frame) = sensor.next_frame()? else {
            break;
        };
        writer.push_blocking(&frame)?;
        progress.advance(frame.id.0 + 1);
    }
    progress.finish();
    Ok(writer.finish()?.frames)
}
