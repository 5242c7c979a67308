//! Walking in place and squatting.

use glam::Vec3;

use super::{
    Moment, RestBody, Stance,
    ease::{smooth, window},
    style::Style,
};

const STRIDES_PER_SEC: f32 = 0.85;
const WALK_LIFT_M: f32 = 0.15;
/// How far the pelvis goes down in a squat, as a share of the leg.
const SQUAT_DEPTH: f32 = 0.42;

pub(super) fn walk_in_place(at: Moment, style: &Style, rest: &RestBody, stance: &mut Stance) {
    let going = window(at.share(), 0.0, 1.0, 0.12);
    let strides = (STRIDES_PER_SEC * style.tempo * at.of_secs)
        .round()
        .max(1.0);
    let phase = std::f32::consts::TAU * strides * at.share();
    let size = style.amplitude * going;
    for (side, sign) in [(0, 1.0f32), (1, -1.0)] {
        let up = (sign * phase.sin()).max(0.0);
        let foot = &mut stance.feet[side];
        foot.lift_m = WALK_LIFT_M * size * up.powf(1.4) * (1.0 + 0.08 * sign * style.asymmetry);
        foot.ball_m.y -= 0.05 * size * up;
        // The heel leaves first and comes down last.
        foot.pitch_rad = 0.45 * size * up.sqrt() * smooth(up * 3.0);
        let swing = -sign * (phase - 0.15).sin();
        let arm = &mut stance.arms[side];
        arm.flexion_rad += size * (0.42 * swing + 0.05);
        arm.elbow_rad += size * (0.25 + 0.22 * swing);
        arm.abduction_rad -= 0.12 * going;
    }
    let leg_m = rest.joints[1].y - rest.joints[7].y;
    stance.pelvis_shift_m.x -= 0.030 * going * phase.sin();
    stance.pelvis_shift_m.y -= 0.016 * leg_m * size * (1.0 + (2.0 * phase).cos());
    stance.pelvis_tilt += Vec3::new(0.0, 0.07 * phase.sin(), 0.035 * phase.sin()) * size;
    stance.spine += Vec3::new(0.04, -0.16 * phase.sin(), -0.03 * phase.sin()) * size;
    stance.head.y += 0.08 * size * phase.sin();
}

pub(super) fn squat(at: Moment, style: &Style, rest: &RestBody, stance: &mut Stance) {
    // Down a little slower than up, with a short stop at the bottom.
    let x = at.share();
    let depth = smooth(x / 0.46) * smooth((1.0 - x) / 0.42);
    let leg_m = rest.joints[1].y - rest.joints[7].y;
    let size = depth * style.amplitude;
    stance.pelvis_shift_m += Vec3::new(0.0, -SQUAT_DEPTH * size, -0.24 * size) * leg_m;
    stance.pelvis_tilt.x += 0.50 * size;
    stance.spine.x += 0.28 * size;
    stance.head.x -= 0.45 * size;
    for arm in &mut stance.arms {
        arm.flexion_rad += 1.75 * size;
        arm.abduction_rad -= 0.25 * size;
        arm.elbow_rad += 0.12 * size;
    }
}

/// Some steps backwards, a stop, and the same steps forwards.
pub(super) fn walk(at: Moment, style: &Style, stance: &mut Stance) {
    const STEP_M: f32 = 0.26;
    let x = at.share();
    let [back, forth] = [
        stepping((x / 0.48).min(1.0)),
        stepping(((x - 0.52) / 0.48).max(0.0)),
    ];
    for side in 0..2 {
        let foot = &mut stance.feet[side];
        foot.ball_m.y -= STEP_M * style.amplitude * (back.placed[side] - forth.placed[side]);
        let swing = back.swing[side].max(forth.swing[side]);
        foot.lift_m += 0.07 * swing;
        foot.pitch_rad += 0.32 * swing * if x < 0.5 { 0.6 } else { 1.0 };
    }
    let middle = |steps: &Steps| 0.5 * (steps.placed[0] + steps.placed[1]);
    stance.pelvis_shift_m.z -= STEP_M * style.amplitude * (middle(&back) - middle(&forth));
    let sway = |steps: &Steps| steps.swing[1] - steps.swing[0];
    let swaying = sway(&back) + sway(&forth);
    stance.pelvis_shift_m += Vec3::new(0.028 * swaying, -0.012, 0.0);
    stance.spine.y += 0.08 * (sway(&forth) - sway(&back));
    for (arm, sign) in stance.arms.iter_mut().zip([1.0f32, -1.0]) {
        arm.flexion_rad += 0.24 * sign * (sway(&forth) - sway(&back)) * style.amplitude;
        arm.elbow_rad += 0.08;
    }
}

/// Feet in turn: how many steps each has taken, and how high it is in its swing.
struct Steps {
    placed: [f32; 2],
    swing: [f32; 2],
}

/// One step with the left, two with the right, one with the left: both end beside each other.
fn stepping(x: f32) -> Steps {
    const STEPS: [(usize, f32); 4] = [(0, 1.0), (1, 2.0), (0, 2.0), (1, 1.0)];
    let mut steps = Steps { placed: [0.0; 2], swing: [0.0; 2] };
    for (number, (side, length)) in STEPS.into_iter().enumerate() {
        let share = (x * STEPS.len() as f32 - number as f32).clamp(0.0, 1.0);
        steps.placed[side] += length * smooth(share);
        let arc = (std::f32::consts::PI * share).sin();
        steps.swing[side] = steps.swing[side].max(arc * arc);
    }
    steps
}
