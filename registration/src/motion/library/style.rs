//! How this person, this time, does it.

use glam::{Vec2, Vec3, vec2};

use super::{Arm, Foot, RestBody, Stance};

/// Toes point outwards by this much when one stands at ease.
const TOE_OUT_RAD: f32 = 0.06;
const BREATHS_PER_SEC: f32 = 0.27;

/// Seeded variation; one for each performance.
#[derive(Clone, Copy, Debug)]
pub(super) struct Style {
    pub(super) tempo: f32,
    pub(super) amplitude: f32,
    pub(super) phase: f32,
    /// -1..1: how differently left and right move.
    pub(super) asymmetry: f32,
    arm_abduction_rad: f32,
    elbow_rad: f32,
    lean_rad: f32,
    stance_width_m: f32,
    seed: u64,
}

impl Style {
    pub(super) fn sampled(seed: u64) -> Self {
        let mut state = seed;
        let mut between = |low: f32, high: f32| low + (high - low) * next_uniform(&mut state);
        Self {
            tempo: between(0.93, 1.08),
            amplitude: between(0.88, 1.06),
            phase: between(0.0, std::f32::consts::TAU),
            asymmetry: between(-1.0, 1.0),
            arm_abduction_rad: between(0.38, 0.58),
            elbow_rad: between(0.18, 0.42),
            lean_rad: between(-0.01, 0.05),
            stance_width_m: between(0.02, 0.05),
            seed,
        }
    }

    /// A number of this performance's own from 0 to 1, by its number.
    pub(super) fn uniform(&self, number: u64) -> f32 {
        let mut state = self.seed ^ number.wrapping_mul(0xd1b5_4a32_d192_ed03);
        next_uniform(&mut state)
    }

    /// A relaxed A-pose.
    pub(super) fn relaxed(&self, rest: &RestBody) -> Stance {
        let arm = |side: f32| Arm {
            abduction_rad: self.arm_abduction_rad + 0.03 * side * self.asymmetry,
            flexion_rad: 0.04 + 0.04 * side * self.asymmetry,
            twist_rad: 0.1,
            elbow_rad: self.elbow_rad + 0.06 * side * self.asymmetry,
        };
        Stance {
            heading_rad: 0.0,
            pelvis_shift_m: Vec3::new(0.0, -0.008, 0.0),
            pelvis_tilt: Vec3::ZERO,
            feet: [0, 1].map(|side| self.standing_foot(side, 0.0, rest)),
            spine: Vec3::new(self.lean_rad, 0.0, 0.0),
            head: Vec3::new(-0.3 * self.lean_rad, 0.0, 0.0),
            arms: [arm(1.0), arm(-1.0)],
        }
    }

    /// Where a foot stands beside the pelvis when the body faces a heading.
    pub(super) fn standing_foot(&self, side: usize, heading_rad: f32, rest: &RestBody) -> Foot {
        let sign = if side == 0 { 1.0 } else { -1.0 };
        let beside = rest.joints[10 + side] - rest.joints[0];
        let aside_m = rest.joints[7 + side].x - rest.joints[0].x + sign * self.stance_width_m;
        let (sin, cos) = heading_rad.sin_cos();
        let turned = |p: Vec2| vec2(cos * p.x + sin * p.y, cos * p.y - sin * p.x);
        Foot {
            ball_m: turned(vec2(aside_m + sign * 0.02, beside.z)),
            lift_m: 0.0,
            yaw_rad: heading_rad + sign * TOE_OUT_RAD,
            pitch_rad: 0.0,
        }
    }

    /// Nobody stands like a statue.
    pub(super) fn breathe(&self, secs: f32, stance: &mut Stance) {
        let breath = (std::f32::consts::TAU * BREATHS_PER_SEC * secs + self.phase).sin();
        let sway = (0.9 * secs + self.phase).sin();
        stance.spine.x -= 0.008 * breath;
        stance.spine.z += 0.010 * sway;
        stance.pelvis_shift_m.x += 0.006 * sway;
        stance.head.y += 0.05 * (0.63 * secs + 2.0 * self.phase).sin();
        for arm in &mut stance.arms {
            arm.abduction_rad += 0.012 * breath;
            arm.flexion_rad += 0.012 * sway;
        }
    }
}

/// `SplitMix64`: small, and the same on every machine.
fn next_uniform(state: &mut u64) -> f32 {
    *state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let mut z = *state;
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((z ^ (z >> 31)) >> 40) as f32 / (1u32 << 24) as f32
}
