//! The hierarchical bone encoder: 24 rotations and joints become 24 features of 6 numbers.
//!
//! A joint's feature comes from its own rotation, position and bone length and from its parent's feature,
//! so that it can depend only on the chain above it. The root's parent is a feature of the whole body.

use effigy_registration::smpl::{JOINT_COUNT, PARENTS};
use rand::Rng;

use crate::{
    PoseInput,
    baselines::{QUATERNION_NUMBERS, quaternions},
    nn::linear::{Linear, OuterGradient},
};

/// Numbers that describe one joint to its descendants.
pub(crate) const FEATURE_SIZE: usize = 6;
/// Rotation, position, bone length and the parent's feature.
pub(crate) const JOINT_INPUTS: usize = 9 + 3 + 1 + FEATURE_SIZE;
/// All rotations, then all joints.
pub(crate) const GLOBAL_INPUTS: usize = JOINT_COUNT * (9 + 3);
/// Length of the pose code.
pub(crate) const CODE_SIZE: usize = JOINT_COUNT * FEATURE_SIZE;

/// What a pose becomes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum EncoderKind {
    /// Features learned along the skeleton.
    #[default]
    Bones,
    /// 23 unit quaternions, and zeros: the paper's ablation. No file holds such a network.
    Quaternions,
}

#[derive(Clone, Debug, PartialEq)]
pub(crate) struct PoseEncoder {
    pub(crate) kind: EncoderKind,
    pub(crate) global: Linear,
    /// Hidden and output layer of each joint.
    pub(crate) joints: Vec<[Linear; 2]>,
}

/// What the backward pass needs, and the code itself.
#[derive(Clone, Debug)]
pub(crate) struct EncoderCache {
    global_input: Vec<f32>,
    /// Each joint's input and its hidden layer after `ReLU`; [rows, 19] each
    joints: Vec<[Vec<f32>; 2]>,
    /// [rows, 144]
    pub(crate) code: Vec<f32>,
}

/// Gradients as outer products, in the encoder's order.
#[derive(Clone, Debug)]
pub(crate) struct EncoderGradient {
    pub(crate) global: OuterGradient,
    pub(crate) joints: Vec<[OuterGradient; 2]>,
}

impl PoseEncoder {
    pub(crate) fn init(rng: &mut impl Rng) -> Self {
        Self {
            kind: EncoderKind::Bones,
            global: Linear::uniform(GLOBAL_INPUTS, FEATURE_SIZE, rng),
            joints: (0..JOINT_COUNT)
                .map(|_| {
                    [
                        Linear::uniform(JOINT_INPUTS, JOINT_INPUTS, rng),
                        Linear::uniform(JOINT_INPUTS, FEATURE_SIZE, rng),
                    ]
                })
                .collect(),
        }
    }

    pub(crate) fn zeros() -> Self {
        Self {
            kind: EncoderKind::Bones,
            global: Linear::zeros(GLOBAL_INPUTS, FEATURE_SIZE),
            joints: vec![
                [
                    Linear::zeros(JOINT_INPUTS, JOINT_INPUTS),
                    Linear::zeros(JOINT_INPUTS, FEATURE_SIZE),
                ];
                JOINT_COUNT
            ],
        }
    }

    /// # Shapes
    /// Result's code: [poses, 144]
    pub(crate) fn forward(&self, poses: &[PoseInput]) -> EncoderCache {
        let global_input: Vec<f32> = poses.iter().flat_map(global_input).collect();
        let global = self.global.forward(&global_input);
        let mut code = vec![0.0; poses.len() * CODE_SIZE];
        let mut joints = Vec::with_capacity(JOINT_COUNT);
        for (joint, [hidden, output]) in self.joints.iter().enumerate() {
            let mut input = Vec::with_capacity(poses.len() * JOINT_INPUTS);
            for (row, pose) in poses.iter().enumerate() {
                input.extend(own_input(pose, joint));
                input.extend(parent_feature(joint, row, &global, &code));
            }
            let mut activation = hidden.forward(&input);
            for x in &mut activation {
                *x = x.max(0.0);
            }
            let feature = output.forward(&activation);
            for (row, feature) in feature.chunks_exact(FEATURE_SIZE).enumerate() {
                let start = row * CODE_SIZE + joint * FEATURE_SIZE;
                code[start..start + FEATURE_SIZE].copy_from_slice(feature);
            }
            joints.push([input, activation]);
        }
        if self.kind == EncoderKind::Quaternions {
            code.fill(0.0);
            for (row, pose) in code.chunks_exact_mut(CODE_SIZE).zip(poses) {
                row[..QUATERNION_NUMBERS].copy_from_slice(&quaternions(pose));
            }
        }
        EncoderCache { global_input, joints, code }
    }

    /// # Shapes
    /// `code_bar` [poses, 144]
    pub(crate) fn backward(&self, cache: EncoderCache, mut code_bar: Vec<f32>) -> EncoderGradient {
        let rows = code_bar.len() / CODE_SIZE;
        if self.kind == EncoderKind::Quaternions {
            // Nothing of the code was learned.
            code_bar.fill(0.0);
        }
        let mut global_bar = vec![0.0; rows * FEATURE_SIZE];
        let mut gradients = Vec::with_capacity(JOINT_COUNT);
        let layers = self.joints.iter().zip(cache.joints).enumerate().rev();
        for (joint, ([hidden, output], [input, activation])) in layers {
            let feature_bar: Vec<f32> = code_bar
                .chunks_exact(CODE_SIZE)
                .flat_map(|row| &row[joint * FEATURE_SIZE..(joint + 1) * FEATURE_SIZE])
                .copied()
                .collect();
            let mut hidden_bar = output.input_bar(&feature_bar);
            for (bar, x) in hidden_bar.iter_mut().zip(&activation) {
                if *x <= 0.0 {
                    *bar = 0.0;
                }
            }
            let input_bar = hidden.input_bar(&hidden_bar);
            for (row, bar) in input_bar.chunks_exact(JOINT_INPUTS).enumerate() {
                let parent = if joint == 0 {
                    &mut global_bar[row * FEATURE_SIZE..(row + 1) * FEATURE_SIZE]
                } else {
                    let start = row * CODE_SIZE + PARENTS[joint] * FEATURE_SIZE;
                    &mut code_bar[start..start + FEATURE_SIZE]
                };
                for (sum, bar) in parent.iter_mut().zip(&bar[JOINT_INPUTS - FEATURE_SIZE..]) {
                    *sum += bar;
                }
            }
            gradients.push([
                OuterGradient { input, output_bar: hidden_bar },
                OuterGradient { input: activation, output_bar: feature_bar },
            ]);
        }
        gradients.reverse();
        EncoderGradient {
            global: OuterGradient { input: cache.global_input, output_bar: global_bar },
            joints: gradients,
        }
    }
}

fn parent_feature<'a>(joint: usize, row: usize, global: &'a [f32], code: &'a [f32]) -> &'a [f32] {
    if joint == 0 {
        &global[row * FEATURE_SIZE..(row + 1) * FEATURE_SIZE]
    } else {
        let start = row * CODE_SIZE + PARENTS[joint] * FEATURE_SIZE;
        &code[start..start + FEATURE_SIZE]
    }
}

/// Rotation row by row, position, and the distance to the parent joint (to the origin for the root).
fn own_input(pose: &PoseInput, joint: usize) -> impl Iterator<Item = f32> + use<> {
    let position = pose.joints_in_unit[joint];
    let parent = if joint == 0 {
        glam::Vec3::ZERO
    } else {
        pose.joints_in_unit[PARENTS[joint]]
    };
    pose.rotations[joint]
        .transpose()
        .to_cols_array()
        .into_iter()
        .chain(position.to_array())
        .chain([position.distance(parent)])
}

fn global_input(pose: &PoseInput) -> impl Iterator<Item = f32> {
    let rotations = pose
        .rotations
        .iter()
        .flat_map(|m| m.transpose().to_cols_array());
    rotations.chain(pose.joints_in_unit.iter().flat_map(glam::Vec3::to_array))
}
