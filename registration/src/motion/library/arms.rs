//! Raising the arms, and waving.

use super::{
    Arm, Moment, Stance,
    ease::{smooth, window},
    style::Style,
};

/// Straight up would be pi; shoulders rarely allow it.
const OVERHEAD_RAD: f32 = 2.72;
const WAVES_PER_SEC: f32 = 1.7;

/// To horizontal, a moment's rest, overhead, and down.
pub(super) fn raise_sideways(at: Moment, style: &Style, stance: &mut Stance) {
    for (side, sign) in [(0, 1.0f32), (1, -1.0)] {
        // Hands are never quite together.
        let x = (at.share() - 0.012 * sign * style.asymmetry * window(at.share(), 0.0, 1.0, 0.2))
            .clamp(0.0, 1.0);
        let out = smooth(x / 0.30) * smooth((1.0 - x) / 0.34);
        let up = window(x, 0.36, 0.90, 0.27);
        let arm = &mut stance.arms[side];
        let horizontal = std::f32::consts::FRAC_PI_2 + 0.04 * sign * style.asymmetry;
        arm.abduction_rad += (horizontal - arm.abduction_rad) * out
            + (OVERHEAD_RAD * style.amplitude.min(1.0) - horizontal) * up;
        arm.twist_rad -= 0.9 * up;
        arm.elbow_rad += 0.05 * out + 0.18 * up;
        arm.flexion_rad += 0.05 * out;
    }
    let up = window(at.share(), 0.36, 0.90, 0.27);
    stance.spine.x -= 0.07 * up;
    stance.head.x -= 0.10 * up;
}

pub(super) fn raise_forwards(at: Moment, style: &Style, stance: &mut Stance) {
    let x = at.share();
    let up = smooth(x / 0.42) * smooth((1.0 - x) / 0.42);
    for arm in &mut stance.arms {
        arm.flexion_rad += 2.45 * up * style.amplitude.min(1.0);
        arm.abduction_rad -= 0.22 * up;
        arm.elbow_rad += 0.10 * up;
    }
    stance.spine.x -= 0.08 * up;
    stance.head.x -= 0.08 * up;
}

/// With the right hand, beside the head.
pub(super) fn wave(at: Moment, style: &Style, stance: &mut Stance) {
    let x = at.share();
    let up = window(x, 0.0, 1.0, 0.24);
    let waving = window(x, 0.16, 0.84, 0.14) * style.amplitude;
    let swing = (std::f32::consts::TAU * WAVES_PER_SEC * at.secs).sin() * waving;
    let raised = Arm {
        abduction_rad: 1.42 + 0.06 * swing,
        flexion_rad: 0.25,
        twist_rad: -1.35,
        elbow_rad: 1.45 + 0.42 * swing,
    };
    let arm = &mut stance.arms[1];
    let blend = |from: f32, to: f32| from + (to - from) * up;
    *arm = Arm {
        abduction_rad: blend(arm.abduction_rad, raised.abduction_rad),
        flexion_rad: blend(arm.flexion_rad, raised.flexion_rad),
        twist_rad: blend(arm.twist_rad, raised.twist_rad),
        elbow_rad: blend(arm.elbow_rad, raised.elbow_rad),
    };
    stance.spine.z -= 0.05 * up;
    stance.pelvis_shift_m.x += 0.015 * up;
    stance.head.z += 0.05 * up;
}
