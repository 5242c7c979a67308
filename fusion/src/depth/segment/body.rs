//! Which parts of the scene have a human body's measures.

use glam::{Mat3, Vec3};
use serde::{Deserialize, Serialize};

use super::{
    super::tolerance::Tolerance,
    coarse::Coarse,
    label::{Labels, NO_LABEL},
    planarity, split,
};
use crate::clean::FloorPlane;

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct BodyConfig {
    /// Surface turned to the camera: from a head and shoulders to somebody large in a coat.
    pub area_m2: [f32; 2],
    /// From top to bottom.
    pub height_m: [f32; 2],
    /// From left to right: arms stretched out and something in the hands.
    pub max_width_m: f32,
    /// Standard deviation about the best plane through it, beside the noise: thinner things are walls,
    /// doors and screens.
    pub min_thickness_m: f32,
    /// The second largest standard deviation: less is a pole.
    pub min_breadth_m: f32,
    /// Higher above the floor than this nobody hangs.
    pub max_clearance_m: f32,
    /// Lower things that are not cut off by the image are probably furniture: they must be this much
    /// nearer than a body to be taken for one.
    pub low_penalty_m: f32,
    pub low_below_m: f32,
    /// Share of a part on one plane (within a distance, and 1.5 sigma) that makes it doubtful or impossible
    /// as a person: real backs and coats reach 0.5. Not judged where noise widens the band too far.
    pub flat_share: [f32; 2],
    pub flat_within_m: f32,
    pub judge_flatness_below_m: f32,
    /// A doubtful part must be this much nearer than a body to be taken for one.
    pub flat_penalty_m: f32,
    /// The followed person is looked for within this distance of where they were.
    pub follow_within_m: f32,
    /// Frames to wait for the followed person before following another.
    pub wait_frames: u32,
    /// A part at least this large, and not wider than a group of people, may be several.
    pub crowd_area_m2: f32,
    pub max_crowd_width_m: f32,
    /// Parts a body owns though a step in depth divides them: their largest share of its size, and how far
    /// they may be behind and before it.
    pub max_fragment_share: f32,
    pub fragment_behind_m: f32,
    pub fragment_before_m: f32,
    /// The same for the other half of a body cut by its own hand and a hem: above or below, and no farther apart.
    pub max_half_share: f32,
    pub half_apart_m: f32,
}

impl Default for BodyConfig {
    fn default() -> Self {
        Self {
            area_m2: [0.05, 2.0],
            height_m: [0.35, 2.5],
            max_width_m: 2.4,
            min_thickness_m: 0.02,
            min_breadth_m: 0.04,
            max_clearance_m: 1.2,
            low_penalty_m: 2.0,
            low_below_m: 1.1,
            flat_share: [0.57, 0.75],
            flat_within_m: 0.01,
            judge_flatness_below_m: 0.03,
            flat_penalty_m: 3.0,
            follow_within_m: 0.6,
            wait_frames: 15,
            crowd_area_m2: 0.6,
            max_crowd_width_m: 4.0,
            max_fragment_share: 0.3,
            fragment_behind_m: 0.15,
            fragment_before_m: 0.5,
            max_half_share: 2.0,
            half_apart_m: 0.35,
        }
    }
}

/// More people than this shoulder to shoulder are not told apart.
const MAX_CROWD: f32 = 3.0;

/// A part of the scene that may be a person.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Body {
    pub(super) label: u32,
    /// In camera space.
    pub centroid: Vec3,
    pub area_m2: f32,
    /// Above the floor, or above the camera where no floor is seen: the lowest and the highest point.
    pub span_m: [f32; 2],
    pub width_m: f32,
    /// Distance, and what speaks against it being a person: the least is taken first.
    pub(super) rank_m: f32,
}

/// Sums over the cells of a part.
#[derive(Clone, Debug)]
struct Moments {
    count: f64,
    area_m2: f32,
    sum: glam::DVec3,
    squares: glam::DMat3,
    left_m: f32,
    right_m: f32,
    at_border: bool,
    heights_m: Vec<f32>,
    points: Vec<Vec3>,
}

pub(super) fn find(
    coarse: &Coarse,
    labels: &mut Labels,
    floor: Option<FloorPlane>,
    tolerance: &Tolerance,
    config: &BodyConfig,
) -> Vec<Body> {
    let mut moments = measure(coarse, labels, floor, tolerance, config);
    let mut several = false;
    for (label, moments) in moments.iter().enumerate() {
        let crowded = moments.area_m2 > config.crowd_area_m2
            && moments.right_m - moments.left_m <= config.max_crowd_width_m;
        several |= crowded && split::split_people(coarse, labels, label as u32, floor);
    }
    if several {
        moments = measure(coarse, labels, floor, tolerance, config);
    }
    moments
        .into_iter()
        .enumerate()
        .filter_map(|(label, moments)| moments.body(label as u32, floor, tolerance, config))
        .collect()
}

fn measure(
    coarse: &Coarse,
    labels: &Labels,
    floor: Option<FloorPlane>,
    tolerance: &Tolerance,
    config: &BodyConfig,
) -> Vec<Moments> {
    let up = floor.unwrap_or(FloorPlane { normal: Vec3::NEG_Y, offset_m: 0.0 });
    // Walls are most of an image, and need no more than their area.
    let areas_m2 = areas(coarse, labels, tolerance);
    let most_m2 = MAX_CROWD * config.area_m2[1];
    let plausible: Vec<bool> = areas_m2
        .iter()
        .map(|area| (config.area_m2[0]..=most_m2).contains(area))
        .collect();
    let mut moments = vec![Moments::default(); labels.sizes.len()];
    for y in 0..coarse.height {
        for x in 0..coarse.width {
            let cell = y * coarse.width + x;
            let label = labels.of_cell(cell);
            if label == NO_LABEL || !plausible[label as usize] {
                continue;
            }
            let rim = x < 2 || y < 2 || x + 2 >= coarse.width || y + 2 >= coarse.height;
            let size_m = coarse.cell_size_m(cell, tolerance);
            moments[label as usize].add(coarse.points[cell], size_m * size_m, rim);
            moments[label as usize]
                .heights_m
                .push(up.height_m(coarse.points[cell]));
        }
    }
    moments
}

fn areas(coarse: &Coarse, labels: &Labels, tolerance: &Tolerance) -> Vec<f32> {
    let mut areas_m2 = vec![0.0; labels.sizes.len()];
    for cell in 0..coarse.points.len() {
        let label = labels.of_cell(cell);
        if label != NO_LABEL {
            let size_m = coarse.cell_size_m(cell, tolerance);
            areas_m2[label as usize] += size_m * size_m;
        }
    }
    areas_m2
}

impl Default for Moments {
    fn default() -> Self {
        Self {
            count: 0.0,
            area_m2: 0.0,
            sum: glam::DVec3::ZERO,
            squares: glam::DMat3::ZERO,
            left_m: f32::INFINITY,
            right_m: f32::NEG_INFINITY,
            at_border: false,
            heights_m: Vec::new(),
            points: Vec::new(),
        }
    }
}

impl Moments {
    fn add(&mut self, point: Vec3, area_m2: f32, rim: bool) {
        self.points.push(point);
        let wide = point.as_dvec3();
        self.count += 1.0;
        self.area_m2 += area_m2;
        self.sum += wide;
        self.squares += glam::DMat3::from_cols(wide * wide.x, wide * wide.y, wide * wide.z);
        self.left_m = self.left_m.min(point.x);
        self.right_m = self.right_m.max(point.x);
        self.at_border |= rim;
    }

    /// The part as a body, if its measures are one's.
    fn body(
        mut self,
        label: u32,
        floor: Option<FloorPlane>,
        tolerance: &Tolerance,
        config: &BodyConfig,
    ) -> Option<Body> {
        let within = |range: [f32; 2], value: f32| (range[0]..=range[1]).contains(&value);
        if self.count == 0.0 || !within(config.area_m2, self.area_m2) {
            return None;
        }
        let width_m = self.right_m - self.left_m;
        let span_m = [self.height_at(0.005), self.height_at(0.995)];
        let height_m = span_m[1] - span_m[0];
        let centroid = (self.sum / self.count).as_vec3();
        let noise_m = 1.2 * tolerance.sigma_m(centroid.z);
        let [thickness2, breadth2, _] = variances(&self.covariance());
        let min_thickness2 = config.min_thickness_m * config.min_thickness_m + noise_m * noise_m;
        let hangs = floor.is_some() && span_m[0] > config.max_clearance_m;
        let fits = within(config.height_m, height_m)
            && width_m <= config.max_width_m
            && thickness2 >= min_thickness2
            && breadth2 >= config.min_breadth_m * config.min_breadth_m
            && !hangs;
        if !fits {
            return None;
        }
        let low = height_m < config.low_below_m && !self.at_border;
        let low_m = if low { config.low_penalty_m } else { 0.0 };
        let flat_m = self.flat_penalty_m(tolerance.sigma_m(centroid.z), config)?;
        Some(Body {
            label,
            centroid,
            area_m2: self.area_m2,
            span_m,
            width_m,
            rank_m: centroid.length() + low_m + flat_m,
        })
    }

    /// What flatness speaks against this being a person; `None` if it cannot be one.
    fn flat_penalty_m(&self, sigma_m: f32, config: &BodyConfig) -> Option<f32> {
        let within_m = config.flat_within_m + 1.5 * sigma_m;
        if within_m > config.judge_flatness_below_m {
            return Some(0.0);
        }
        let share = planarity::flat_share(&self.points, within_m);
        let [doubtful, impossible] = config.flat_share;
        if share > impossible {
            return None;
        }
        Some(if share > doubtful {
            config.flat_penalty_m
        } else {
            0.0
        })
    }

    /// The height below which that share of the cells lies.
    fn height_at(&mut self, share: f32) -> f32 {
        let index = ((self.heights_m.len() - 1) as f32 * share) as usize;
        *self
            .heights_m
            .select_nth_unstable_by(index, f32::total_cmp)
            .1
    }

    fn covariance(&self) -> Mat3 {
        let mean = self.sum / self.count;
        let squares = self.squares * (1.0 / self.count);
        let covariance =
            squares - glam::DMat3::from_cols(mean * mean.x, mean * mean.y, mean * mean.z);
        covariance.as_mat3()
    }
}

/// The eigenvalues of a symmetric matrix, smallest first (Smith 1961).
fn variances(matrix: &Mat3) -> [f32; 3] {
    let mean = (matrix.x_axis.x + matrix.y_axis.y + matrix.z_axis.z) / 3.0;
    let centered = *matrix - Mat3::from_diagonal(Vec3::splat(mean));
    let spread = [centered.x_axis, centered.y_axis, centered.z_axis]
        .iter()
        .map(|axis| axis.length_squared())
        .sum::<f32>();
    let spread = (spread / 6.0).sqrt();
    if spread == 0.0 {
        return [mean; 3];
    }
    let half_determinant = (centered * (1.0 / spread)).determinant() / 2.0;
    let angle = half_determinant.clamp(-1.0, 1.0).acos() / 3.0;
    let third = std::f32::consts::TAU / 3.0;
    let largest = mean + 2.0 * spread * angle.cos();
    let smallest = mean + 2.0 * spread * (angle + third).cos();
    [smallest, 3.0 * mean - largest - smallest, largest]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn variances_of_a_turned_box_are_its_squared_sides() {
        let turn = Mat3::from_euler(glam::EulerRot::XYZ, 0.3, -1.0, 0.7);
        let matrix = turn * Mat3::from_diagonal(Vec3::new(0.5, 0.02, 0.1)) * turn.transpose();
        for (found, expected) in variances(&matrix).into_iter().zip([0.02, 0.1, 0.5]) {
            assert!((found - expected).abs() < 1e-5, "{found}");
        }
    }
}
