//! Sitting down on a chair that is not there, and getting up.

use glam::Vec3;

use super::{
    Moment, RestBody, Stance,
    ease::{smooth, window},
    style::Style,
};

/// How far the seat is below and behind the standing pelvis, as shares of the leg: thighs end up nearly level.
const SEAT_DOWN: f32 = 0.44;
const SEAT_BACK: f32 = 0.42;

pub(super) fn sit_down(at: Moment, style: &Style, rest: &RestBody, stance: &mut Stance) {
    let x = at.share();
    let seated = smooth(x / 0.36) * smooth((1.0 - x) / 0.34);
    // Weight comes forward over the feet while it goes down, and before it goes up.
    let leaning = window(x, 0.03, 0.36, 0.16) + window(x, 0.64, 0.96, 0.16);
    let leg_m = rest.joints[1].y - rest.joints[7].y;
    stance.pelvis_shift_m += Vec3::new(0.0, -SEAT_DOWN, -SEAT_BACK) * leg_m * seated;
    stance.pelvis_tilt.x += 0.42 * leaning - 0.10 * seated;
    stance.spine.x += 0.34 * leaning * style.amplitude + 0.06 * seated;
    stance.head.x -= 0.30 * leaning;
    for (arm, sign) in stance.arms.iter_mut().zip([1.0f32, -1.0]) {
        // Hands come to rest on the thighs.
        arm.flexion_rad += 0.52 * seated + 0.30 * leaning;
        arm.abduction_rad -= 0.22 * seated;
        arm.elbow_rad += (0.62 + 0.05 * sign * style.asymmetry) * seated;
        arm.twist_rad -= 0.35 * seated;
    }
}
