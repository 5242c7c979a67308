//! What a training will cost, said before it starts.

use effigy_avatar::meta::{PriorConfig, time_one_step};

use crate::{pipeline::clock::Clock, say::say};

/// Prints the arithmetic and the time of `effigy train sdf`.
pub(super) fn say_field(config: &PriorConfig) {
    let reptile = &config.reptile;
    let inner = f64::from(reptile.outer_steps) * f64::from(reptile.inner_steps);
    say(
        config,
        (f64::from(reptile.warm_up_steps) + inner) * reptile.people as f64,
    );
}

/// Prints the arithmetic and the time of `effigy train hyper`.
pub(super) fn say_hyper(config: &PriorConfig) {
    let joint = &config.joint;
    let together =
        f64::from(joint.steps) * (joint.people_per_step * joint.frames_per_person) as f64;
    let adapt = &config.adapt;
    let adapting = f64::from(adapt.outer_steps)
        * (adapt.people.max(1) * adapt.frames) as f64
        * f64::from(adapt.inner_steps + 1);
    say(config, together + adapting);
}

/// `frames`: how often a frame's points go through the field, forwards and backwards.
fn say(config: &PriorConfig, frames: f64) {
    let field = config.network.field;
    // Value, gradient by a reverse sweep, and the backward pass through both: six products of the forward pass's size, two
    // operations a multiply-add.
    let per_frame =
        12.0 * field.parameter_count() as f64 * config.sampling.points_per_frame() as f64;
    let start = Clock::start();
    let timed = time_one_step(config);
    let secs = start.secs() / timed as f64 * frames;
    say!(
        "about {:.1} TFLOP in the field, {:.1} minutes on this machine as busy as it is now",
        frames * per_frame / 1e12,
        secs / 60.0
    );
}
