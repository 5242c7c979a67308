//! `effigy demo`: a simulated person through the whole chain.

use effigy_registration::smpl::builtin;
use effigy_sim_sensor::{SimulatedSensor, Truth};

use super::{
    chain::{self, Input, Pace},
    scene::scenario,
};
use crate::cli::DemoArgs;

pub(crate) fn run(args: &DemoArgs) -> anyhow::Result<()> {
    let scenario = scenario(&args.scene)?;
    let open = || {
        let sensor = SimulatedSensor::new(&scenario, builtin::body())?;
        let truth = Truth::new(&scenario, builtin::body())?;
        Ok(Input { source: Box::new(sensor), truth: Some(truth), pace: Pace::LockStep })
    };
    chain::run(open, &args.chain)
}
