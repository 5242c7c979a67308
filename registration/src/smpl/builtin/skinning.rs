//! Skinning weights of the built-in body: each joint takes over along its bone, then weights diffuse on the surface.

use glam::Vec3;

use super::subdivide::PolygonSurface;
use crate::smpl::{JOINT_COUNT, VertexWeights, mirror::MIRROR_JOINT};

/// Weights are multiples of this, so that rounding differences between machines vanish.
const WEIGHT_STEPS: f32 = 65535.0;
/// Weights below this are cut.
const SMALLEST_WEIGHT: f32 = 0.004;
/// Rounds of averaging with the neighbours: about the square root of that many edge lengths of blur.
const SKINNING_ROUNDS: usize = 6;
/// Shapes blend more gently than bones do.
const SHAPE_ROUNDS: usize = 30;

type Weights = [f32; JOINT_COUNT];

/// Dense weights of every vertex, for skinning and, smoother, for shapes.
pub(super) struct Skin {
    pub(super) weights: Vec<Weights>,
    pub(super) shape_weights: Vec<Weights>,
}

impl Skin {
    pub(super) fn new(
        vertices: &[Vec3],
        surface: &PolygonSurface,
        joints: &[Vec3; JOINT_COUNT],
    ) -> Self {
        let start: Vec<Weights> = vertices
            .iter()
            .zip(&surface.points)
            .map(|(vertex, point)| anatomical(*vertex, point.w, joints))
            .collect();
        let neighbours = neighbours(vertices.len(), &surface.faces);
        let weights = diffused(start, &neighbours, SKINNING_ROUNDS);
        let shape_weights = diffused(weights.clone(), &neighbours, SHAPE_ROUNDS);
        Self { weights, shape_weights }
    }

    /// The four largest weights of each vertex, renormalised; the right side mirrors the left.
    pub(super) fn sparse(&self, mirror: &[u32]) -> Vec<VertexWeights> {
        let mut rows: Vec<VertexWeights> = self.weights.iter().map(sparse).collect();
        for (i, &other) in mirror.iter().enumerate() {
            if (other as usize) < i {
                rows[i] = rows[other as usize];
                for bone in &mut rows[i].bones {
                    *bone = MIRROR_JOINT[*bone as usize] as u8;
                }
            }
        }
        rows
    }
}

/// Weights from where the vertex lies beside its limb's joints; written for the left side.
fn anatomical(vertex: Vec3, arm_tag: f32, joints: &[Vec3; JOINT_COUNT]) -> Weights {
    let left = Vec3::new(vertex.x.abs(), vertex.y, vertex.z);
    let mut weights = [0.0; JOINT_COUNT];
    let shoulder = joints[16];
    let over_shoulder = left.x - shoulder.x + 0.3 * (left.y - shoulder.y);
    let arm = ramp(over_shoulder, 0.045) * (arm_tag * 5.0).min(1.0);
    let groin = left.y - (joints[1].y - 0.062 + 0.9 * left.x);
    let leg = (1.0 - arm) * ramp(-groin, 0.07);
    add_trunk(&mut weights, left, 1.0 - arm - leg, joints);
    add_arm(&mut weights, left, arm, joints);
    let across = ramp(left.x, 0.02);
    let mut legs = [0.0; JOINT_COUNT];
    add_leg(&mut legs, left, leg, joints);
    for joint in 0..JOINT_COUNT {
        weights[joint] += legs[joint] * across;
        weights[MIRROR_JOINT[joint]] += legs[joint] * (1.0 - across);
    }
    if vertex.x < 0.0 {
        return std::array::from_fn(|joint| weights[MIRROR_JOINT[joint]]);
    }
    weights
}

fn add_trunk(weights: &mut Weights, v: Vec3, share: f32, joints: &[Vec3; JOINT_COUNT]) {
    let neck_plane = v.y - joints[12].y + 0.5 * (v.z - joints[12].z);
    let head_plane = v.y - joints[15].y + 0.35 * (v.z - joints[15].z);
    let mut chain = [
        (0, 1.0),
        (3, ramp(v.y - joints[3].y, 0.07)),
        (6, ramp(v.y - joints[6].y, 0.06)),
        (9, ramp(v.y - joints[9].y, 0.06)),
        (12, ramp(neck_plane, 0.035)),
        (15, ramp(head_plane, 0.035)),
    ];
    hand_over(&mut chain);
    let high = ramp(v.y - joints[13].y, 0.08);
    let collar = chain[3].1 * ramp(v.x - joints[13].x, 0.06) * high;
    chain[3].1 -= collar;
    for (joint, weight) in chain {
        weights[joint] += share * weight;
    }
    weights[13] += share * collar;
}

fn add_arm(weights: &mut Weights, v: Vec3, share: f32, joints: &[Vec3; JOINT_COUNT]) {
    let mut chain = [
        (16, 1.0),
        (18, ramp(v.x - joints[18].x, 0.04)),
        (20, ramp(v.x - joints[20].x, 0.025)),
        (22, ramp(v.x - joints[22].x, 0.03)),
    ];
    hand_over(&mut chain);
    for (joint, weight) in chain {
        weights[joint] += share * weight;
    }
}

fn add_leg(weights: &mut Weights, v: Vec3, share: f32, joints: &[Vec3; JOINT_COUNT]) {
    // The ankle's plane tilts so that the heel goes with the foot and the shin does not.
    let below_ankle = joints[7].y - v.y + 0.35 * (v.z - joints[7].z);
    let mut chain = [
        (1, 1.0),
        (4, ramp(joints[4].y - v.y, 0.05)),
        (7, ramp(below_ankle, 0.03)),
        (
            10,
            ramp(v.z - joints[10].z, 0.025) * ramp(below_ankle, 0.03),
        ),
    ];
    hand_over(&mut chain);
    for (joint, weight) in chain {
        weights[joint] += share * weight;
    }
}

/// Turns "beyond this joint" shares along a chain into weights that sum to one.
fn hand_over(chain: &mut [(usize, f32)]) {
    let mut left_over = 1.0;
    for i in (0..chain.len()).rev() {
        let weight = chain[i].1 * left_over;
        left_over -= weight;
        chain[i].1 = weight;
    }
}

/// Smooth step from 0 at `-half_width_m` to 1 at `half_width_m`.
fn ramp(distance_m: f32, half_width_m: f32) -> f32 {
    let t = (0.5 + 0.5 * distance_m / half_width_m).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

fn neighbours(count: usize, quads: &[Vec<u32>]) -> Vec<Vec<u32>> {
    let mut lists = vec![Vec::new(); count];
    for quad in quads {
        for (i, &from) in quad.iter().enumerate() {
            // Each edge is seen once in each direction, by the two faces beside it.
            lists[from as usize].push(quad[(i + 1) % quad.len()]);
        }
    }
    lists
}

fn diffused(mut weights: Vec<Weights>, neighbours: &[Vec<u32>], rounds: usize) -> Vec<Weights> {
    for _ in 0..rounds {
        weights = (0..weights.len())
            .map(|i| {
                let mut sum = weights[i].map(|w| w * neighbours[i].len() as f32);
                for &other in &neighbours[i] {
                    for (s, w) in sum.iter_mut().zip(&weights[other as usize]) {
                        *s += w;
                    }
                }
                sum.map(|s| s / (2 * neighbours[i].len()) as f32)
            })
            .collect();
    }
    weights
}

fn sparse(dense: &Weights) -> VertexWeights {
    let mut order: [usize; JOINT_COUNT] = std::array::from_fn(|i| i);
    order.sort_by(|&a, &b| dense[b].total_cmp(&dense[a]).then(a.cmp(&b)));
    let mut row = VertexWeights::default();
    for slot in 0..4 {
        if dense[order[slot]] >= SMALLEST_WEIGHT {
            row.bones[slot] = order[slot] as u8;
            row.weights[slot] = dense[order[slot]];
        }
    }
    let total: f32 = row.weights.iter().sum();
    let mut steps = row.weights.map(|w| (w / total * WEIGHT_STEPS).round());
    steps[0] = WEIGHT_STEPS - steps[1] - steps[2] - steps[3];
    row.weights = steps.map(|s| s / WEIGHT_STEPS);
    row
}
