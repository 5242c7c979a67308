//! Draws the points of one step from a keyframe.

use glam::Vec3;
use rand::{Rng, RngExt as _, seq::SliceRandom as _};
use rand_distr::{Distribution as _, StandardNormal};
use serde::{Deserialize, Serialize};

use crate::{
    CanonicalSamples, SignedDistanceField as _,
    sdf::{
        SirenField,
        loss::{Known, LossPoint},
    },
};

/// How many points of each kind a step takes from a keyframe.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SamplingConfig {
    /// Measured points.
    pub surface: usize,
    /// Points a little along a measured normal, in and out, whose distance is thereby known.
    pub near: usize,
    /// Deviation of that offset, in unit lengths: about the thickness of clothes.
    pub near_deviation: f32,
    /// Points seen to be empty.
    pub free: usize,
    /// How far outside, in unit lengths, such a point is taken to be: below the sensor's noise.
    pub free_at_least: f32,
    /// Random points of the box.
    pub uniform: usize,
}

impl Default for SamplingConfig {
    fn default() -> Self {
        Self {
            surface: 640,
            near: 192,
            near_deviation: 0.02,
            free: 128,
            free_at_least: 0.0,
            uniform: 256,
        }
    }
}

impl SamplingConfig {
    pub fn points_per_frame(&self) -> usize {
        self.surface + self.near + self.free + self.uniform
    }
}

/// A keyframe's points, cut into those that teach and those that judge.
#[derive(Clone, Debug)]
pub(crate) struct KeyframePoints {
    pub(crate) surface: Vec<SurfacePoint>,
    pub(crate) held_out: Vec<SurfacePoint>,
    free: Vec<Vec3>,
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct SurfacePoint {
    pub(crate) point: Vec3,
    pub(crate) normal: Vec3,
    pub(crate) weight: f32,
}

/// Every frame's points, weights divided by the mean of all that count; this share of each is held out.
pub(crate) fn keyframes(
    samples: &[CanonicalSamples],
    held_out_share: f32,
    rng: &mut impl Rng,
) -> Vec<KeyframePoints> {
    let weights = || {
        samples
            .iter()
            .flat_map(|s| &s.weights)
            .filter(|weight| **weight > 0.0)
    };
    let mean_weight = weights().sum::<f32>() / weights().count().max(1) as f32;
    samples
        .iter()
        .map(|s| KeyframePoints::new(s, mean_weight, held_out_share, rng))
        .collect()
}

/// The numbers of `wanted` frames of `count`, none twice, in random order; of all in order if so many are not there,
/// or 0 are wanted.
pub(crate) fn choose(count: usize, wanted: usize, rng: &mut impl Rng) -> Vec<usize> {
    let mut numbers: Vec<usize> = (0..count).collect();
    if (1..count).contains(&wanted) {
        for place in 0..wanted {
            numbers.swap(place, rng.random_range(place..count));
        }
        numbers.truncate(wanted);
    }
    numbers
}

impl KeyframePoints {
    /// All of a surface, each point of weight one, none held out.
    pub(crate) fn whole(points: &[Vec3], normals: &[Vec3]) -> Self {
        let surface = points
            .iter()
            .zip(normals)
            .map(|(&point, &normal)| SurfacePoint { point, normal, weight: 1.0 })
            .collect();
        Self { surface, held_out: Vec::new(), free: Vec::new() }
    }

    /// Leaves out points of weight zero; weights are divided by `mean_weight`.
    pub(crate) fn new(
        samples: &CanonicalSamples,
        mean_weight: f32,
        held_out_share: f32,
        rng: &mut impl Rng,
    ) -> Self {
        let points = samples
            .points_in_unit
            .iter()
            .zip(&samples.normals)
            .zip(&samples.weights);
        let mut surface: Vec<_> = points
            .filter(|(_, weight)| **weight > 0.0)
            .map(|((&point, &normal), weight)| SurfacePoint {
                point,
                normal,
                weight: weight / mean_weight,
            })
            .collect();
        surface.shuffle(rng);
        let held_out = surface.split_off(
            surface.len() - (surface.len() as f32 * held_out_share.clamp(0.0, 0.9)) as usize,
        );
        Self { surface, held_out, free: samples.free_in_unit.clone() }
    }

    /// Replaces `points` and `known` by one step's draw. Empty kinds give way to random points.
    pub(crate) fn draw(
        &self,
        config: &SamplingConfig,
        rng: &mut impl Rng,
        points: &mut Vec<Vec3>,
        known: &mut Vec<LossPoint>,
    ) {
        points.clear();
        known.clear();
        let mut push = |point: Vec3, what: Known, weight: f32| {
            points.push(point);
            known.push(LossPoint { known: what, weight });
        };
        let mut uniform = config.uniform;
        if self.surface.is_empty() {
            uniform += config.surface + config.near;
        } else {
            for _ in 0..config.surface {
                let at = self.surface[rng.random_range(0..self.surface.len())];
                push(at.point, Known::Surface { normal: at.normal }, at.weight);
            }
            for _ in 0..config.near {
                let at = self.surface[rng.random_range(0..self.surface.len())];
                let offset: f32 = StandardNormal.sample(rng);
                let distance = (offset * config.near_deviation)
                    .clamp(-2.0 * config.near_deviation, 2.0 * config.near_deviation);
                if at.normal == Vec3::ZERO {
                    push(at.point, Known::Surface { normal: at.normal }, at.weight);
                } else {
                    let point = at.point + at.normal * distance;
                    push(point, Known::Distance(distance), at.weight);
                }
            }
        }
        if self.free.is_empty() {
            uniform += config.free;
        } else {
            for _ in 0..config.free {
                let point = self.free[rng.random_range(0..self.free.len())];
                push(point, Known::Free { at_least: config.free_at_least }, 1.0);
            }
        }
        for _ in 0..uniform {
            push(random_in_box(rng), Known::Nothing, 1.0);
        }
    }
}

/// The field's values, unit lengths, at points that were measured.
pub(crate) fn values_at(field: &SirenField, measured: &[SurfacePoint]) -> Vec<f32> {
    let points: Vec<Vec3> = measured.iter().map(|at| at.point).collect();
    let mut values = vec![0.0; points.len()];
    field.values(&points, &mut values);
    values
}

/// A uniform point of the unit box.
pub(crate) fn random_in_box(rng: &mut impl Rng) -> Vec3 {
    let mut coordinate = || rng.random_range(-1.0_f32..1.0);
    Vec3::new(coordinate(), coordinate(), coordinate())
}
