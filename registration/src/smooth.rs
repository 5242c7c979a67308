//! Takes the tremble out of a tracked body: a stage of its own after tracking, adjustable, and nothing when off.
//!
//! The One Euro filter (Casiez, Roussel and Vogel 2012) on each joint's rotation and on `trans`: a low-pass whose
//! cutoff rises with speed, and with how quiet the sensor is. A slow movement lags by about `1 / (2 pi cutoff)`: 0.2 s
//! at the 0.8 Hz of a noisy sensor, which nobody sees on somebody who stands still; [`OneEuroConfig::lag_secs`] tells it
//! for any speed.
//!
//! Where a joint trembles, those after it in the chain make up for it: a wrist is tracked better than the angles that
//! lead to it. If one lagged behind the others it would spoil that, so joints of a chain are let go together.

use effigy_capture::Timestamp;
use effigy_fusion::CleanFrame;
use glam::{Quat, Vec3};
use serde::{Deserialize, Serialize};

use crate::{
    observe::face_on_m,
    registered::RegisteredFrame,
    smpl::{BodyParams, JOINT_COUNT, PARENTS},
    state::axis_angle,
};

/// How a track is smoothed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SmoothConfig {
    /// Frames pass as they are, to the last bit, without delay.
    Off,
    OneEuro(OneEuroConfig),
}

/// A cutoff that rises with speed, for rotations (radians) and for `trans` (metres).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct OneEuroConfig {
    /// Depth noise that the cutoff at rest and the trembles are meant for. A quieter sensor's tracks tremble less and are
    /// believed more: in proportion the cutoff is higher and the trembles are smaller, by 8 times at most.
    pub noisy_m: f32,
    /// Of a body at rest.
    pub rest_cutoff_hz: f32,
    /// How much the cutoff rises with each radian a second beyond the tremble.
    pub hz_per_rad_per_sec: f32,
    /// The same with each metre a second.
    pub hz_per_metre_per_sec: f32,
    /// Apparent speeds below these are tremble.
    pub tremble_rad_per_sec: f32,
    pub tremble_metres_per_sec: f32,
    /// Speeds are themselves smoothed with this cutoff.
    pub speed_cutoff_hz: f32,
}

impl Default for SmoothConfig {
    fn default() -> Self {
        Self::OneEuro(OneEuroConfig::default())
    }
}

impl Default for OneEuroConfig {
    fn default() -> Self {
        Self {
            noisy_m: 0.02,
            rest_cutoff_hz: 0.8,
            hz_per_rad_per_sec: 6.0,
            hz_per_metre_per_sec: 30.0,
            tremble_rad_per_sec: 0.4,
            tremble_metres_per_sec: 0.04,
            speed_cutoff_hz: 1.5,
        }
    }
}

impl OneEuroConfig {
    /// How far a joint that turns steadily lags behind, seen with such depth noise.
    pub fn lag_secs(&self, rad_per_sec: f32, noise_m: f32) -> f32 {
        time_constant_secs(self.seen_with(noise_m).rotation_cutoff_hz(rad_per_sec))
    }

    /// The same, its cutoff and trembles as such depth noise asks for.
    fn seen_with(&self, noise_m: f32) -> Self {
        let share = (noise_m / self.noisy_m.max(1e-6)).clamp(QUIETEST, 1.0);
        Self {
            rest_cutoff_hz: self.rest_cutoff_hz / share,
            tremble_rad_per_sec: self.tremble_rad_per_sec * share,
            tremble_metres_per_sec: self.tremble_metres_per_sec * share,
            ..*self
        }
    }

    fn rotation_cutoff_hz(&self, rad_per_sec: f32) -> f32 {
        let beyond = (rad_per_sec - self.tremble_rad_per_sec).max(0.0);
        self.rest_cutoff_hz + self.hz_per_rad_per_sec * beyond
    }

    fn trans_cutoff_hz(&self, metres_per_sec: f32) -> f32 {
        let beyond = (metres_per_sec - self.tremble_metres_per_sec).max(0.0);
        self.rest_cutoff_hz + self.hz_per_metre_per_sec * beyond
    }

    /// Each joint's cutoff by how fast it and those before and after it turn.
    fn rotation_cutoffs_hz(&self, turning: &[Vec3; JOINT_COUNT]) -> [f32; JOINT_COUNT] {
        let mut cutoffs_hz = turning.map(|turning| self.rotation_cutoff_hz(turning.length()));
        // Parents come before their children.
        for joint in (1..JOINT_COUNT).rev() {
            let of_child = UP_THE_CHAIN * cutoffs_hz[joint];
            let parent = &mut cutoffs_hz[PARENTS[joint]];
            *parent = parent.max(of_child);
        }
        for joint in 1..JOINT_COUNT {
            cutoffs_hz[joint] = cutoffs_hz[joint].max(cutoffs_hz[PARENTS[joint]]);
        }
        cutoffs_hz
    }
}

/// Smooths one source's tracks, frame after frame.
#[derive(Clone, Debug)]
pub struct Smoother {
    config: SmoothConfig,
    memory: Option<Memory>,
}

#[derive(Clone, Debug)]
struct Memory {
    timestamp: Timestamp,
    /// What came in last, and what went out.
    seen: Body,
    smooth: Body,
    /// Smoothed velocities.
    turning: [Vec3; JOINT_COUNT],
    moving: Vec3,
}

#[derive(Clone, Copy, Debug)]
struct Body {
    rotations: [Quat; JOINT_COUNT],
    trans: Vec3,
}

/// After a longer gap the body is somewhere else.
const LONGEST_GAP_SECS: f32 = 0.3;
/// Quieter than this share of a noisy sensor's noise makes no difference.
const QUIETEST: f32 = 1.0 / 8.0;
/// What a joint's cutoff is at least, by that of the next one in its chain.
const UP_THE_CHAIN: f32 = 0.5;
/// A root that jumps farther between two frames was found anew.
const JUMP_M: f32 = 0.25;

impl Smoother {
    pub fn new(config: SmoothConfig) -> Self {
        Self { config, memory: None }
    }

    /// A frame's parameters, smoothed; after a frame without a body it starts anew.
    pub fn params(&mut self, frame: &RegisteredFrame) -> Option<BodyParams> {
        let SmoothConfig::OneEuro(config) = self.config else {
            return frame.params().copied();
        };
        let memory = self.memory.take();
        let mut params = *frame.params()?;
        let config =
            depth_noise_m(&frame.clean).map_or(config, |noise_m| config.seen_with(noise_m));
        let memory = Memory::after(memory, &Body::of(&params), frame.clean.timestamp, &config);
        memory.smooth.write(&mut params);
        self.memory = Some(memory);
        Some(params)
    }
}

impl Memory {
    fn after(
        before: Option<Self>,
        seen: &Body,
        timestamp: Timestamp,
        config: &OneEuroConfig,
    ) -> Self {
        let fresh = Self {
            timestamp,
            seen: *seen,
            smooth: *seen,
            turning: [Vec3::ZERO; JOINT_COUNT],
            moving: Vec3::ZERO,
        };
        let Some(before) = before else {
            return fresh;
        };
        let step_secs = (timestamp - before.timestamp) as f32;
        let jumped = seen.trans.distance(before.seen.trans) > JUMP_M;
        if !(1e-4..LONGEST_GAP_SECS).contains(&step_secs) || jumped {
            return fresh;
        }
        before.advanced(seen, timestamp, config)
    }

    fn advanced(mut self, seen: &Body, timestamp: Timestamp, config: &OneEuroConfig) -> Self {
        let step_secs = (timestamp - self.timestamp) as f32;
        let speed_share = share(config.speed_cutoff_hz, step_secs);
        for joint in 0..JOINT_COUNT {
            let velocity = turn(self.seen.rotations[joint], seen.rotations[joint]) / step_secs;
            let turning = &mut self.turning[joint];
            *turning += (velocity - *turning) * speed_share;
        }
        let cutoffs_hz = config.rotation_cutoffs_hz(&self.turning);
        let joints = self.smooth.rotations.iter_mut().zip(&seen.rotations);
        for ((smooth, seen), cutoff_hz) in joints.zip(cutoffs_hz) {
            let ahead = turn(*smooth, *seen) * share(cutoff_hz, step_secs);
            *smooth = (Quat::from_scaled_axis(ahead) * *smooth).normalize();
        }
        let velocity = (seen.trans - self.seen.trans) / step_secs;
        self.moving += (velocity - self.moving) * speed_share;
        let cutoff_hz = config.trans_cutoff_hz(self.moving.length());
        self.smooth.trans += (seen.trans - self.smooth.trans) * share(cutoff_hz, step_secs);
        self.seen = *seen;
        self.timestamp = timestamp;
        self
    }
}

impl Body {
    fn of(params: &BodyParams) -> Self {
        Self { rotations: params.theta.map(Quat::from_scaled_axis), trans: params.trans }
    }

    fn write(&self, params: &mut BodyParams) {
        params.theta = self.rotations.map(axis_angle);
        params.trans = self.trans;
    }
}

/// Standard deviation of the person's depth where it is seen face on; `None` where nobody is.
fn depth_noise_m(clean: &CleanFrame) -> Option<f32> {
    /// Neighbours are alike.
    const EVERY: usize = 17;
    let person = clean.person.iter().zip(&clean.sigma_m).step_by(EVERY);
    let sigmas_m = person.filter_map(|(&person, &sigma_m)| person.then_some(sigma_m));
    face_on_m(sigmas_m.filter(|sigma_m| sigma_m.is_finite()))
}

/// The rotation vector from one rotation to another, in the parent's axes.
fn turn(from: Quat, to: Quat) -> Vec3 {
    axis_angle((to * from.inverse()).normalize())
}

/// How much of a difference a first-order low-pass takes up in a step.
fn share(cutoff_hz: f32, step_secs: f32) -> f32 {
    step_secs / (step_secs + time_constant_secs(cutoff_hz))
}

fn time_constant_secs(cutoff_hz: f32) -> f32 {
    1.0 / (std::f32::consts::TAU * cutoff_hz.max(1e-3))
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use effigy_capture::{FrameId, Rigid3};
    use effigy_fusion::{CleanFrame, DepthMap, NormalMap, VertexMap, clean::PersonVisibility};

    use super::*;
    use crate::registered::Tracking;

    const STEP_SECS: f64 = 1.0 / 30.0;

    fn frame(number: u64, tracking: Tracking) -> RegisteredFrame {
        let clean = CleanFrame {
            id: FrameId(number),
            timestamp: Timestamp::from_secs_f64(number as f64 * STEP_SECS),
            depth: DepthMap { width: 0, height: 0, metres: Vec::new() },
            vertices: VertexMap { width: 0, height: 0, points: Vec::new() },
            normals: NormalMap { width: 0, height: 0, normals: Vec::new() },
            person: Vec::new(),
            sigma_m: Vec::new(),
            floor: None,
            visibility: PersonVisibility::Whole,
        };
        RegisteredFrame { clean: Arc::new(clean), world_from_camera: Rigid3::IDENTITY, tracking }
    }

    /// The same, its person seen with such noise.
    fn seen_with(noise_m: f32, mut frame: RegisteredFrame) -> RegisteredFrame {
        let mut clean = (*frame.clean).clone();
        clean.person = vec![true; 100];
        clean.sigma_m = vec![noise_m; 100];
        frame.clean = Arc::new(clean);
        frame
    }

    fn tracked(elbow: Vec3) -> Tracking {
        tracked_arm(Vec3::ZERO, elbow)
    }

    fn tracked_arm(shoulder: Vec3, elbow: Vec3) -> Tracking {
        let mut params = BodyParams::ZERO;
        params.theta[16] = shoulder;
        params.theta[18] = elbow;
        let joint_confidence = [1.0; JOINT_COUNT];
        Tracking::Tracked { params, residual_rms_m: 0.01, joint_confidence }
    }

    fn elbow(smoother: &mut Smoother, frame: &RegisteredFrame) -> Vec3 {
        smoother.params(frame).expect("tracked").theta[18]
    }

    /// Noise in -1..1 that is the same each time.
    fn noise(number: u64) -> f32 {
        let hashed = (number + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 40;
        hashed as f32 / (1_u64 << 23) as f32 - 1.0
    }

    #[test]
    fn switched_off_it_changes_no_bit() {
        let mut smoother = Smoother::new(SmoothConfig::Off);
        for number in 0..20 {
            let tracking = tracked(Vec3::new(0.1, -1.0 + 0.3 * noise(number), 0.2));
            let frame = frame(number, tracking);
            assert_eq!(smoother.params(&frame).as_ref(), frame.params());
        }
    }

    #[test]
    fn a_still_joint_trembles_a_third_as_much() {
        let mut smoother = Smoother::new(SmoothConfig::default());
        let (mut before, mut after) = (0.0, 0.0);
        for number in 0..300 {
            let rotation = Vec3::new(0.0, -0.8 + 0.02 * noise(number), 0.0);
            let smooth = elbow(&mut smoother, &frame(number, tracked(rotation)));
            if number >= 30 {
                before += (rotation.y + 0.8).powi(2);
                after += (smooth.y + 0.8).powi(2);
            }
        }
        // Squared: a ninth of the power.
        assert!(after < before / 9.0, "{after} of {before}");
    }

    #[test]
    fn a_steady_turn_lags_as_long_as_is_stated() {
        let config = OneEuroConfig::default();
        let mut smoother = Smoother::new(SmoothConfig::OneEuro(config));
        let cases = [
            (0.5, 0.02),
            (1.0, 0.02),
            (2.0, 0.02),
            (0.5, 0.006),
            (0.5, 0.001_f32),
        ];
        for (rad_per_sec, noise_m) in cases {
            let mut lag_secs = 0.0;
            for number in 0..45 {
                let angle = rad_per_sec * number as f32 * STEP_SECS as f32 - 1.5;
                let frame = seen_with(noise_m, frame(number, tracked(Vec3::Y * angle)));
                lag_secs = (angle - elbow(&mut smoother, &frame).y) / rad_per_sec;
            }
            let stated_secs = config.lag_secs(rad_per_sec, noise_m);
            // A millisecond: single precision over two radians.
            assert!(
                (lag_secs - stated_secs).abs() < 1e-3,
                "{lag_secs} for {stated_secs}"
            );
            assert!(
                smoother
                    .params(&frame(45, Tracking::Lost { since: Timestamp(0) }))
                    .is_none()
            );
        }
    }

    #[test]
    fn a_quiet_sensor_is_believed() {
        let config = OneEuroConfig::default();
        let lag_secs = |noise_m| config.lag_secs(0.1, noise_m);
        assert!(lag_secs(0.0025) < 0.03 && lag_secs(0.02) > 0.15);
        assert_eq!(lag_secs(0.1), lag_secs(0.02));
        assert_eq!(lag_secs(0.0), lag_secs(0.0025));
    }

    /// A shoulder that turns one way and an elbow that turns slowly back: the hand's direction is known.
    #[test]
    fn joints_of_a_chain_are_let_go_together() {
        let mut smoother = Smoother::new(SmoothConfig::default());
        let mut lags = [0.0; 2];
        for number in 0..60 {
            let secs = number as f32 * STEP_SECS as f32;
            let [shoulder, elbow] = [1.2, -0.3].map(|rad_per_sec| rad_per_sec * secs);
            let tracking = tracked_arm(Vec3::Y * shoulder, Vec3::Y * elbow);
            let theta = smoother
                .params(&frame(number, tracking))
                .expect("tracked")
                .theta;
            lags = [(shoulder - theta[16].y) / 1.2, (elbow - theta[18].y) / -0.3];
        }
        assert!((lags[0] - lags[1]).abs() < 1e-3, "{lags:?}");
        let alone_secs = OneEuroConfig::default().lag_secs(0.3, 0.02);
        assert!(lags[1] < 0.5 * alone_secs, "{lags:?}, {alone_secs} alone");
    }

    #[test]
    fn a_body_found_again_starts_where_it_is() {
        let mut smoother = Smoother::new(SmoothConfig::default());
        for number in 0..10 {
            elbow(&mut smoother, &frame(number, tracked(Vec3::ZERO)));
        }
        assert!(
            smoother
                .params(&frame(10, Tracking::Lost { since: Timestamp(0) }))
                .is_none()
        );
        let found = elbow(
            &mut smoother,
            &frame(11, tracked(Vec3::new(0.0, -2.0, 0.0))),
        );
        assert!((found.y + 2.0).abs() < 1e-6);
    }
}
