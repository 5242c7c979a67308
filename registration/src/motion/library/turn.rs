//! Turning around on the spot, step by step.

use super::{
    Foot, Moment, RestBody, Stance,
    ease::{cruise, smooth, window},
    style::Style,
};

const STEPS_PER_FOOT: usize = 8;
/// The share of its period a foot is in the air.
const SWING_SHARE: f32 = 0.42;
const LIFT_M: f32 = 0.055;

/// One full turn; feet alternate, and each lands where the body will face in the middle of its stand.
pub(super) fn turn_around(at: Moment, style: &Style, rest: &RestBody, stance: &mut Stance) {
    let x = at.share();
    stance.heading_rad = heading_rad(x);
    let going = window(x, 0.0, 1.0, 0.1);
    for side in 0..2 {
        stance.feet[side] = stepping_foot(x, side, style, rest);
    }
    let step_phase = x * STEPS_PER_FOOT as f32 * std::f32::consts::TAU;
    // Left swings in the first half of each period, so the weight is on the right then.
    stance.pelvis_shift_m.x -= 0.022 * going * (step_phase - 0.4).sin();
    stance.pelvis_shift_m.y -= 0.008 * going * (1.0 - (2.0 * step_phase).cos());
    stance.spine.y += 0.10 * going;
    stance.head.y += 0.16 * going;
    stance.spine.z += 0.02 * going * step_phase.sin();
    for (side, sign) in [(0, 1.0), (1, -1.0)] {
        let arm = &mut stance.arms[side];
        arm.flexion_rad +=
            style.amplitude * going * sign * (0.10 * (step_phase + 0.8).sin() - 0.05);
        arm.abduction_rad += 0.03 * going * (step_phase + f32::from(side as u8)).cos();
        arm.elbow_rad += 0.08 * going;
    }
}

fn heading_rad(x: f32) -> f32 {
    std::f32::consts::TAU * cruise(x, 0.12)
}

fn stepping_foot(x: f32, side: usize, style: &Style, rest: &RestBody) -> Foot {
    let periods = x * STEPS_PER_FOOT as f32 - 0.5 * side as f32;
    let step = periods.floor();
    let swing = ((periods - step) / SWING_SHARE).clamp(0.0, 1.0);
    let landed = |step: f32| style.standing_foot(side, landing_heading_rad(step, side), rest);
    let (from, to) = (landed(step - 1.0), landed(step));
    let share = smooth(swing);
    let arc = (std::f32::consts::PI * swing).sin();
    Foot {
        ball_m: from.ball_m.lerp(to.ball_m, share),
        lift_m: LIFT_M * style.amplitude * arc * arc,
        yaw_rad: from.yaw_rad + (to.yaw_rad - from.yaw_rad) * share,
        pitch_rad: 0.35 * (std::f32::consts::PI * swing.powf(0.7)).sin().powi(2),
    }
}

/// The heading a foot takes with its step; the last step always completes the turn.
fn landing_heading_rad(step: f32, side: usize) -> f32 {
    if step >= STEPS_PER_FOOT as f32 - 1.0 {
        return std::f32::consts::TAU;
    }
    if step < 0.0 {
        return 0.0;
    }
    let middle_of_stand = step + 0.5 * side as f32 + 0.5 * (1.0 + SWING_SHARE);
    heading_rad(middle_of_stand / STEPS_PER_FOOT as f32)
}
