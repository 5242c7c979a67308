//! What clothes do as a smooth function of the pose's coefficients: a drive that evaluates no field.
//!
//! The field's parameters are linear in the hypernetwork's coefficients (160 numbers), its surface is not. The offsets of
//! an avatar's vertices are learned by kernel ridge regression (Saunders et al. 1998) with a Gaussian kernel from poses
//! evaluated in full, in as many of their principal components as are asked for. Linear in the coefficients they were 2.5
//! times as far off, once the prior had learned more of what poses do.

use effigy_registration::motion::Motion;
use faer::{Mat, Side, linalg::solvers::Solve as _};
use serde::{Deserialize, Serialize};

use super::{
    BakeError,
    principal::{dot, mix_into, principal_components, projected},
};
use crate::{drive::Driver, error::AvatarError};

#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct MapConfig {
    /// Principal components that are kept; 0 for no map: every pose is evaluated in full.
    pub modes: usize,
    /// Poses that are evaluated of each motion, evenly spread.
    pub poses_a_motion: usize,
    /// Width of the kernel in root mean squares of the coefficients' distances from their mean.
    pub width: f32,
    /// Added to the kernel's diagonal, which is one, and as a share to the coefficients' mean variance where it is judged how
    /// far out a pose is.
    pub ridge: f64,
    /// A map whose error is larger is not used.
    pub most_p95_mm: f32,
    /// Poses so many times farther out than the farthest that was learned from are evaluated in full. Tracking that errs by
    /// 0.05 rad a joint is 6 times as far out, where a map of the untuned prior was 0.6 mm (p95) off, one that errs by 0.1
    /// rad 20 times, and 1.2 mm; the tracked poses of a demo are 3 to 8 times, and 0.1 to 0.2 mm (a
    /// diagnosis that is not committed).
    pub farthest: f32,
}

impl Default for MapConfig {
    fn default() -> Self {
        Self {
            modes: 96,
            poses_a_motion: 30,
            width: 2.0,
            ridge: 1e-4,
            most_p95_mm: 1.0,
            farthest: 12.0,
        }
    }
}

/// Offsets along an avatar's topology normals from a pose's coefficients.
#[derive(Clone, Debug)]
pub struct ShapeMap {
    mean_coefficients: Vec<f32>,
    mean_m: Vec<f32>,
    /// Poses that were evaluated in full: coefficients less their mean, a row a pose.
    known: Vec<Vec<f32>>,
    /// Twice the kernel's squared width.
    twice_width2: f32,
    /// A row a mode, a number a known pose.
    weights: Vec<Vec<f32>>,
    /// A row a mode, a number a vertex.
    modes_m: Vec<Vec<f32>>,
    /// How far out a pose is: the regularised inverse of the coefficients' products, row by row.
    spread: Vec<f32>,
    farthest: f32,
    /// Against the full field in motions that were left out to measure this; the map itself has learned from all.
    pub error: BakeError,
}

/// A pose evaluated in full.
struct Sample {
    motion: usize,
    coefficients: Vec<f32>,
    offsets_m: Vec<f32>,
}

/// Every so many-th motion is left out when the error is measured.
const LEFT_OUT_EVERY: usize = 4;

impl ShapeMap {
    /// Evaluates poses of these motions in full and learns from them; `None` for a field whose pose does not enter
    /// through coefficients, for no modes or motions, or when `go_on` says so.
    pub fn learn(
        driver: &mut Driver,
        motions: &[Motion],
        config: &MapConfig,
        go_on: &mut dyn FnMut() -> bool,
    ) -> Result<Option<Self>, AvatarError> {
        if config.modes == 0 || motions.len() < LEFT_OUT_EVERY {
            return Ok(None);
        }
        let mut samples = Vec::new();
        for (number, motion) in motions.iter().enumerate() {
            let count = config.poses_a_motion.min(motion.poses.len());
            for index in 0..count {
                if !go_on() {
                    return Ok(None);
                }
                let theta = &motion.poses[index * (motion.poses.len() - 1) / count.max(1)].theta;
                let pose = driver.avatar().subject.pose_input(theta);
                let Some(coefficients) = driver.avatar().field.coefficients(&pose) else {
                    return Ok(None);
                };
                let offsets_m = driver.offsets_m(&pose).to_vec();
                samples.push(Sample { motion: number, coefficients, offsets_m });
            }
        }
        let (kept, left_out): (Vec<&Sample>, Vec<&Sample>) = samples
            .iter()
            .partition(|sample| sample.motion % LEFT_OUT_EVERY != LEFT_OUT_EVERY - 1);
        if kept.is_empty() || left_out.is_empty() {
            return Ok(None);
        }
        let error = Self::fit(&kept, config)?.measured(&left_out);
        let all: Vec<&Sample> = samples.iter().collect();
        Ok(Some(Self { error, ..Self::fit(&all, config)? }))
    }

    fn fit(samples: &[&Sample], config: &MapConfig) -> Result<Self, AvatarError> {
        let (count, inputs) = (samples.len(), samples[0].coefficients.len());
        let rows: Vec<Vec<f32>> = samples
            .iter()
            .map(|sample| sample.offsets_m.clone())
            .collect();
        let (mean_m, modes_m) = principal_components(&rows, config.modes)?;
        let targets: Vec<Vec<f32>> = rows
            .iter()
            .map(|row| projected(row, &mean_m, &modes_m))
            .collect();
        let mean_coefficients: Vec<f32> = (0..inputs)
            .map(|i| {
                samples
                    .iter()
                    .map(|sample| sample.coefficients[i])
                    .sum::<f32>()
                    / count as f32
            })
            .collect();
        let known: Vec<Vec<f32>> = samples
            .iter()
            .map(|sample| less(&sample.coefficients, &mean_coefficients))
            .collect();
        let variance = known.iter().map(|row| dot(row, row)).sum::<f64>() / count as f64;
        let width2 = f64::from(config.width * config.width) * variance;
        let twice_width2 = (2.0 * width2).max(f64::from(f32::MIN_POSITIVE)) as f32;
        let wanted = Mat::from_fn(count, modes_m.len(), |i, j| f64::from(targets[i][j]));
        let kernels = Mat::from_fn(count, count, |i, j| {
            let ridge = if i == j { config.ridge } else { 0.0 };
            f64::from(kernel(&known[i], &known[j], twice_width2)) + ridge
        });
        let failed = |error| AvatarError::Export(format!("baking: coefficients: {error:?}"));
        let solved = kernels.llt(Side::Lower).map_err(failed)?.solve(&wanted);
        let weights = (0..modes_m.len())
            .map(|mode| (0..count).map(|i| solved[(i, mode)] as f32).collect())
            .collect();
        let centred = Mat::from_fn(count, inputs, |i, j| f64::from(known[i][j]));
        let mut products = centred.transpose() * &centred;
        let mean: f64 = (0..inputs).map(|i| products[(i, i)]).sum::<f64>() / inputs as f64;
        for i in 0..inputs {
            products[(i, i)] += config.ridge * mean + f64::MIN_POSITIVE;
        }
        let cholesky = products.llt(Side::Lower).map_err(failed)?;
        let inverse = cholesky.solve(&Mat::<f64>::identity(inputs, inputs));
        let spread = (0..inputs * inputs)
            .map(|at| inverse[(at / inputs, at % inputs)] as f32)
            .collect();
        let mut map = Self {
            mean_coefficients,
            mean_m,
            known,
            twice_width2,
            weights,
            modes_m,
            spread,
            farthest: f32::INFINITY,
            error: BakeError::default(),
        };
        let out = map.known.iter().map(|known| map.how_far_out(known));
        map.farthest = config.farthest * out.fold(0.0, f32::max);
        Ok(map)
    }

    /// The offsets in a pose, metres; `false`, and nothing written, where it is too far from all that was learned.
    pub fn offsets_m(&self, coefficients: &[f32], offsets_m: &mut Vec<f32>) -> bool {
        let centred = less(coefficients, &self.mean_coefficients);
        // What is not a number is far out, too.
        let near = self.how_far_out(&centred) <= self.farthest;
        if near {
            self.write(&centred, offsets_m);
        }
        near
    }

    fn write(&self, centred: &[f32], offsets_m: &mut Vec<f32>) {
        let known = self.known.iter();
        let kernels: Vec<f32> = known
            .map(|known| kernel(known, centred, self.twice_width2))
            .collect();
        let weights = self.weights.iter().map(|row| dot(row, &kernels) as f32);
        mix_into(offsets_m, &self.mean_m, &self.modes_m, weights);
    }

    /// A regression's leverage: squared distance from the mean in units of what was seen.
    fn how_far_out(&self, centred: &[f32]) -> f32 {
        let rows = self.spread.chunks_exact(centred.len().max(1));
        rows.zip(centred)
            .map(|(row, x)| x * dot(row, centred) as f32)
            .sum()
    }

    fn measured(&self, samples: &[&Sample]) -> BakeError {
        let mut offsets_m = Vec::new();
        BakeError::of(samples.iter().map(|sample| {
            let centred = less(&sample.coefficients, &self.mean_coefficients);
            self.write(&centred, &mut offsets_m);
            (sample.offsets_m.clone(), offsets_m.clone(), &self.mean_m)
        }))
    }
}

fn less(a: &[f32], b: &[f32]) -> Vec<f32> {
    a.iter().zip(b).map(|(a, b)| a - b).collect()
}

/// `exp(-|a - b|^2 / (2 width^2))`.
fn kernel(a: &[f32], b: &[f32], twice_width2: f32) -> f32 {
    let distances = a.iter().zip(b).map(|(a, b)| (a - b) * (a - b));
    (-distances.sum::<f32>() / twice_width2).exp()
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use effigy_capture::FrameId;
    use effigy_registration::{
        BodyParams,
        motion::{MotionPose, RestBody, Routine},
        smpl::builtin,
    };

    use super::*;
    use crate::{
        drive::DriveConfig,
        hyper,
        model::{Avatar, Subject, TopologyConfig},
        skinning::{ClosestBodyPoint, ClosestBodyPointConfig},
    };

    fn params(pose: &MotionPose) -> BodyParams {
        BodyParams { betas: [0.0; 10], theta: pose.theta, trans: pose.trans }
    }

    fn motions(routines: &[Routine], seed: u64) -> Vec<Motion> {
        let rest = RestBody::of(&builtin::body(), &[0.0; 10]);
        routines
            .iter()
            .map(|routine| routine.motion(&rest, 30.0, seed))
            .collect()
    }

    #[test]
    fn the_prior_is_driven_without_its_field_where_it_is_near_and_fully_far_out() {
        let body = builtin::body();
        let subject = Subject::new(&body, &[0.0; 10]).unwrap();
        let skinning = ClosestBodyPoint::new(body, &[0.0; 10], ClosestBodyPointConfig::default());
        let known: Vec<Routine> = (Routine::ACTIONS.iter().copied())
            .filter(|routine| *routine != Routine::Bend)
            .chain([
                Routine::WalkInPlace,
                Routine::RaiseArms,
                Routine::Squat,
                Routine::Freestyle,
            ])
            .collect();
        let learned = motions(&known, 1);
        let topology = TopologyConfig { vertices: 2000, ..TopologyConfig::default() };
        let theta = learned[0].poses[0].theta;
        let field = Arc::new(hyper::prior());
        let avatar = Arc::new(Avatar::new(&subject, field, &skinning, &theta, &topology).unwrap());
        let mut full = Driver::new(Arc::clone(&avatar), DriveConfig::default());
        let config = MapConfig::default();
        let map = ShapeMap::learn(&mut full, &learned, &config, &mut || true)
            .unwrap()
            .unwrap();
        println!("left-out motions: {:?}", map.error);
        // Not the millimetre that live avatars are held to: untuned, the prior would ask its field (1.8 mm since it follows poses
        // far from a relaxed stance).
        let BakeError { rms_mm, p95_mm, still_rms_mm } = map.error;
        assert!(p95_mm < 2.0 && p95_mm < still_rms_mm && rms_mm < still_rms_mm / 4.0);

        let mut mapped = Driver::new(avatar, DriveConfig::default()).with_map(map);
        let mut errors_mm = Vec::new();
        for pose in &motions(&[Routine::Bend], 5)[0].poses {
            let params = params(pose);
            let (a, b) = (
                full.pose(&params, FrameId(0)),
                mapped.pose(&params, FrameId(0)),
            );
            let pairs = a.vertices.iter().zip(&b.vertices);
            errors_mm.extend(pairs.map(|(a, b)| a.distance(*b) * 1e3));
        }
        errors_mm.sort_by(f32::total_cmp);
        let p95_mm = errors_mm[errors_mm.len() * 95 / 100];
        println!("bending, never learned: p95 {p95_mm} mm");
        assert!(p95_mm < 1.5);

        // Elbows and knees the wrong way round: nothing is known of that, so the field is asked.
        let mut strange = learned[0].poses[0];
        for joint in [4, 5, 18, 19] {
            strange.theta[joint] *= -1.0;
            strange.theta[joint] += 2.5;
        }
        let params = params(&strange);
        let (a, b) = (
            full.pose(&params, FrameId(0)),
            mapped.pose(&params, FrameId(0)),
        );
        assert_eq!(a.vertices, b.vertices);
    }
}
