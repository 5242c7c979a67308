//! Where the joints of the built-in body lie, and the regressor that finds them from its surface.

use glam::{Vec3, vec3};

use super::cage::SOLES_Y_M;
use crate::smpl::{JOINT_COUNT, SparseRow, mirror::MIRROR_JOINT};

/// Vertices within this distance of a joint's nearest ones take part in its row.
const ROW_SIZE: usize = 48;

/// Joint centres of the left half and midline in millimetres, soles at y = 0: placed in the rings of
/// `figures` where anatomy puts them (hip 89 % of crotch height, knee and elbow at their narrow rings).
#[rustfmt::skip]
const CENTRES_MM: [(usize, [i16; 3]); 15] = [
    (0, [0, 970, 25]), (1, [72, 892, 20]), (3, [0, 1083, 2]), (4, [88, 500, 12]), (6, [0, 1223, 4]),
    (7, [93, 88, -28]), (9, [0, 1278, 20]), (10, [103, 30, 95]), (12, [0, 1499, -15]), (13, [82, 1405, -8]),
    (15, [0, 1566, 33]), (16, [178, 1437, -18]), (18, [444, 1440, -38]), (20, [705, 1447, -45]),
    (22, [790, 1437, -55]),
];

/// Joint centres of the template, in rest space.
pub(super) fn centres() -> [Vec3; JOINT_COUNT] {
    let mut joints = [Vec3::ZERO; JOINT_COUNT];
    for (joint, [x, y, z]) in CENTRES_MM {
        let centre = vec3(f32::from(x), f32::from(y), f32::from(z)) * 1e-3 + Vec3::Y * SOLES_Y_M;
        joints[joint] = centre;
        joints[MIRROR_JOINT[joint]] = centre
            * vec3(
                if joint == MIRROR_JOINT[joint] {
                    1.0
                } else {
                    -1.0
                },
                1.0,
                1.0,
            );
    }
    joints
}

/// Sparse rows of weights that sum to one and give `joints` from `vertices`; mirrored like `mirror`.
pub(super) fn regressor(
    vertices: &[Vec3],
    mirror: &[u32],
    joints: &[Vec3; JOINT_COUNT],
) -> Vec<SparseRow> {
    let mut rows = vec![SparseRow::default(); JOINT_COUNT];
    for joint in 0..JOINT_COUNT {
        let other = MIRROR_JOINT[joint];
        if other < joint {
            let indices = rows[other]
                .indices
                .iter()
                .map(|&i| mirror[i as usize])
                .collect();
            rows[joint] = SparseRow { indices, weights: rows[other].weights.clone() };
        } else {
            rows[joint] = row(vertices, mirror, joints[joint], joint == other);
        }
    }
    rows
}

/// The weights nearest to a bell around the joint among those that reproduce every affine motion of it.
fn row(vertices: &[Vec3], mirror: &[u32], joint: Vec3, on_midline: bool) -> SparseRow {
    let mut near: Vec<(f32, u32)> = (0_u32..)
        .zip(vertices)
        .filter(|(_, v)| !on_midline || v.x >= 0.0)
        .map(|(i, v)| (v.distance_squared(joint), i))
        .collect();
    near.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    near.truncate(ROW_SIZE);
    let mut indices: Vec<u32> = near.iter().map(|&(_, i)| i).collect();
    if on_midline {
        let others = indices.clone().into_iter().map(|i| mirror[i as usize]);
        let others: Vec<u32> = others.filter(|i| !indices.contains(i)).collect();
        indices.extend(others);
    }
    let radius_squared = f64::from(near.last().map_or(1.0, |n| n.0));
    let offsets: Vec<[f64; 3]> = indices
        .iter()
        .map(|&i| (vertices[i as usize] - joint).to_array().map(f64::from))
        .collect();
    let bell: Vec<f64> = offsets
        .iter()
        .map(|d| (1.25 - (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]) / radius_squared).max(0.02))
        .collect();
    let multipliers = affine_multipliers(&offsets, &bell);
    let weights = offsets
        .iter()
        .zip(&bell)
        .map(|(d, b)| {
            let [m0, m1, m2, m3] = multipliers;
            (b * (m0 + m1 * d[0] + m2 * d[1] + m3 * d[2])) as f32
        })
        .collect();
    SparseRow { indices, weights }
}

/// Solves for `m` in `sum b (m . [1, d]) [1, d] = [1, 0, 0, 0]`: weights `b (m . [1, d])` then sum to
/// one and have their centre at the joint.
fn affine_multipliers(offsets: &[[f64; 3]], bell: &[f64]) -> [f64; 4] {
    let mut system = [[0.0_f64; 5]; 4];
    system[0][4] = 1.0;
    for (d, b) in offsets.iter().zip(bell) {
        let row = [1.0, d[0], d[1], d[2]];
        for i in 0..4 {
            for j in 0..4 {
                system[i][j] += b * row[i] * row[j];
            }
        }
    }
    solve_four(system)
}

/// Gaussian elimination; the system is positive definite, so no pivoting.
fn solve_four(mut system: [[f64; 5]; 4]) -> [f64; 4] {
    for pivot in 0..4 {
        let row = system[pivot];
        for other in (0..4).filter(|&other| other != pivot) {
            let factor = system[other][pivot] / row[pivot];
            for (value, from) in system[other].iter_mut().zip(row) {
                *value -= factor * from;
            }
        }
    }
    std::array::from_fn(|i| system[i][4] / system[i][i])
}
