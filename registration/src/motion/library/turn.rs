//! Turning around on the spot, step by step.

use glam::{Vec2, Vec3, vec2};

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

/// Once around on the ball of the left foot, the right foot at the other knee, arms in a circle.
pub(super) fn ballerina_spin(at: Moment, style: &Style, rest: &RestBody, stance: &mut Stance) {
    let x = at.share();
    let poised = window(x, 0.04, 0.98, 0.22);
    let lifted = window(x, 0.10, 0.92, 0.16);
    let heading_rad = std::f32::consts::TAU * cruise((x - 0.26) / 0.46, 0.3);
    stance.heading_rad = heading_rad;
    let (sin, cos) = heading_rad.sin_cos();
    let turned = |p: Vec2| vec2(cos * p.x + sin * p.y, cos * p.y - sin * p.x);
    let leg_m = rest.joints[1].y - rest.joints[7].y;
    let toe_out_rad = stance.feet[0].yaw_rad;
    let standing = stance.feet[0].ball_m;
    // The pelvis stays over the standing ball; in the heading's frame that turns the other way.
    let over = vec2(
        cos * standing.x - sin * standing.y,
        cos * standing.y + sin * standing.x,
    );
    stance.pelvis_shift_m += Vec3::new(over.x, 0.0, over.y) * poised * 0.92;
    stance.pelvis_shift_m.y += 0.035 * lifted;
    stance.feet[0].yaw_rad = heading_rad + toe_out_rad;
    stance.feet[0].pitch_rad += 0.38 * lifted;
    let foot = &mut stance.feet[1];
    let beside = foot.ball_m - standing;
    let at_knee = vec2(-0.12, 0.09);
    foot.ball_m = standing + turned(beside.lerp(at_knee, lifted));
    foot.lift_m += 0.42 * leg_m * lifted;
    foot.yaw_rad = heading_rad - toe_out_rad - 0.55 * lifted;
    foot.pitch_rad += 0.85 * lifted;
    stance.spine.x -= 0.05 * poised;
    // The head stays behind for a moment, then hurries ahead.
    stance.head.y += 0.30 * lifted * (std::f32::consts::PI - heading_rad).sin();
    for (arm, sign) in stance.arms.iter_mut().zip([1.0f32, -1.0]) {
        let circle = super::Arm {
            abduction_rad: 0.62 + 0.03 * sign * style.asymmetry,
            flexion_rad: 1.15 * style.amplitude.min(1.0),
            twist_rad: 0.30,
            elbow_rad: 0.95,
        };
        *arm = super::arms::blend_arm(*arm, circle, poised);
    }
}
