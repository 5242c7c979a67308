//! One body being followed, and where it will be next.

use glam::{Quat, Vec3};

use crate::{
    align::Aligned,
    residual::Prediction,
    smpl::JOINT_COUNT,
    state::{BodyState, axis_angle},
};

/// One body being followed.
#[derive(Clone, Debug)]
pub(super) struct Body {
    pub(super) state: BodyState,
    pub(super) velocity: Velocity,
    pub(super) confidence: [f32; JOINT_COUNT],
    /// Sum of errors since two bodies are followed.
    pub(super) error_sum_m: f32,
}

/// Per second, smoothed over the last frames.
#[derive(Clone, Copy, Debug)]
pub(super) struct Velocity {
    moving: Vec3,
    turning: [Vec3; JOINT_COUNT],
    /// The highest speeds of late, fading: a swinging arm stops at each end, but does not hold still.
    lately_moving: f32,
    lately_turning: [f32; JOINT_COUNT],
}

impl Body {
    pub(super) fn new(aligned: &Aligned) -> Self {
        Self {
            state: aligned.state,
            velocity: Velocity::NONE,
            confidence: aligned.joint_confidence,
            error_sum_m: aligned.agreement.error_m,
        }
    }

    /// Moves on as before: wholly for what was seen, less for what was not.
    pub(super) fn predict(&self, step_secs: f32) -> Prediction {
        /// Accelerations are common; a velocity carried on in full overshoots.
        const CARRY: f32 = 0.8;
        /// A quick wave; faster is an error that must not feed itself.
        const FASTEST_RAD_PER_SEC: f32 = 8.0;
        /// Whoever moves like this does not hold still.
        const BRISK_RAD_PER_SEC: f32 = 1.0;
        const BRISK_METRES_PER_SEC: f32 = 0.25;
        /// After a longer gap the velocity is another one.
        const LONGEST_SECS: f32 = 0.07;
        let carry_secs = CARRY * step_secs.min(LONGEST_SECS);
        let mut predicted = self.state;
        predicted.trans += self.velocity.moving * carry_secs;
        for joint in 0..JOINT_COUNT {
            let turn = self.velocity.turning[joint] * (carry_secs * self.confidence[joint]);
            let turn = turn.clamp_length_max(FASTEST_RAD_PER_SEC * step_secs);
            predicted.rotations[joint] =
                (Quat::from_scaled_axis(turn) * self.state.rotations[joint]).normalize();
        }
        let stillness = |speed: f32, brisk: f32| (-(speed / brisk).powi(2)).exp();
        let Velocity { lately_moving, lately_turning, .. } = &self.velocity;
        Prediction {
            state: predicted,
            joints_still: lately_turning.map(|speed| stillness(speed, BRISK_RAD_PER_SEC)),
            trans_still: stillness(*lately_moving, BRISK_METRES_PER_SEC),
        }
    }

    /// Takes the next frame's body over.
    pub(super) fn advance(&mut self, aligned: &Aligned, step_secs: f32, velocity_share: f32) {
        self.velocity
            .learn(&self.state, &aligned.state, step_secs, velocity_share);
        self.state = aligned.state;
        self.confidence = aligned.joint_confidence;
        self.error_sum_m += aligned.agreement.error_m;
    }

    /// Jumps to another pose: that is no movement to carry on.
    pub(super) fn jump(&mut self, aligned: &Aligned) {
        self.state = aligned.state;
        self.velocity = Velocity::NONE;
    }
}

impl Velocity {
    const NONE: Self = Self {
        moving: Vec3::ZERO,
        turning: [Vec3::ZERO; JOINT_COUNT],
        lately_moving: 0.0,
        lately_turning: [0.0; JOINT_COUNT],
    };

    fn learn(&mut self, before: &BodyState, now: &BodyState, step_secs: f32, share: f32) {
        /// A speed is forgotten to a third in this time.
        const LATELY_SECS: f32 = 0.4;
        if step_secs < 1e-4 {
            return;
        }
        let faded = (-step_secs / LATELY_SECS).exp();
        let moving = (now.trans - before.trans) / step_secs;
        self.moving += (moving - self.moving) * share;
        self.lately_moving = self.moving.length().max(self.lately_moving * faded);
        for joint in 0..JOINT_COUNT {
            let turn = now.rotations[joint] * before.rotations[joint].inverse();
            let turning = axis_angle(turn) / step_secs;
            self.turning[joint] += (turning - self.turning[joint]) * share;
            let speed = self.turning[joint].length();
            self.lately_turning[joint] = speed.max(self.lately_turning[joint] * faded);
        }
    }

    /// The same movement after the world was turned.
    pub(super) fn seen_from(&self, rotation: Quat) -> Self {
        let mut turned = *self;
        turned.moving = rotation * self.moving;
        // Only the root's axes are the world's.
        turned.turning[0] = rotation * self.turning[0];
        turned
    }
}
