//! Punching, kicking and reaching.

use glam::Vec3;

use super::{
    Arm, Moment, RestBody, Stance,
    arms::blend_arm,
    ease::{smooth, window},
    style::Style,
};

/// Left blows start at even beats, right ones at odd beats, each with two beats to go.
const BEATS: f32 = 6.0;

/// Fists up before the chin.
const GUARD: Arm =
    Arm { abduction_rad: 0.34, flexion_rad: 0.72, twist_rad: -0.65, elbow_rad: 1.75 };
const STRAIGHT: Arm =
    Arm { abduction_rad: 0.16, flexion_rad: 1.50, twist_rad: 0.0, elbow_rad: 0.22 };

/// Left and right in turn, straight ahead, with hips and shoulders behind them.
pub(super) fn punch(at: Moment, style: &Style, stance: &mut Stance) {
    let x = at.share();
    let held = window(x, 0.0, 1.0, 0.12);
    let beat = (x - 0.12) / 0.76 * BEATS;
    let blow = |first: f32, last: f32| {
        if !(first..last).contains(&beat) {
            return 0.0;
        }
        // Out on this side's beat, back before its next.
        let phase = (beat - first).rem_euclid(2.0);
        smooth(phase / 0.85) * smooth((1.85 - phase) / 0.85)
    };
    let blows = [blow(0.0, BEATS), blow(1.0, BEATS - 1.0)];
    for (side, blow) in blows.into_iter().enumerate() {
        let arm = blend_arm(GUARD, STRAIGHT, blow * style.amplitude.min(1.0));
        stance.arms[side] = blend_arm(stance.arms[side], arm, held);
    }
    // A left fist forward turns the trunk to the right, which is negative about y.
    let turn = (blows[1] - blows[0]) * style.amplitude;
    stance.spine += Vec3::new(0.08 * held, 0.55 * turn, 0.0);
    stance.pelvis_tilt.y += 0.20 * turn;
    stance.head.y -= 0.35 * turn;
    stance.pelvis_shift_m += Vec3::new(0.02 * turn, -0.035 * held, 0.02 * (blows[0] + blows[1]));
}

/// A ball to the right foot, then one to the left.
pub(super) fn soccer_kick(at: Moment, style: &Style, rest: &RestBody, stance: &mut Stance) {
    let x = at.share();
    kick(1, (x / 0.5).clamp(0.0, 1.0), style, rest, stance);
    kick(0, ((x - 0.5) / 0.5).clamp(0.0, 1.0), style, rest, stance);
}

fn kick(side: usize, x: f32, style: &Style, rest: &RestBody, stance: &mut Stance) {
    let to_left = if side == 1 { 1.0 } else { -1.0 };
    let leaning = window(x, 0.02, 0.98, 0.26);
    let back = smooth((x - 0.14) / 0.22) * smooth((0.56 - x) / 0.18) * style.amplitude;
    let front = smooth((x - 0.40) / 0.18) * smooth((0.86 - x) / 0.24) * style.amplitude;
    let lifted = window(x, 0.12, 0.90, 0.12);
    let standing_x = stance.feet[1 - side].ball_m.x;
    stance.pelvis_shift_m.x += (standing_x - 0.02 * to_left) * 0.9 * leaning;
    stance.pelvis_shift_m.y -= 0.03 * leaning;
    stance.pelvis_tilt += Vec3::new(
        0.10 * back - 0.16 * front,
        0.18 * to_left * (front - back),
        0.0,
    );
    let leg_m = rest.joints[1].y - rest.joints[7].y;
    let foot = &mut stance.feet[side];
    foot.ball_m.y += leg_m * (0.58 * front - 0.52 * back);
    foot.ball_m.x += 0.05 * to_left * lifted;
    foot.lift_m += 0.05 * lifted + leg_m * (0.34 * front + 0.30 * back);
    foot.pitch_rad += 0.95 * back - 0.10 * front;
    stance.spine += Vec3::new(
        0.12 * leaning + 0.16 * front,
        -0.40 * to_left * (front - back),
        0.05 * to_left * leaning,
    );
    stance.head.x += 0.18 * leaning;
    // Arms balance: the one on the kicking side goes back when the foot goes forward.
    for (arm_side, sign) in [(side, -1.0f32), (1 - side, 1.0)] {
        let arm = &mut stance.arms[arm_side];
        arm.abduction_rad += 0.42 * leaning;
        arm.flexion_rad += sign * (0.75 * front - 0.45 * back);
        arm.elbow_rad += 0.30 * leaning;
    }
}

/// Up to a shelf with the right hand, on the toes; then down past the left knee with the left one.
pub(super) fn reach(at: Moment, style: &Style, rest: &RestBody, stance: &mut Stance) {
    let x = at.share();
    let up = window(x, 0.02, 0.50, 0.19) * style.amplitude.min(1.0);
    let down = window(x, 0.50, 0.98, 0.20) * style.amplitude.min(1.0);
    let leg_m = rest.joints[1].y - rest.joints[7].y;
    let shelf = Arm { abduction_rad: 2.30, flexion_rad: 0.40, twist_rad: -0.40, elbow_rad: 0.30 };
    stance.arms[1] = blend_arm(stance.arms[1], shelf, up);
    stance.arms[0].flexion_rad += 1.35 * down - 0.10 * up;
    stance.arms[0].abduction_rad -= 0.15 * down;
    stance.arms[1].flexion_rad += 0.35 * down;
    stance.arms[1].elbow_rad += 0.45 * down;
    stance.spine += Vec3::new(
        0.60 * down - 0.06 * up,
        0.20 * up - 0.30 * down,
        0.16 * down - 0.14 * up,
    );
    stance.pelvis_tilt += Vec3::new(0.45 * down, 0.08 * up - 0.12 * down, 0.0);
    stance.pelvis_shift_m += Vec3::new(
        0.0,
        0.025 * up - 0.20 * down * leg_m,
        0.02 * up - 0.12 * down * leg_m,
    );
    stance.head.x += 0.12 * down - 0.32 * up;
    for foot in &mut stance.feet {
        foot.pitch_rad += 0.22 * up;
    }
}
