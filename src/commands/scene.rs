//! From what was typed about a simulated scene to the scene.

use effigy_sim_sensor::{Scenario, stranger::StrangerChoice};

use crate::cli::SceneArgs;

/// How long a simulation lasts that ends by itself.
pub(crate) const SECONDS: f32 = 20.0;

/// `seconds` is used where nothing was typed.
pub(crate) fn scenario(args: &SceneArgs, seconds: f32) -> anyhow::Result<Scenario> {
    let scenario = Scenario {
        seed: args.seed,
        sensor: args.sensor,
        motion: args.motion.clone(),
        outfit: args.outfit,
        stranger: args.character.clone().map(|path| StrangerChoice {
            path,
            clip: args.clip.clone(),
            height_m: None,
        }),
        seconds: args.seconds.unwrap_or(seconds),
        ..Scenario::default()
    };
    Ok(scenario.checked()?)
}
