//! Raising the arms, and waving.

use glam::Vec3;

use super::{
    Arm, Moment, Stance,
    ease::{cruise, smooth, window},
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

/// Both arms around in circles: forwards, then backwards.
pub(super) fn shoulder_mill(at: Moment, style: &Style, stance: &mut Stance) {
    const TURNS: f32 = 3.0;
    let x = at.share();
    let forwards = cruise((x / 0.5).min(1.0), 0.2);
    let backwards = cruise(((x - 0.5) / 0.5).max(0.0), 0.2);
    let turned = std::f32::consts::TAU * TURNS * (forwards - backwards);
    let going = window(x, 0.0, 1.0, 0.1);
    for (side, sign) in [(0, 1.0f32), (1, -1.0)] {
        let arm = &mut stance.arms[side];
        // Backwards over the top is how shoulders turn most easily.
        arm.flexion_rad -= turned;
        arm.abduction_rad += (0.10 + 0.04 * sign * style.asymmetry) * going;
        arm.elbow_rad += 0.04 * going;
    }
    let (sin, cos) = turned.sin_cos();
    stance.spine += Vec3::new(-0.05 * sin, 0.0, 0.0) * going;
    stance.pelvis_shift_m += Vec3::new(0.0, -0.006 * (1.0 - cos), 0.012 * sin) * going;
}

/// Hands at the armpits, elbows up and down.
pub(super) fn chicken_wings(at: Moment, style: &Style, stance: &mut Stance) {
    const FLAPS_PER_SEC: f32 = 1.1;
    let x = at.share();
    let held = window(x, 0.0, 1.0, 0.18);
    let flap = (std::f32::consts::TAU * FLAPS_PER_SEC * at.secs).sin() * window(x, 0.16, 0.86, 0.1);
    let wing = Arm {
        abduction_rad: 1.05 + 0.42 * flap * style.amplitude,
        flexion_rad: -0.05,
        twist_rad: 0.80,
        elbow_rad: 1.75,
    };
    for arm in &mut stance.arms {
        *arm = blend_arm(*arm, wing, held);
    }
    stance.spine.x -= 0.05 * flap;
    stance.pelvis_shift_m.y -= 0.012 * (1.0 + flap) * held;
}

/// Straight arms beat like wings, down with the knees.
pub(super) fn flying_eagle(at: Moment, style: &Style, stance: &mut Stance) {
    const BEATS_PER_SEC: f32 = 0.55;
    let x = at.share();
    let held = window(x, 0.0, 1.0, 0.16);
    let phase = std::f32::consts::TAU * BEATS_PER_SEC * at.secs;
    let beat = phase.sin() * window(x, 0.12, 0.88, 0.1);
    for (arm, sign) in stance.arms.iter_mut().zip([1.0f32, -1.0]) {
        let wing = Arm {
            abduction_rad: 1.45 + 0.62 * beat * style.amplitude + 0.03 * sign * style.asymmetry,
            flexion_rad: 0.10,
            twist_rad: 0.25 * beat,
            elbow_rad: 0.16 + 0.16 * (phase - 0.6).cos().max(0.0),
        };
        *arm = blend_arm(*arm, wing, held);
    }
    stance.pelvis_shift_m.y -= 0.035 * (1.0 - beat) * held;
    stance.spine.x += 0.06 * (1.0 - beat) * held;
    stance.head.x -= 0.08 * beat;
}

/// The hand at the hip bone, the elbow out.
pub(super) const fn hand_on_hip() -> Arm {
    Arm { abduction_rad: 0.74, flexion_rad: -0.22, twist_rad: 1.20, elbow_rad: 1.60 }
}

pub(super) fn blend_arm(from: Arm, to: Arm, share: f32) -> Arm {
    let blend = |from: f32, to: f32| from + (to - from) * share;
    Arm {
        abduction_rad: blend(from.abduction_rad, to.abduction_rad),
        flexion_rad: blend(from.flexion_rad, to.flexion_rad),
        twist_rad: blend(from.twist_rad, to.twist_rad),
        elbow_rad: blend(from.elbow_rad, to.elbow_rad),
    }
}
