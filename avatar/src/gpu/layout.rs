//! What the kernels read, as it lies in the adapter's memory: the structures of `shared.wgsl` and `tape.wgsl` field by field.

use bytemuck::{Pod, Zeroable};
use effigy_registration::smpl::JOINT_COUNT;
use glam::{Affine3A, Vec3};

use crate::{
    drive::Driver,
    sdf::{SirenConfig, SirenField},
};

/// `Pose`.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
pub(super) struct PoseBlock {
    pub(super) vertex_count: u32,
    pub(super) layers: u32,
    pub(super) steps: u32,
    pub(super) settled: f32,
    pub(super) canonical_origin_m: Vec3,
    pub(super) metres_per_unit: f32,
    pub(super) trans_m: Vec3,
    pub(super) longest: f32,
    pub(super) bones: [Rows; JOINT_COUNT],
}

/// `Batch` of `tape.wgsl`.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
pub(super) struct BatchBlock {
    pub(super) tiles: u32,
    pub(super) sines: u32,
    pub(super) field_len: u32,
    pub(super) points_at: u32,
    pub(super) bars_at: u32,
    pub(super) parameters: u32,
    pub(super) gradients_at: u32,
    pub(super) unused: u32,
}

/// `Vertex`.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
pub(super) struct VertexBlock {
    place: Vec3,
    slope: f32,
    normal: Vec3,
    bones: [u8; 4],
    weights: [f32; 4],
    rest_from_canonical: Rows,
}

/// The three rows of an affine map.
pub(super) type Rows = [[f32; 4]; 3];

pub(super) fn rows(map: &Affine3A) -> Rows {
    let rows = map.matrix3.transpose();
    let row = |of: glam::Vec3A, translation: f32| [of.x, of.y, of.z, translation];
    [
        row(rows.x_axis, map.translation.x),
        row(rows.y_axis, map.translation.y),
        row(rows.z_axis, map.translation.z),
    ]
}

/// What of a driver's vertices no pose changes.
pub(super) fn vertices(driver: &Driver) -> Vec<VertexBlock> {
    let topology = &driver.avatar().topology;
    let places = topology.vertices_in_unit.iter().zip(&topology.normals);
    let maps = driver.slopes().iter().zip(driver.rest_from_canonical());
    places
        .zip(&topology.skinning)
        .zip(maps)
        .map(
            |(((&place, &normal), skinning), (&slope, map))| VertexBlock {
                place,
                slope,
                normal,
                bones: skinning.bones,
                weights: skinning.weights,
                rest_from_canonical: rows(map),
            },
        )
        .collect()
}

/// Each vertex's triangles, in their order: `fans`.
pub(super) fn fans(vertex_count: usize, triangles: &[[u32; 3]]) -> Vec<u32> {
    let starts_len = vertex_count + 1;
    let corners_at = starts_len + 3 * triangles.len();
    let mut fans = vec![0; corners_at];
    for &corner in triangles.as_flattened() {
        fans[corner as usize + 1] += 1;
    }
    fans[0] = starts_len as u32;
    for vertex in 0..vertex_count {
        fans[vertex + 1] += fans[vertex];
    }
    let mut next = fans[..vertex_count].to_vec();
    for (number, triangle) in triangles.iter().enumerate() {
        for &corner in triangle {
            let place = &mut next[corner as usize];
            fans[*place as usize] = (corners_at + 3 * number) as u32;
            *place += 1;
        }
    }
    fans.extend(triangles.as_flattened());
    fans
}

/// Numbers of a packed field.
pub(super) fn packed_len(config: SirenConfig) -> usize {
    let SirenConfig { hidden, layers } = config;
    4 * hidden + (layers - 2) * (hidden * hidden + hidden) + hidden + 4
}

/// A field's parameters as `project.wgsl` reads them, four numbers at a time: neighbouring units read neighbouring fours.
///
/// First layer: a unit's weights and its bias. Hidden layers: the weights of each four inputs for all units, then the
/// biases. Last layer: its weights, then its bias and three zeros.
pub(super) fn pack(field: &SirenField, packed: &mut Vec<f32>) {
    packed.clear();
    pack_layers(field.config(), field.parameters(), packed, |_, _| {});
}

/// Numbers of a field that is packed for learning.
pub(super) fn packed_for_learning_len(config: SirenConfig) -> usize {
    let SirenConfig { hidden, layers } = config;
    packed_len(config) + (layers - 2) * hidden * hidden
}

/// The same, added to what is there, with each hidden layer's weights once more behind its biases, turned: what goes back
/// through a layer multiplies with these.
pub(super) fn pack_for_learning(config: SirenConfig, parameters: &[f32], packed: &mut Vec<f32>) {
    pack_layers(config, parameters, packed, |weight, packed| {
        for four in weight.chunks_exact(4 * config.hidden) {
            for input in 0..config.hidden {
                packed.extend((0..4).map(|row| four[row * config.hidden + input]));
            }
        }
    });
}

fn pack_layers(
    config: SirenConfig,
    parameters: &[f32],
    packed: &mut Vec<f32>,
    behind_biases: impl Fn(&[f32], &mut Vec<f32>),
) {
    let (weight, bias) = config.split(parameters, 0);
    for (weight, bias) in weight.chunks_exact(3).zip(bias) {
        packed.extend([weight[0], weight[1], weight[2], *bias]);
    }
    for layer in 1..config.layers - 1 {
        let (weight, bias) = config.split(parameters, layer);
        for input in (0..config.hidden).step_by(4) {
            for row in weight.chunks_exact(config.hidden) {
                packed.extend_from_slice(&row[input..input + 4]);
            }
        }
        packed.extend_from_slice(bias);
        behind_biases(weight, packed);
    }
    let (weight, bias) = config.split(parameters, config.layers - 1);
    packed.extend_from_slice(weight);
    packed.extend([bias[0], 0.0, 0.0, 0.0]);
}

#[cfg(test)]
mod tests {
    use rand::{SeedableRng as _, rngs::StdRng};

    use super::*;

    #[test]
    fn a_packed_field_has_every_parameter_once_where_the_kernel_looks_for_it() {
        let config = SirenConfig { hidden: 16, layers: 4 };
        let field = SirenField::init(config, &mut StdRng::seed_from_u64(3));
        let mut packed = Vec::new();
        pack(&field, &mut packed);
        assert_eq!(packed.len(), packed_len(config));
        let mut at = 0;
        for layer in 0..config.layers {
            let (weight, bias) = config.split(field.parameters(), layer);
            let (inputs, outputs) = config.layer_size(layer);
            for unit in 0..outputs {
                for input in 0..inputs {
                    let place = match layer {
                        0 => 4 * unit + input,
                        3 => input,
                        _ => 4 * (input / 4 * outputs + unit) + input % 4,
                    };
                    assert_eq!(packed[at + place], weight[unit * inputs + input]);
                }
                let place = match layer {
                    0 => 4 * unit + 3,
                    _ => inputs * outputs + unit,
                };
                assert_eq!(packed[at + place], bias[unit]);
            }
            at += (inputs * outputs + outputs).next_multiple_of(4);
        }
    }

    #[test]
    fn a_field_to_learn_has_its_hidden_weights_once_more_turned() {
        let config = SirenConfig { hidden: 16, layers: 4 };
        let field = SirenField::init(config, &mut StdRng::seed_from_u64(3));
        let (mut plain, mut packed) = (Vec::new(), Vec::new());
        pack(&field, &mut plain);
        pack_for_learning(config, field.parameters(), &mut packed);
        assert_eq!(packed.len(), packed_for_learning_len(config));
        let (square, hidden) = (16 * 16, 16);
        let mut at = 4 * hidden;
        for layer in 1..3 {
            let turned = &packed[at + square + hidden..][..square];
            let (weight, _) = config.split(field.parameters(), layer);
            for unit in 0..hidden {
                for input in 0..hidden {
                    let place = 4 * (unit / 4 * hidden + input) + unit % 4;
                    assert_eq!(turned[place], weight[unit * hidden + input]);
                }
            }
            packed.drain(at + square + hidden..at + 2 * square + hidden);
            at += square + hidden;
        }
        assert_eq!(packed, plain);
    }

    #[test]
    fn each_vertex_finds_its_triangles_in_their_order() {
        let triangles = [[0, 1, 2], [2, 1, 3], [4, 2, 0]];
        let fans = fans(6, &triangles);
        let of = |vertex: usize| -> Vec<[u32; 3]> {
            (fans[vertex]..fans[vertex + 1])
                .map(|at| std::array::from_fn(|corner| fans[fans[at as usize] as usize + corner]))
                .collect()
        };
        assert_eq!(of(2), triangles);
        assert_eq!(of(0), [triangles[0], triangles[2]]);
        assert_eq!(of(3), [triangles[1]]);
        assert!(of(5).is_empty());
    }
}
