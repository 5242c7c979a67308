//! `effigy demo`: a simulated person through the whole chain.

use std::collections::BTreeMap;

use effigy_registration::smpl::builtin;
use effigy_sim_sensor::SimulatedSensor;

use super::{
    chain::{self, Input, Pace},
    scene::{SECONDS, scenario, truth},
    simulate::SCENARIO_KEY,
};
use crate::cli::DemoArgs;

/// Nobody watches longer.
const UNTIL_CLOSED_SECS: f32 = 3600.0;

pub(crate) fn run(args: &DemoArgs) -> anyhow::Result<()> {
    let open = |windowed: bool| {
        let seconds = if windowed { UNTIL_CLOSED_SECS } else { SECONDS };
        let scenario = scenario(&args.scene, seconds)?;
        let sensor = SimulatedSensor::new(&scenario, builtin::body())?;
        Ok(Input {
            source: Box::new(sensor),
            truth: truth(&scenario)?,
            pace: Pace::LockStep,
            metadata: BTreeMap::from([(SCENARIO_KEY.to_owned(), scenario.to_json())]),
            decided: None,
            smoothed: None,
        })
    };
    chain::run(open, &args.chain)
}
