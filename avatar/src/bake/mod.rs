//! Clothes that follow the pose as a few shapes to mix: for programs that know no neural field, and for speed.
//!
//! The driven mesh differs from the topology by one number a vertex, the offset along its normal. Over the poses of a
//! motion these offsets vary in few ways: their principal components, found from a part of the motion's poses, are the
//! modes; each key's weights are its projection on them.

mod map;
mod principal;

use effigy_registration::motion::Motion;
use serde::{Deserialize, Serialize};

pub use map::{MapConfig, ShapeMap};
use principal::{mix_into, principal_components, projected};

use crate::{drive::Driver, error::AvatarError};

#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct BakeConfig {
    /// At most; fewer where the motion has fewer.
    pub modes: usize,
    /// Clothes change more slowly than joints turn.
    pub keys_per_sec: f32,
    /// At most so many poses, evenly spread, give the modes.
    pub learned_from: usize,
}

impl Default for BakeConfig {
    fn default() -> Self {
        Self { modes: 16, keys_per_sec: 15.0, learned_from: 200 }
    }
}

/// How a motion changes an avatar's shape: at key `k`, vertex `v` lies
/// `mean_m[v] + sum over modes of weights[k][mode] * modes_m[mode][v]` along its topology normal from its topology
/// place.
#[derive(Clone, Debug, PartialEq)]
pub struct Bake {
    /// Metres, one a vertex.
    pub mean_m: Vec<f32>,
    /// Metres at weight one, one a vertex; the strongest mode first. No weight is beyond -1 and 1.
    pub modes_m: Vec<Vec<f32>>,
    /// When, in seconds from the motion's start; rising.
    pub key_secs: Vec<f32>,
    /// One row a key, one weight a mode.
    pub weights: Vec<Vec<f32>>,
    pub error: BakeError,
}

/// A baked shape against the full field's, measured where it was not learned.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
#[expect(clippy::struct_field_names, reason = "they say their unit")]
pub struct BakeError {
    pub rms_mm: f32,
    pub p95_mm: f32,
    /// What a shape that does not change with the pose (the mean) would leave.
    pub still_rms_mm: f32,
}

/// Poses between keys whose shape is compared with the field's.
const CHECKED: usize = 24;

impl Bake {
    /// Evaluates the avatar's field at the motion's keys, some ten milliseconds each on two cores; `progress` is
    /// called with the keys done and their number, and `None` is returned when it says `false`.
    pub fn of_motion(
        driver: &mut Driver,
        motion: &Motion,
        config: &BakeConfig,
        progress: &mut dyn FnMut(usize, usize) -> bool,
    ) -> Result<Option<Self>, AvatarError> {
        let broken = |problem: &str| AvatarError::Export(format!("baking: {problem}"));
        if motion.poses.is_empty() {
            return Err(broken("the motion has no poses"));
        }
        if !(config.keys_per_sec > 0.0 && config.learned_from > 0) {
            return Err(broken("keys_per_sec and learned_from must be above zero"));
        }
        let keys = keys(motion, config.keys_per_sec);
        let subject = driver.avatar().subject;
        let mut offsets_at = |pose: usize| {
            let pose = subject.pose_input(&motion.poses[pose].theta);
            driver.offsets_m(&pose).to_vec()
        };
        let learned_every = keys.len().div_ceil(config.learned_from).max(1);
        let mut learned = Vec::new();
        for &key in keys.iter().step_by(learned_every) {
            if !progress(learned.len(), keys.len()) {
                return Ok(None);
            }
            learned.push(offsets_at(key));
        }
        let (mean_m, mut modes_m) = principal_components(&learned, config.modes)?;
        let mut weights = Vec::with_capacity(keys.len());
        for (number, &key) in keys.iter().enumerate() {
            let offsets = if number % learned_every == 0 {
                std::mem::take(&mut learned[number / learned_every])
            } else {
                if !progress(learned.len().max(number), keys.len()) {
                    return Ok(None);
                }
                offsets_at(key)
            };
            weights.push(projected(&offsets, &mean_m, &modes_m));
        }
        normalise(&mut modes_m, &mut weights);
        let key_secs = keys
            .iter()
            .map(|&key| key as f32 / motion.rate_hz)
            .collect();
        let mut bake = Self { mean_m, modes_m, key_secs, weights, error: BakeError::default() };
        bake.error = bake.measured(&keys, &mut offsets_at);
        Ok(Some(bake))
    }

    /// Offsets along the topology normals with these weights, metres.
    pub fn offsets_m(&self, weights: &[f32]) -> Vec<f32> {
        let mut offsets = Vec::new();
        mix_into(
            &mut offsets,
            &self.mean_m,
            &self.modes_m,
            weights.iter().copied(),
        );
        offsets
    }

    fn measured(&self, keys: &[usize], offsets_at: &mut dyn FnMut(usize) -> Vec<f32>) -> BakeError {
        // Where keys are neighbouring frames nothing lies between them; the keys themselves have to do then.
        let pairs: Vec<(usize, &[usize])> = keys.windows(2).enumerate().collect();
        let every = pairs.len().div_ceil(CHECKED).max(1);
        let checked = pairs.iter().skip(every / 2).step_by(every);
        BakeError::of(checked.map(|&(number, pair)| {
            let frame = usize::midpoint(pair[0], pair[1]);
            let share = (frame - pair[0]) as f32 / (pair[1] - pair[0]) as f32;
            let ends = self.weights[number].iter().zip(&self.weights[number + 1]);
            let weights: Vec<f32> = ends.map(|(a, b)| a + share * (b - a)).collect();
            (offsets_at(frame), self.offsets_m(&weights), &self.mean_m)
        }))
    }
}

impl BakeError {
    /// Of poses given as the full offsets, the baked ones and the mean's, metres.
    fn of<'a>(poses: impl Iterator<Item = (Vec<f32>, Vec<f32>, &'a Vec<f32>)>) -> Self {
        let (mut errors, mut still) = (Vec::new(), 0.0_f64);
        for (full, baked, mean) in poses {
            errors.extend(full.iter().zip(&baked).map(|(a, b)| (a - b).abs() * 1e3));
            let strays = full
                .iter()
                .zip(mean)
                .map(|(a, b)| f64::from((a - b) * 1e3).powi(2));
            still += strays.sum::<f64>();
        }
        if errors.is_empty() {
            return Self::default();
        }
        errors.sort_by(f32::total_cmp);
        let squares: f64 = errors.iter().map(|&error| f64::from(error).powi(2)).sum();
        let count = errors.len() as f64;
        Self {
            rms_mm: (squares / count).sqrt() as f32,
            p95_mm: errors[(errors.len() - 1) * 95 / 100],
            still_rms_mm: (still / count).sqrt() as f32,
        }
    }
}

/// Frames of the motion: evenly spread, the first and the last among them.
fn keys(motion: &Motion, keys_per_sec: f32) -> Vec<usize> {
    let last = motion.poses.len() - 1;
    let step = (motion.rate_hz / keys_per_sec).max(1.0);
    let count = (last as f32 / step).ceil() as usize;
    let mut keys: Vec<usize> = (0..=count)
        .map(|key| (last * key).checked_div(count).unwrap_or(0))
        .collect();
    keys.dedup();
    keys
}

/// Largest weights become one: what sliders in other programs expect.
fn normalise(modes: &mut [Vec<f32>], weights: &mut [Vec<f32>]) {
    for (number, mode) in modes.iter_mut().enumerate() {
        let largest = weights
            .iter()
            .map(|row| row[number].abs())
            .fold(0.0, f32::max);
        if largest > 0.0 {
            for value in mode.iter_mut() {
                *value *= largest;
            }
            for row in weights.iter_mut() {
                row[number] /= largest;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use effigy_registration::motion::MotionPose;

    use super::*;
    use crate::{
        drive::DriveConfig,
        testing::{everyday_poses, suit_avatar},
    };

    fn motion(count: usize) -> Motion {
        let poses = everyday_poses();
        let half = count / 2;
        let between = |index: usize| {
            let (a, b) = (&poses[index / half], &poses[index / half + 1]);
            let share = (index % half) as f32 / half as f32;
            MotionPose {
                theta: std::array::from_fn(|joint| a.theta[joint].lerp(b.theta[joint], share)),
                trans: a.trans.lerp(b.trans, share),
            }
        };
        Motion {
            name: "everyday".to_owned(),
            rate_hz: 30.0,
            poses: (0..2 * half).map(between).collect(),
        }
    }

    #[test]
    fn a_suit_that_swells_with_the_pose_is_baked_to_a_tenth_of_a_millimetre() {
        let mut driver = Driver::new(Arc::new(suit_avatar(0.012)), DriveConfig::default());
        let config = BakeConfig { modes: 8, keys_per_sec: 10.0, ..BakeConfig::default() };
        let bake = Bake::of_motion(&mut driver, &motion(60), &config, &mut |_, _| true)
            .unwrap()
            .unwrap();
        let BakeError { rms_mm, p95_mm, still_rms_mm } = bake.error;
        println!("baked: rms {rms_mm} mm, p95 {p95_mm} mm; still: rms {still_rms_mm} mm");
        assert_eq!(bake.key_secs.len(), bake.weights.len());
        assert!((bake.key_secs.last().unwrap() - 59.0 / 30.0).abs() < 1e-6);
        assert!(
            bake.weights
                .iter()
                .flatten()
                .all(|weight| weight.abs() <= 1.0)
        );
        // The suit grows evenly by up to 12 mm: one mode of it, and what interpolation leaves.
        assert!(still_rms_mm > 1.0 && p95_mm < 0.3 * still_rms_mm && p95_mm < 1.0);
    }

    #[test]
    fn a_shape_that_does_not_change_needs_no_modes() {
        let mut driver = Driver::new(Arc::new(suit_avatar(0.0)), DriveConfig::default());
        let bake = Bake::of_motion(
            &mut driver,
            &motion(20),
            &BakeConfig::default(),
            &mut |_, _| true,
        );
        let bake = bake.unwrap().unwrap();
        assert!(bake.error.p95_mm < 0.01, "{:?}", bake.error);
        let strongest = bake.modes_m.first().map_or(0.0, |mode| {
            mode.iter()
                .fold(0.0_f32, |most, value| most.max(value.abs()))
        });
        assert!(strongest < 1e-4, "a mode of {strongest} m");
    }

    #[test]
    fn nothing_to_bake_is_an_error_and_stopping_is_not() {
        let mut driver = Driver::new(Arc::new(suit_avatar(0.0)), DriveConfig::default());
        let config = BakeConfig::default();
        let none = Motion { poses: Vec::new(), ..motion(20) };
        assert!(Bake::of_motion(&mut driver, &none, &config, &mut |_, _| true).is_err());
        let stopped = Bake::of_motion(&mut driver, &motion(20), &config, &mut |done, _| done < 3);
        assert_eq!(stopped.unwrap(), None);
    }
}
