//! `effigy simulate`: a simulated sensor, recorded.

use std::collections::BTreeMap;

use anyhow::Context as _;
use effigy_capture::{FrameSource as _, recording::RecordingWriter};
use effigy_registration::smpl::builtin;
use effigy_sim_sensor::SimulatedSensor;

use super::scene::{SECONDS, scenario};
use crate::{cli::SimulateArgs, interrupt, progress::Progress, say::say};

/// Where a recording keeps the scenario it was made from: the truth, to be computed again.
pub(crate) const SCENARIO_KEY: &str = "effigy.scenario";

pub(crate) fn run(args: &SimulateArgs) -> anyhow::Result<()> {
    let scenario = scenario(&args.scene, SECONDS)?;
    let text = serde_json::to_string(&scenario).context("a scenario is plain data")?;
    let metadata = BTreeMap::from([(SCENARIO_KEY.to_owned(), text)]);
    let mut sensor = SimulatedSensor::new(&scenario, builtin::body())?;
    let writer = RecordingWriter::create(&args.out, sensor.calibration(), &metadata)?;
    let progress = Progress::new("simulating", sensor.frame_count());
    while !interrupt::requested() {
        let Some(frame) = sensor.next_frame()? else {
            break;
        };
        writer.push_blocking(&frame)?;
        progress.advance(frame.id.0 + 1);
    }
    progress.finish();
    let summary = writer.finish()?;
    say!("{}: {} frames", args.out.display(), summary.frames);
    Ok(())
}
