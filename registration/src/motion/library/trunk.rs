//! Twisting, tilting, bending, and circling the hips.

use glam::Vec3;

use super::{
    Moment, RestBody, Stance,
    arms::{blend_arm, hand_on_hip},
    ease::{smooth, window},
    style::Style,
};

const TWISTS: f32 = 3.0;
const CIRCLES: f32 = 3.0;

/// To the left and to the right, arms carried along a moment late; then tilted to both sides.
pub(super) fn twist(at: Moment, style: &Style, stance: &mut Stance) {
    let x = at.share();
    let going = window(x, 0.0, 1.0, 0.14) * style.amplitude;
    let turning = window(x, 0.02, 0.66, 0.10) * style.amplitude;
    let tilting = window(x, 0.62, 0.98, 0.10) * style.amplitude;
    let swing = (std::f32::consts::TAU * TWISTS * x / 0.66).sin();
    let late = (std::f32::consts::TAU * TWISTS * x / 0.66 - 0.5).sin();
    let tilt = (std::f32::consts::TAU * (x - 0.66) / 0.30).sin();
    stance.spine += Vec3::new(0.0, 0.95 * swing * turning, 0.55 * tilt * tilting);
    stance.pelvis_tilt += Vec3::new(0.0, 0.22 * swing * turning, 0.06 * tilt * tilting);
    stance.head.y += 0.30 * swing * turning;
    stance.pelvis_shift_m.x -= 0.03 * tilt * tilting;
    for (side, sign) in [(0, 1.0f32), (1, -1.0)] {
        let arm = &mut stance.arms[side];
        arm.abduction_rad += (0.75 + 0.10 * sign * style.asymmetry) * going;
        arm.elbow_rad += (0.75 - 0.25 * sign * late) * going;
        arm.flexion_rad += (0.20 - 0.22 * sign * late) * going;
    }
}

/// Hands on the hips, hips around in a circle, first one way, then the other.
pub(super) fn hips(at: Moment, style: &Style, rest: &RestBody, stance: &mut Stance) {
    const RADIUS: f32 = 0.085;
    let x = at.share();
    let size = window(x, 0.08, 0.92, 0.14) * style.amplitude;
    let way = 1.0 - 2.0 * smooth((x - 0.44) / 0.12);
    let (sin, cos) = (std::f32::consts::TAU * CIRCLES * x).sin_cos();
    let leg_m = rest.joints[1].y - rest.joints[7].y;
    stance.pelvis_shift_m += Vec3::new(way * sin, -0.25, 0.8 * cos) * RADIUS * leg_m * size;
    stance.pelvis_tilt += Vec3::new(-0.12 * cos, 0.05 * sin, 0.08 * way * sin) * size;
    // The shoulders stay behind.
    stance.spine += Vec3::new(-0.08 * cos, 0.0, 0.12 * way * sin) * size;
    let held = window(x, 0.0, 1.0, 0.16);
    for arm in &mut stance.arms {
        *arm = blend_arm(*arm, hand_on_hip(), held);
    }
}

/// Down to the shins, and back over the heels.
pub(super) fn bend(at: Moment, style: &Style, rest: &RestBody, stance: &mut Stance) {
    let x = at.share();
    let front = window(x, 0.04, 0.54, 0.22) * style.amplitude.min(1.0);
    let back = window(x, 0.54, 0.98, 0.19) * style.amplitude.min(1.0);
    let leg_m = rest.joints[1].y - rest.joints[7].y;
    stance.pelvis_tilt.x += 0.75 * front - 0.10 * back;
    stance.pelvis_shift_m += Vec3::new(0.0, -0.02 * front, -0.17 * front + 0.10 * back) * leg_m;
    stance.spine.x += 1.05 * front - 0.48 * back;
    stance.head.x += 0.30 * front - 0.35 * back;
    for arm in &mut stance.arms {
        // Arms hang from wherever the shoulders are.
        arm.flexion_rad += 1.55 * front + 0.10 * back;
        arm.abduction_rad -= 0.30 * front - 0.15 * back;
        *arm = blend_arm(*arm, hand_on_hip(), back);
    }
}
