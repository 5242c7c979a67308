//! What a body model does not know about somebody: a smooth surface of their own, and flesh that moves.

use effigy_registration::{BodyModel, smpl::JOINT_COUNT};
use glam::Vec3;

use super::{anthropometry::Adult, chart::Chart, flesh::Flesh};
use crate::random::Randomness;

/// One person beyond betas.
#[derive(Clone, Debug)]
pub struct Individual {
    pub adult: Adult,
    /// From the body model's surface to this person's, zero pose.
    pub offsets: Vec<Vec3>,
    pub(super) flesh: Flesh,
}

/// Swellings and hollows a person has, each with its mirror image.
const SWELLINGS: u64 = 36;
/// Their reach in metres, and how different left and right are.
const REACH_M: [f32; 2] = [0.05, 0.14];
const ASYMMETRY: f32 = 0.25;
/// Root mean square of the offsets over the body, hands, feet and face excluded.
const OFFSET_RMS_M: [f32; 2] = [0.0025, 0.0050];

impl Individual {
    /// Somebody by number, on the minimal body of `adult`.
    pub(super) fn new(body: &BodyModel, adult: Adult, chart: &Chart, seed: u64) -> Self {
        let offsets = offsets(chart, seed);
        let flesh = Flesh::new(body, chart, &adult, seed);
        Self { adult, offsets, flesh }
    }
}

fn offsets(chart: &Chart, seed: u64) -> Vec<Vec3> {
    let random = Randomness::new(seed, 0, 0x0ff);
    let count = chart.vertices.len();
    let plain: Vec<f32> = chart.places.iter().map(plainness).collect();
    let mut heights = vec![0.0f32; count];
    for swelling in 0..SWELLINGS {
        let at = swelling * 8;
        let center = chart.vertices[(random.uniform(at) * count as f32) as usize % count];
        let reach_m = random.between(at + 1, REACH_M[0], REACH_M[1]);
        let height = random.gaussian(at + 2);
        let twin = height * (1.0 + ASYMMETRY * random.gaussian(at + 3));
        let mirrored = Vec3::new(-center.x, center.y, center.z);
        for (vertex, out) in chart.vertices.iter().zip(&mut heights) {
            for (center, height) in [(center, height), (mirrored, twin)] {
                let away2 = vertex.distance_squared(center) / (reach_m * reach_m);
                if away2 < 9.0 {
                    *out += height * (-0.5 * away2).exp();
                }
            }
        }
    }
    let square: f32 = heights.iter().zip(&plain).map(|(h, p)| h * h * p * p).sum();
    let total: f32 = plain.iter().map(|p| p * p).sum();
    let rms = (square / total.max(1.0)).sqrt().max(1e-6);
    let scale = random.between(SWELLINGS * 8, OFFSET_RMS_M[0], OFFSET_RMS_M[1]) / rms;
    (0..count)
        .map(|v| chart.smooth_normals[v] * heights[v] * plain[v] * scale)
        .collect()
}

/// 1 where flesh is smooth, less on faces, hands and feet, which have details of their own.
fn plainness(place: &super::chart::Place) -> f32 {
    let hand = ((place.arm - 1.9) / 0.15).clamp(0.0, 1.0) * place.arm_share;
    (1.0 - 0.7 * place.head_share) * (1.0 - hand) * (1.0 - place.foot_share).max(0.0)
}

/// The betas whose body lies nearest to a surface in the zero pose, vertex by vertex.
pub(crate) fn best_betas(body: &BodyModel, surface: &[Vec3]) -> [f32; 10] {
    let mut normal = [[0.0f64; 11]; 10];
    for (v, vertex) in surface.iter().enumerate() {
        let off = (*vertex - body.template[v]).as_dvec3();
        let directions: [_; 10] = std::array::from_fn(|i| body.shape_dirs[i][v].as_dvec3());
        for (row, direction) in normal.iter_mut().zip(&directions) {
            for (cell, other) in row.iter_mut().zip(&directions) {
                *cell += direction.dot(*other);
            }
            row[10] += direction.dot(off);
        }
    }
    solved(normal).map(|beta| beta as f32)
}

/// Gaussian elimination of a small positive definite system; the last column is the right-hand side.
fn solved(mut rows: [[f64; 11]; 10]) -> [f64; 10] {
    for pivot in 0..10 {
        let lead = rows[pivot];
        for row in rows.iter_mut().skip(pivot + 1) {
            let share = row[pivot] / lead[pivot];
            for (cell, of_lead) in row.iter_mut().zip(&lead).skip(pivot) {
                *cell -= share * of_lead;
            }
        }
    }
    let mut solution = [0.0; 10];
    for pivot in (0..10).rev() {
        let known: f64 = (pivot + 1..10).map(|k| rows[pivot][k] * solution[k]).sum();
        solution[pivot] = (rows[pivot][10] - known) / rows[pivot][pivot];
    }
    solution
}

/// Where a joint of a chart is; the order is SMPL's.
pub(super) fn between(joints: &[Vec3; JOINT_COUNT], from: usize, to: usize, share: f32) -> Vec3 {
    joints[from].lerp(joints[to], share)
}
