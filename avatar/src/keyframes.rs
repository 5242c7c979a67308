//! Which frames the avatar learns from: new headings, new poses, good fits.

use std::f32::consts::PI;

use effigy_registration::{
    BodyParams, RegisteredFrame, Tracking,
    smpl::{JOINT_COUNT, rotation_from_axis_angle},
};
use glam::{Quat, Vec3};
use serde::{Deserialize, Serialize};

/// What makes a frame worth keeping.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct KeyframeConfig {
    /// MetaAvatar's few-shot avatars learn from eight.
    pub count: usize,
    /// A worse fit canonicalises points to the wrong place.
    pub max_residual_m: f32,
    /// Mean over the joints; below it the prior made the pose up.
    pub min_mean_confidence: f32,
    /// A turn by this much counts as one new view: a little under an eighth of a full turn, so that a person
    /// who turns once gives eight.
    pub heading_step_rad: f32,
    /// A root-mean-square change of the joints by this much counts as one new pose.
    pub pose_step_rad: f32,
    /// A full set swaps a keyframe for a frame that spreads the set by this factor.
    pub min_gain: f32,
}

impl Default for KeyframeConfig {
    fn default() -> Self {
        Self {
            count: 8,
            max_residual_m: 0.04,
            min_mean_confidence: 0.2,
            heading_step_rad: 0.7,
            pose_step_rad: 0.35,
            min_gain: 1.25,
        }
    }
}

/// A frame that was kept.
#[derive(Clone, Debug)]
pub struct Keyframe {
    pub frame: RegisteredFrame,
    pub params: BodyParams,
    /// Where the body faces, seen from above: 0 towards the camera, positive to the body's left.
    pub heading_rad: f32,
    pub residual_rms_m: f32,
}

/// What became of a frame, and why.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum KeyframeVerdict {
    /// Kept; `novelty` is its distance to the nearest keyframe, 1 being one step of heading or pose.
    Kept {
        slot: usize,
        novelty: f32,
    },
    /// Took the place of a keyframe that was too like another one.
    Spread {
        slot: usize,
        novelty: f32,
        was: f32,
    },
    /// Took the place of the same view with a worse fit.
    Better {
        slot: usize,
        residual_rms_m: f32,
        was_m: f32,
    },
    NotTracked,
    PoorFit {
        residual_rms_m: f32,
        limit_m: f32,
    },
    PoorlySeen {
        mean_confidence: f32,
        limit: f32,
    },
    NothingNew {
        novelty: f32,
    },
}

impl KeyframeVerdict {
    /// The slot that changed, if one did.
    pub fn slot(&self) -> Option<usize> {
        match *self {
            Self::Kept { slot, .. } | Self::Spread { slot, .. } | Self::Better { slot, .. } => {
                Some(slot)
            }
            Self::NotTracked
            | Self::PoorFit { .. }
            | Self::PoorlySeen { .. }
            | Self::NothingNew { .. } => None,
        }
    }
}

/// A fit must be this much better to displace the same view.
const BETTER_FIT: f32 = 0.75;

/// Keeps the best few frames of what it has seen.
pub struct KeyframeSelector {
    config: KeyframeConfig,
    keyframes: Vec<Keyframe>,
}

impl KeyframeSelector {
    pub fn new(config: KeyframeConfig) -> Self {
        Self { config, keyframes: Vec::new() }
    }

    pub fn keyframes(&self) -> &[Keyframe] {
        &self.keyframes
    }

    pub fn is_full(&self) -> bool {
        self.keyframes.len() >= self.config.count
    }

    /// Forgets all keyframes: another person, or another shape.
    pub fn clear(&mut self) {
        self.keyframes.clear();
    }

    /// Looks at one frame, in order.
    pub fn consider(&mut self, frame: &RegisteredFrame) -> KeyframeVerdict {
        let candidate = match self.judge(frame) {
            Ok(candidate) => candidate,
            Err(refusal) => return refusal,
        };
        let Some((nearest, novelty)) = self.nearest(&candidate) else {
            self.keyframes.push(candidate);
            return KeyframeVerdict::Kept { slot: 0, novelty: f32::INFINITY };
        };
        if novelty >= 1.0 && !self.is_full() {
            self.keyframes.push(candidate);
            return KeyframeVerdict::Kept { slot: self.keyframes.len() - 1, novelty };
        }
        let was_m = self.keyframes[nearest].residual_rms_m;
        let residual_rms_m = candidate.residual_rms_m;
        if novelty < 0.5 && residual_rms_m < BETTER_FIT * was_m {
            self.keyframes[nearest] = candidate;
            return KeyframeVerdict::Better { slot: nearest, residual_rms_m, was_m };
        }
        if self.is_full()
            && let Some((slot, was)) = self.most_alike()
            && novelty > self.config.min_gain * was
        {
            self.keyframes[slot] = candidate;
            return KeyframeVerdict::Spread { slot, novelty, was };
        }
        KeyframeVerdict::NothingNew { novelty }
    }

    /// The frame as a keyframe, if tracking is good enough.
    fn judge(&self, frame: &RegisteredFrame) -> Result<Keyframe, KeyframeVerdict> {
        let Tracking::Tracked { params, residual_rms_m, joint_confidence } = &frame.tracking else {
            return Err(KeyframeVerdict::NotTracked);
        };
        let (residual_rms_m, limit_m) = (*residual_rms_m, self.config.max_residual_m);
        if residual_rms_m.is_nan() || residual_rms_m > limit_m {
            return Err(KeyframeVerdict::PoorFit { residual_rms_m, limit_m });
        }
        let mean_confidence = joint_confidence.iter().sum::<f32>() / JOINT_COUNT as f32;
        let limit = self.config.min_mean_confidence;
        if mean_confidence.is_nan() || mean_confidence < limit {
            return Err(KeyframeVerdict::PoorlySeen { mean_confidence, limit });
        }
        let camera_in_world = frame.world_from_camera.translation;
        Ok(Keyframe {
            frame: frame.clone(),
            params: *params,
            heading_rad: heading_rad(params, camera_in_world),
            residual_rms_m,
        })
    }

    fn nearest(&self, candidate: &Keyframe) -> Option<(usize, f32)> {
        self.keyframes
            .iter()
            .map(|keyframe| self.novelty(keyframe, candidate))
            .enumerate()
            .min_by(|a, b| a.1.total_cmp(&b.1))
    }

    /// Of the two keyframes most alike, the one with the worse fit; and how far apart they are.
    fn most_alike(&self) -> Option<(usize, f32)> {
        let count = self.keyframes.len();
        let pairs = (0..count).flat_map(|a| (a + 1..count).map(move |b| (a, b)));
        let (a, b, apart) = pairs
            .map(|(a, b)| (a, b, self.novelty(&self.keyframes[a], &self.keyframes[b])))
            .min_by(|x, y| x.2.total_cmp(&y.2))?;
        let worse = if self.keyframes[a].residual_rms_m > self.keyframes[b].residual_rms_m {
            a
        } else {
            b
        };
        Some((worse, apart))
    }

    /// Steps of heading and of pose between two frames, as one length.
    fn novelty(&self, a: &Keyframe, b: &Keyframe) -> f32 {
        let turned = wrapped(a.heading_rad - b.heading_rad).abs() / self.config.heading_step_rad;
        let moved = pose_distance_rad(&a.params, &b.params) / self.config.pose_step_rad;
        turned.hypot(moved)
    }
}

/// The angle about the vertical from the direction of the camera to where the body faces.
fn heading_rad(params: &BodyParams, camera_in_world: Vec3) -> f32 {
    let facing = rotation_from_axis_angle(params.theta[0]) * Vec3::Z;
    let to_camera = camera_in_world - params.trans;
    wrapped(facing.x.atan2(facing.z) - to_camera.x.atan2(to_camera.z))
}

fn wrapped(angle_rad: f32) -> f32 {
    (angle_rad + PI).rem_euclid(2.0 * PI) - PI
}

/// Root mean square of the angles between the joints' rotations, without the root.
fn pose_distance_rad(a: &BodyParams, b: &BodyParams) -> f32 {
    let quat = |v: Vec3| Quat::from_scaled_axis(v);
    let sum: f32 = (1..JOINT_COUNT)
        .map(|joint| {
            quat(a.theta[joint])
                .angle_between(quat(b.theta[joint]))
                .powi(2)
        })
        .sum();
    (sum / (JOINT_COUNT - 1) as f32).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{Suit, everyday_poses};

    /// Frames of one body: what they show does not matter here, so all share one image.
    struct Frames(RegisteredFrame);

    impl Frames {
        fn new() -> Self {
            Self(Suit::new(0.01).frame(&everyday_poses()[0], 0))
        }

        fn at(&self, heading_rad: f32, knee_rad: f32, residual: f32) -> RegisteredFrame {
            let mut params = BodyParams::ZERO;
            params.theta[0] = Vec3::new(0.0, heading_rad, 0.0);
            for joint in [4, 5, 18, 19] {
                params.theta[joint] = Vec3::new(knee_rad, 0.0, 0.0);
            }
            let tracking = Tracking::Tracked {
                params,
                residual_rms_m: residual,
                joint_confidence: [0.8; JOINT_COUNT],
            };
            RegisteredFrame { tracking, ..self.0.clone() }
        }
    }

    #[test]
    fn a_full_turn_gives_eight_keyframes_spread_over_all_headings() {
        let frames = Frames::new();
        let mut selector = KeyframeSelector::new(KeyframeConfig::default());
        for step in 0..240 {
            selector.consider(&frames.at(step as f32 * 2.0 * PI / 240.0, 0.0, 0.01));
        }
        assert!(selector.is_full());
        let mut headings: Vec<f32> = selector
            .keyframes()
            .iter()
            .map(|keyframe| keyframe.heading_rad)
            .collect();
        headings.sort_by(f32::total_cmp);
        for pair in headings.windows(2) {
            assert!((pair[1] - pair[0]) > 0.65, "{headings:?}");
        }
    }

    #[test]
    fn standing_still_gives_one_keyframe_and_a_better_fit_replaces_it() {
        let frames = Frames::new();
        let mut selector = KeyframeSelector::new(KeyframeConfig::default());
        assert!(matches!(
            selector.consider(&frames.at(0.0, 0.0, 0.02)),
            KeyframeVerdict::Kept { slot: 0, .. }
        ));
        assert!(matches!(
            selector.consider(&frames.at(0.1, 0.0, 0.019)),
            KeyframeVerdict::NothingNew { .. }
        ));
        assert!(matches!(
            selector.consider(&frames.at(0.1, 0.0, 0.01)),
            KeyframeVerdict::Better { slot: 0, .. }
        ));
        assert_eq!(selector.keyframes().len(), 1);
    }

    #[test]
    fn poor_fits_lost_frames_and_nan_are_refused_with_the_reason() {
        let frames = Frames::new();
        let mut selector = KeyframeSelector::new(KeyframeConfig::default());
        for residual in [0.2, f32::NAN] {
            assert!(matches!(
                selector.consider(&frames.at(0.0, 0.0, residual)),
                KeyframeVerdict::PoorFit { .. }
            ));
        }
        let mut lost = frames.at(0.0, 0.0, 0.01);
        lost.tracking = Tracking::Lost { since: effigy_capture::Timestamp(0) };
        assert_eq!(selector.consider(&lost), KeyframeVerdict::NotTracked);
        assert!(selector.keyframes().is_empty());
    }

    #[test]
    fn a_full_set_of_like_poses_opens_up_for_a_new_heading() {
        let frames = Frames::new();
        let config = KeyframeConfig { count: 3, ..KeyframeConfig::default() };
        let mut selector = KeyframeSelector::new(config);
        for knee in [0.0, 0.9, 1.8] {
            assert!(
                selector
                    .consider(&frames.at(0.0, knee, 0.01))
                    .slot()
                    .is_some()
            );
        }
        let verdict = selector.consider(&frames.at(PI, 0.9, 0.01));
        assert!(
            matches!(verdict, KeyframeVerdict::Spread { .. }),
            "{verdict:?}"
        );
    }

    #[test]
    fn turning_body_or_camera_is_the_same_heading() {
        let turned = BodyParams {
            theta: {
                let mut theta = [Vec3::ZERO; JOINT_COUNT];
                theta[0] = Vec3::new(0.0, 0.7, 0.0);
                theta
            },
            ..BodyParams::ZERO
        };
        let ahead = heading_rad(&BodyParams::ZERO, Vec3::new(0.0, 1.0, 2.0));
        assert!(ahead.abs() < 1e-6);
        assert!((heading_rad(&turned, Vec3::new(0.0, 1.0, 2.0)) - 0.7).abs() < 1e-5);
        let camera = Quat::from_rotation_y(0.7) * Vec3::new(0.0, 1.0, 2.0);
        assert!(heading_rad(&turned, camera).abs() < 1e-5);
    }
}
