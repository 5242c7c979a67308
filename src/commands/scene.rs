//! From what was typed about a simulated scene to the scene.

use effigy_sim_sensor::Scenario;

use crate::cli::SceneArgs;

pub(crate) fn scenario(args: &SceneArgs) -> anyhow::Result<Scenario> {
    let scenario = Scenario {
        seed: args.seed,
        sensor: args.sensor,
        motion: args.motion.clone(),
        outfit: args.outfit,
        seconds: args.seconds,
        ..Scenario::default()
    };
    Ok(scenario.checked()?)
}
