//! Pose correctives: what linear blending loses at a bent joint, given back.
//!
//! Where a share `w` of a vertex follows a joint's rotation `R`, linear blending puts it at
//! `((1 - w) I + w R) (v - J)`, which collapses towards the joint. Blending the rotation as a quaternion
//! (Kavan et al. 2007) keeps the distance. Over sampled rotations the difference, pulled back to the zero
//! pose, is regressed on `R - I`: a 3x3 matrix a unit of each of its nine entries, for every `w`.
//!
//! Only `+ - * /` and square roots are used: the numbers, and so the body's identity, are the same everywhere.

use glam::{DMat3, DQuat, DVec3, Vec3, dvec3, vec3};

use super::{on_grid, skinning::Skin};
use crate::smpl::{JOINT_COUNT, PARENTS, PoseDirection, mirror::MIRROR_JOINT};

/// Weights are tabulated in this many steps.
const WEIGHT_STEPS: usize = 32;
/// Offsets below this, in metres a unit, are left out.
const SMALLEST_OFFSET_M: f32 = 4e-4;
/// Share of the correction kept on the inner side of a hinge, where flesh gives way instead.
const INNER_SIDE: f32 = 0.7;
/// Ridge of the regression, as a share of the number of samples.
const RIDGE: f64 = 1e-3;
/// `tan(angle / 2)` for balls: 30, 60, 90 and 110 degrees.
const BALL_HALF_TANGENTS: [f64; 4] = [0.268, 0.577, 1.0, 1.428];
/// The same for hinges: 60, 90, 120, 130 and 140 degrees; deep bends lose most.
const HINGE_HALF_TANGENTS: [f64; 5] = [0.577, 1.0, 1.732, 2.145, 2.747];

enum Kind {
    /// Bends about one axis (of the left side), towards `inner`.
    Hinge { axis: DVec3, inner: Vec3 },
    /// Turns every way up to the given number of `BALL_HALF_TANGENTS`.
    Ball { reach: usize },
}

/// Joints with correctives: left side and midline.
const JOINTS: [(usize, Kind); 8] = [
    (1, Kind::Ball { reach: 4 }),
    (4, Kind::Hinge { axis: DVec3::X, inner: Vec3::NEG_Z }),
    (7, Kind::Ball { reach: 2 }),
    (12, Kind::Ball { reach: 2 }),
    (15, Kind::Ball { reach: 2 }),
    (16, Kind::Ball { reach: 3 }),
    (18, Kind::Hinge { axis: DVec3::NEG_Y, inner: Vec3::Z }),
    (20, Kind::Ball { reach: 3 }),
];

/// For one weight: a matrix for each entry of `R - I`.
type Response = [DMat3; 9];

/// Sparse directions for the 207 inputs.
pub(super) fn pose_dirs(
    vertices: &[Vec3],
    skin: &Skin,
    joints: &[Vec3; JOINT_COUNT],
    mirror: &[u32],
) -> Vec<PoseDirection> {
    let mut directions = vec![PoseDirection::default(); 9 * (JOINT_COUNT - 1)];
    for (joint, kind) in &JOINTS {
        let table = responses(&rotations(kind));
        let below = below(*joint);
        for (i, vertex) in vertices.iter().enumerate() {
            let weights = &skin.weights[i];
            let share: f32 = (0..JOINT_COUNT)
                .filter(|&j| below[j])
                .map(|j| weights[j])
                .sum();
            let arm = *vertex - joints[*joint];
            let scale = inner_scale(kind, arm) * beside_midline(*joint, *vertex);
            let offsets =
                interpolated(&table, share).map(|m| (m * arm.as_dvec3()).as_vec3() * scale);
            add(&mut directions, *joint, i, offsets, mirror);
        }
    }
    for direction in &mut directions {
        sort(direction);
    }
    directions
}

/// Writes one vertex's offsets, and the mirrored ones on the other side.
fn add(
    directions: &mut [PoseDirection],
    joint: usize,
    vertex: usize,
    offsets: [Vec3; 9],
    mirror: &[u32],
) {
    let other = mirror[vertex] as usize;
    let on_midline = MIRROR_JOINT[joint] == joint;
    if offsets.iter().all(|o| o.length() < SMALLEST_OFFSET_M) || (on_midline && other < vertex) {
        return;
    }
    for (entry, offset) in offsets.into_iter().enumerate() {
        // Mirroring a rotation flips the sign of the entries that couple x with y or z.
        let flips = (entry / 3 == 0) != (entry % 3 == 0);
        let reflect = vec3(-1.0, 1.0, 1.0) * if flips { -1.0 } else { 1.0 };
        let mut push = |joint: usize, vertex: usize, offset: Vec3| {
            let offset = on_grid(offset);
            if offset != Vec3::ZERO {
                let direction = &mut directions[(joint - 1) * 9 + entry];
                direction.vertices.push(vertex as u32);
                direction.offsets.push(offset);
            }
        };
        if on_midline && other == vertex {
            push(joint, vertex, (offset + offset * reflect) * 0.5);
        } else {
            push(joint, vertex, offset);
            push(MIRROR_JOINT[joint], other, on_grid(offset) * reflect);
        }
    }
}

fn sort(direction: &mut PoseDirection) {
    let mut pairs: Vec<(u32, Vec3)> = direction
        .vertices
        .iter()
        .copied()
        .zip(direction.offsets.iter().copied())
        .collect();
    pairs.sort_by_key(|pair| pair.0);
    (direction.vertices, direction.offsets) = pairs.into_iter().unzip();
}

/// Which joints a joint carries, itself included.
fn below(joint: usize) -> [bool; JOINT_COUNT] {
    let mut below = [false; JOINT_COUNT];
    below[joint] = true;
    for j in joint + 1..JOINT_COUNT {
        below[j] = below[PARENTS[j]];
    }
    below
}

fn inner_scale(kind: &Kind, arm: Vec3) -> f32 {
    match kind {
        Kind::Ball { .. } => 1.0,
        Kind::Hinge { inner, .. } => {
            // Over two centimetres from the joint's centre towards the inner side.
            let inside = (arm.dot(*inner) / 0.02).clamp(0.0, 1.0);
            1.0 - (1.0 - INNER_SIDE) * inside
        }
    }
}

/// Hips leave the vertices near the midline alone: both would pull on them.
fn beside_midline(joint: usize, vertex: Vec3) -> f32 {
    if joint == 1 {
        ((vertex.x - 0.015) / 0.07).clamp(0.0, 1.0)
    } else {
        1.0
    }
}

fn rotations(kind: &Kind) -> Vec<DQuat> {
    let mut turns: Vec<DVec3> = Vec::new();
    match kind {
        Kind::Hinge { axis, .. } => {
            let sideways = dvec3(axis.y, axis.z, axis.x);
            let lengthways = dvec3(axis.z, axis.x, axis.y);
            for bend in HINGE_HALF_TANGENTS {
                for (a, b) in [
                    (0.0, 0.0),
                    (0.25, 0.0),
                    (-0.25, 0.0),
                    (0.0, 0.25),
                    (0.0, -0.25),
                ] {
                    turns.push(*axis * bend + sideways * a + lengthways * b);
                }
            }
            turns.extend([sideways, -sideways, lengthways, -lengthways, -*axis].map(|t| t * 0.2));
        }
        Kind::Ball { reach } => {
            for size in &BALL_HALF_TANGENTS[..*reach] {
                for direction in 0..27_i32 {
                    let steps = [direction % 3 - 1, direction / 3 % 3 - 1, direction / 9 - 1];
                    let direction = DVec3::from_array(steps.map(f64::from));
                    if direction != DVec3::ZERO {
                        turns.push(direction / direction.length() * *size);
                    }
                }
            }
        }
    }
    turns
        .into_iter()
        .map(|t| unit(DQuat::from_xyzw(t.x, t.y, t.z, 1.0)))
        .collect()
}

fn unit(q: DQuat) -> DQuat {
    let [x, y, z, w] = q.to_array();
    let length = (x * x + y * y + z * z + w * w).sqrt();
    DQuat::from_xyzw(x / length, y / length, z / length, w / length)
}

/// The responses at `WEIGHT_STEPS + 1` weights from 0 to 1.
fn responses(rotations: &[DQuat]) -> Vec<Response> {
    let matrices: Vec<DMat3> = rotations.iter().map(|q| matrix(*q)).collect();
    let inputs: Vec<[f64; 9]> = matrices
        .iter()
        .map(|r| std::array::from_fn(|e| (*r - DMat3::IDENTITY).row(e / 3)[e % 3]))
        .collect();
    let inverse = regularised_inverse(&inputs);
    (0..=WEIGHT_STEPS)
        .map(|step| {
            let weight = step as f64 / WEIGHT_STEPS as f64;
            let mut response = [DMat3::ZERO; 9];
            for ((rotation, turned), input) in rotations.iter().zip(&matrices).zip(&inputs) {
                let missing = missing(*rotation, *turned, weight);
                for (entry, sum) in response.iter_mut().enumerate() {
                    let gain: f64 = inverse[entry].iter().zip(input).map(|(a, b)| a * b).sum();
                    *sum += missing * gain;
                }
            }
            response
        })
        .collect()
}

/// `B^-1 Q - I` with the linear blend `B` and the quaternion blend `Q` of this weight.
fn missing(rotation: DQuat, turned: DMat3, weight: f64) -> DMat3 {
    let linear = DMat3::IDENTITY * (1.0 - weight) + turned * weight;
    let blended = unit(DQuat::IDENTITY * (1.0 - weight) + rotation * weight);
    linear.inverse() * matrix(blended) - DMat3::IDENTITY
}

/// The rotation matrix of a unit quaternion.
fn matrix(q: DQuat) -> DMat3 {
    let [x, y, z, w] = q.to_array();
    DMat3::from_cols(
        dvec3(
            1.0 - 2.0 * (y * y + z * z),
            2.0 * (x * y + z * w),
            2.0 * (x * z - y * w),
        ),
        dvec3(
            2.0 * (x * y - z * w),
            1.0 - 2.0 * (x * x + z * z),
            2.0 * (y * z + x * w),
        ),
        dvec3(
            2.0 * (x * z + y * w),
            2.0 * (y * z - x * w),
            1.0 - 2.0 * (x * x + y * y),
        ),
    )
}

/// `(sum r r^T + ridge I)^-1` by Gauss-Jordan; positive definite, so no pivoting.
fn regularised_inverse(inputs: &[[f64; 9]]) -> [[f64; 9]; 9] {
    let mut system = [[0.0_f64; 18]; 9];
    for (i, row) in system.iter_mut().enumerate() {
        for j in 0..9 {
            row[j] = inputs.iter().map(|r| r[i] * r[j]).sum();
        }
        row[i] += RIDGE * inputs.len() as f64;
        row[9 + i] = 1.0;
    }
    for pivot in 0..9 {
        let scale = system[pivot][pivot];
        system[pivot] = system[pivot].map(|value| value / scale);
        let row = system[pivot];
        for other in (0..9).filter(|&other| other != pivot) {
            let factor = system[other][pivot];
            for (value, from) in system[other].iter_mut().zip(row) {
                *value -= factor * from;
            }
        }
    }
    system.map(|row| std::array::from_fn(|j| row[9 + j]))
}

fn interpolated(table: &[Response], share: f32) -> Response {
    let place = f64::from(share.clamp(0.0, 1.0)) * WEIGHT_STEPS as f64;
    let step = (place as usize).min(WEIGHT_STEPS - 1);
    let rest = place - step as f64;
    std::array::from_fn(|e| table[step][e] * (1.0 - rest) + table[step + 1][e] * rest)
}
