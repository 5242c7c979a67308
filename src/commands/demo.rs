//! `effigy demo`: a simulated person through the whole chain.

use std::collections::BTreeMap;

use anyhow::Context as _;
use effigy_registration::smpl::builtin;
use effigy_sim_sensor::{SimulatedSensor, Truth};

use super::{
    chain::{self, Input, Pace},
    scene::scenario,
    simulate::SCENARIO_KEY,
};
use crate::cli::DemoArgs;

pub(crate) fn run(args: &DemoArgs) -> anyhow::Result<()> {
    let scenario = scenario(&args.scene)?;
    let text = serde_json::to_string(&scenario).context("a scenario is plain data")?;
    let metadata = BTreeMap::from([(SCENARIO_KEY.to_owned(), text)]);
    let open = || {
        let sensor = SimulatedSensor::new(&scenario, builtin::body())?;
        let truth = Truth::new(&scenario, builtin::body())?;
        Ok(Input {
            source: Box::new(sensor),
            truth: Some(truth),
            pace: Pace::LockStep,
            metadata: metadata.clone(),
            decided: None,
        })
    };
    chain::run(open, &args.chain)
}
