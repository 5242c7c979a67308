//! The floor: the lowest large plane that is roughly level.

use glam::{DMat3, DVec3, Vec3};
use serde::{Deserialize, Serialize};

use super::{super::tolerance::Tolerance, coarse::Coarse};
use crate::{clean::FloorPlane, mesh::sample::SplitMix};

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct FloorConfig {
    /// How far the camera may be tilted against the floor.
    pub max_tilt_deg: f32,
    /// The camera's height above the floor.
    pub camera_height_m: [f32; 2],
    /// Planes tried when there is none from the frame before: with a third of the candidates on the floor,
    /// one in 27 triples is good.
    pub hypotheses: usize,
    /// Samples on the floor, of one every [`SAMPLE_STEP`] cells: fewer are a box or a shoe.
    pub min_samples: usize,
    /// How uneven a floor may be, beside the sensor's noise.
    pub unevenness_m: f32,
    pub seed: u64,
}

impl Default for FloorConfig {
    fn default() -> Self {
        Self {
            max_tilt_deg: 32.0,
            camera_height_m: [0.2, 3.0],
            hypotheses: 150,
            min_samples: 60,
            unevenness_m: 0.012,
            seed: 0,
        }
    }
}

/// Cells between samples, in both directions.
const SAMPLE_STEP: usize = 4;
/// Cells between a sample and what is looked at above it.
const ABOVE: usize = 5;
/// Cells between the points a sample's normal is taken from.
const REACH: usize = 2;
/// A floor seen from a metre above, 8 m away.
const FLOOR_SLOPE: f32 = 8.0;
/// A sample this far below a plane speaks against it being the floor.
const BELOW_M: f32 = 0.08;
/// The floor must spread this far along both its directions, as a standard deviation.
const MIN_SPREAD_M: f32 = 0.12;
/// Straight up in the image.
const UP: Vec3 = Vec3::NEG_Y;

/// Finds the floor, starting from where it was.
#[derive(Clone, Debug)]
pub(super) struct FloorFinder {
    config: FloorConfig,
    last: Option<FloorPlane>,
    samples: Vec<Sample>,
    /// Samples whose surface is roughly level.
    level: Vec<Sample>,
}

#[derive(Clone, Copy, Debug)]
struct Sample {
    point: Vec3,
    /// What is seen a little higher in the image.
    above: Vec3,
}

#[derive(Clone, Copy, Debug, Default)]
struct Support {
    inliers: usize,
    below: usize,
}

impl Support {
    fn score(self) -> i64 {
        self.inliers as i64 - 2 * self.below as i64
    }
}

impl Sample {
    /// Whether the surface goes up from here instead of back: the foot of a wall, or a foot. They are as
    /// near to the floor as its noise, but always above it, and would lift the plane.
    fn rises(&self, plane: FloorPlane) -> bool {
        // The sample's own noise must not decide: where the plane says it is, is compared.
        let on_plane_m = |point: Vec3| plane.offset_m * point.z / plane.normal.dot(point);
        let here_m = on_plane_m(self.point);
        let expected_m = on_plane_m(self.above) - here_m;
        // NaN, of nothing above, does not rise; a plane that ends at the horizon is not level ground either.
        self.above.z - here_m < 0.5 * expected_m || expected_m < 0.0
    }
}

impl FloorFinder {
    pub(super) fn new(config: FloorConfig) -> Self {
        Self { config, last: None, samples: Vec::new(), level: Vec::new() }
    }

    pub(super) fn find(&mut self, coarse: &Coarse, tolerance: &Tolerance) -> Option<FloorPlane> {
        self.take_samples(coarse, tolerance);
        self.last = self
            .last
            .and_then(|plane| self.settle(plane, 1, tolerance))
            .or_else(|| {
                self.search(tolerance)
                    .and_then(|plane| self.settle(plane, 1, tolerance))
            });
        self.last
    }

    fn take_samples(&mut self, coarse: &Coarse, tolerance: &Tolerance) {
        self.samples.clear();
        self.level.clear();
        let least_up = (self.config.max_tilt_deg + 10.0).to_radians().cos();
        for y in (REACH..coarse.height.saturating_sub(REACH)).step_by(SAMPLE_STEP) {
            for x in (REACH..coarse.width.saturating_sub(REACH)).step_by(SAMPLE_STEP) {
                let cell = y * coarse.width + x;
                let point = coarse.points[cell];
                if point.z.is_nan() {
                    continue;
                }
                let above = cell
                    .checked_sub(ABOVE * coarse.width)
                    .map(|cell| coarse.points[cell]);
                let sample = Sample { point, above: above.unwrap_or(Vec3::NAN) };
                self.samples.push(sample);
                let around = [cell - REACH, cell + REACH]
                    .into_iter()
                    .chain([cell - REACH * coarse.width, cell + REACH * coarse.width])
                    .map(|cell| coarse.points[cell]);
                let limit_m = tolerance.step_m(point.z, 2.0 * REACH as f32, FLOOR_SLOPE, 4.0);
                // A NaN is not below the limit.
                if !around
                    .clone()
                    .all(|near| (near.z - point.z).abs() < limit_m)
                {
                    continue;
                }
                let [left, right, above, below] =
                    [0, 1, 2, 3].map(|index| around.clone().nth(index).unwrap_or(point));
                let normal = (below - above).cross(right - left).normalize_or_zero();
                if normal.dot(UP) > least_up {
                    self.level.push(sample);
                }
            }
        }
    }

    /// The best plane through three level samples (Fischler and Bolles 1981).
    fn search(&self, tolerance: &Tolerance) -> Option<FloorPlane> {
        if self.level.len() < self.config.min_samples {
            return None;
        }
        let mut random = SplitMix::new(self.config.seed);
        let mut best: Option<(i64, FloorPlane)> = None;
        for _ in 0..self.config.hypotheses {
            let [a, b, c] = [0; 3].map(|_| self.level[random.below(self.level.len())].point);
            let Some(plane) = plane_through(a, b, c).filter(|plane| self.is_plausible(*plane))
            else {
                continue;
            };
            let score = self.support(plane, &self.level, tolerance).score();
            if best.is_none_or(|(most, _)| score > most) {
                best = Some((score, plane));
            }
        }
        best.map(|(_, plane)| plane)
    }

    /// Fits a plane to the samples around it; `None` if too few of them agree, or too many lie below.
    fn settle(
        &self,
        mut plane: FloorPlane,
        rounds: usize,
        tolerance: &Tolerance,
    ) -> Option<FloorPlane> {
        for _ in 0..rounds {
            plane = self
                .fit_around(plane, tolerance)
                .filter(|plane| self.is_plausible(*plane))?;
        }
        let support = self.support(plane, &self.samples, tolerance);
        let enough = support.inliers >= self.config.min_samples;
        let lowest = support.below * 4 < support.inliers;
        (enough && lowest).then_some(plane)
    }

    fn is_plausible(&self, plane: FloorPlane) -> bool {
        let [lowest, highest] = self.config.camera_height_m;
        let tilt_rad = plane.normal.dot(UP).clamp(-1.0, 1.0).acos();
        tilt_rad < self.config.max_tilt_deg.to_radians()
            && (lowest..=highest).contains(&-plane.offset_m)
    }

    fn support(&self, plane: FloorPlane, samples: &[Sample], tolerance: &Tolerance) -> Support {
        let mut support = Support::default();
        for &Sample { point, .. } in samples {
            let height_m = plane.height_m(point);
            let near_m = self.near_m(point, plane, tolerance);
            support.inliers += usize::from(height_m.abs() < near_m);
            support.below += usize::from(height_m < -BELOW_M - near_m);
        }
        support
    }

    /// How far from the plane a sample of it may lie.
    fn near_m(&self, point: Vec3, plane: FloorPlane, tolerance: &Tolerance) -> f32 {
        self.config.unevenness_m + 2.5 * noise_across_m(point, plane, tolerance)
    }

    /// Least squares over the samples near a plane, each by its noise.
    ///
    /// A plane `n . p = o` seen along rays `p = z r` is `1 / z = (n / o) . r`: linear, and with all of the
    /// sensor's noise on the left. Fitting heights instead would tilt the plane, as depth is noisy too.
    fn fit_around(&self, plane: FloorPlane, tolerance: &Tolerance) -> Option<FloorPlane> {
        let (mut lhs, mut rhs) = (DMat3::ZERO, DVec3::ZERO);
        let (mut weights, mut sum, mut squares) = (0.0, DVec3::ZERO, DVec3::ZERO);
        for sample in &self.samples {
            let point = sample.point;
            let near_m = self.near_m(point, plane, tolerance);
            if plane.height_m(point).abs() >= near_m || sample.rises(plane) {
                continue;
            }
            let point = point.as_dvec3();
            let ray = point / point.z;
            // A difference in inverse depth is a height divided by depth and by the plane's offset.
            let weight = (point.z / f64::from(near_m)).powi(2);
            lhs += DMat3::from_cols(ray * ray.x, ray * ray.y, ray * ray.z) * weight;
            rhs += ray * (weight / point.z);
            weights += 1.0;
            sum += point;
            squares += point * point;
        }
        let variance = squares / weights - (sum / weights) * (sum / weights);
        let least = f64::from(MIN_SPREAD_M * MIN_SPREAD_M);
        // NaN, of no samples, fails too.
        let wide = variance.x > least && variance.z > least;
        if !wide {
            return None;
        }
        let scaled = lhs.inverse() * rhs;
        // The camera is above the floor, so the offset along the normal up is negative.
        let offset = -scaled.length().recip();
        let plane = FloorPlane { normal: (scaled * offset).as_vec3(), offset_m: offset as f32 };
        (plane.normal.is_finite() && plane.offset_m.is_finite()).then_some(plane)
    }
}

impl FloorPlane {
    /// How far above the floor a point is.
    #[inline]
    pub fn height_m(self, point: Vec3) -> f32 {
        self.normal.dot(point) - self.offset_m
    }
}

/// The sensor's noise at a point, seen along the plane's normal: what a grazing ray leaves of it.
pub(super) fn noise_across_m(point: Vec3, plane: FloorPlane, tolerance: &Tolerance) -> f32 {
    tolerance.sigma_m(point.z) * (plane.normal.dot(point) / point.z).abs()
}

fn plane_through(a: Vec3, b: Vec3, c: Vec3) -> Option<FloorPlane> {
    let normal = (b - a).cross(c - a).try_normalize()?;
    let normal = if normal.dot(UP) < 0.0 {
        -normal
    } else {
        normal
    };
    Some(FloorPlane { normal, offset_m: normal.dot(a) })
}
