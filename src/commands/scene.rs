//! From what was typed about a simulated scene to the scene.

use effigy_registration::smpl::builtin;
use effigy_sim_sensor::{Scenario, SimError, StrangerChoice, Truth};

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

/// The truth of a scenario; of a character from elsewhere nobody knows the true body.
pub(crate) fn truth(scenario: &Scenario) -> Result<Option<Truth>, SimError> {
    let has_true_body = scenario.stranger.is_none();
    let truth = has_true_body.then(|| Truth::new(scenario, builtin::body()));
    truth.transpose()
}
