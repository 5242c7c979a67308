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
    /// All sampled points, and those whose surface is roughly level.
    samples: Vec<Vec3>,
    level: Vec<Vec3>,
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

impl FloorFinder {
    pub(super) fn new(config: FloorConfig) -> Self {
        Self { config, last: None, samples: Vec::new(), level: Vec::new() }
    }

    pub(super) fn find(&mut self, coarse: &Coarse, tolerance: &Tolerance) -> Option<FloorPlane> {
        self.take_samples(coarse, tolerance);
        self.last = self
            .last
            .and_then(|plane| self.settle(plane, tolerance))
            .or_else(|| {
                self.search(tolerance)
                    .and_then(|plane| self.settle(plane, tolerance))
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
                self.samples.push(point);
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
                    self.level.push(point);
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
            let [a, b, c] = [0; 3].map(|_| self.level[random.below(self.level.len())]);
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
    fn settle(&self, mut plane: FloorPlane, tolerance: &Tolerance) -> Option<FloorPlane> {
        for _ in 0..3 {
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

    fn support(&self, plane: FloorPlane, points: &[Vec3], tolerance: &Tolerance) -> Support {
        let mut support = Support::default();
        for &point in points {
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

    /// Least squares of y = a x + b z + c over the samples near a plane, each by its noise.
    fn fit_around(&self, plane: FloorPlane, tolerance: &Tolerance) -> Option<FloorPlane> {
        let (mut lhs, mut rhs) = (DMat3::ZERO, DVec3::ZERO);
        let (mut weights, mut sum, mut squares) = (0.0, DVec3::ZERO, DVec3::ZERO);
        for &point in &self.samples {
            let near_m = self.near_m(point, plane, tolerance);
            if plane.height_m(point).abs() >= near_m {
                continue;
            }
            let weight = f64::from(1.0 / (near_m * near_m));
            let point = point.as_dvec3();
            let row = DVec3::new(point.x, point.z, 1.0);
            lhs += DMat3::from_cols(row * row.x, row * row.y, row * row.z) * weight;
            rhs += row * point.y * weight;
            weights += weight;
            sum += point * weight;
            squares += point * point * weight;
        }
        let spread = (squares / weights - (sum / weights).powf(2.0))
            .max(DVec3::ZERO)
            .powf(0.5);
        // NaN, of no samples, fails too.
        let wide = spread.x > f64::from(MIN_SPREAD_M) && spread.z > f64::from(MIN_SPREAD_M);
        if !wide {
            return None;
        }
        let [a, b, c] = (lhs.inverse() * rhs).to_array();
        let normal = DVec3::new(a, -1.0, b);
        let length = normal.length();
        let plane =
            FloorPlane { normal: (normal / length).as_vec3(), offset_m: (-c / length) as f32 };
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
