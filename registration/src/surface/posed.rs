//! The surface in a pose, in the world, with the derivative of any of its points.

use glam::{Affine3A, Mat3, Vec3, Vec3A};

use super::ShapedSurface;
use crate::{
    residual::Row,
    smpl::{BoneTransforms, JOINT_COUNT, PARENTS},
    state::{BETA_COUNT, BodyState, FIRST_JOINT, TRANS},
};

/// All positions are in world space.
#[derive(Clone, Debug)]
pub(crate) struct PosedSurface<'a> {
    pub(crate) shaped: &'a ShapedSurface,
    pub(crate) state: BodyState,
    pub(crate) vertices: Vec<Vec3>,
    pub(crate) normals: Vec<Vec3>,
    pub(crate) joints: [Vec3; JOINT_COUNT],
    /// Zero pose with the pose's correctives.
    corrected: Vec<Vec3>,
    /// Zero pose to world, `trans` included.
    bones: [Affine3A; JOINT_COUNT],
    /// The axes in which each joint's step is measured: its parent's; the world's for the root.
    parent_axes: [Mat3; JOINT_COUNT],
    /// `d(bone translation)/d beta` of each bone, for [`Self::add_shape`].
    shape_shifts: Option<Box<[[Vec3; BETA_COUNT]; JOINT_COUNT]>>,
}

impl<'a> PosedSurface<'a> {
    pub(crate) fn new(shaped: &'a ShapedSurface, state: &BodyState) -> Self {
        let rotations = state.rotations.map(Mat3::from_quat);
        let corrected = corrected_vertices(shaped, &rotations);
        let (transforms, joints) = BoneTransforms::from_rotations(&rotations, &shaped.rest_joints);
        let bones = transforms.0.map(|bone| Affine3A {
            matrix3: bone.matrix3,
            translation: bone.translation + Vec3A::from(state.trans),
        });
        let mut vertices = Vec::with_capacity(corrected.len());
        let mut normals = Vec::with_capacity(corrected.len());
        let skinning = &shaped.surface.skinning;
        for ((vertex, normal), weights) in corrected.iter().zip(&shaped.normals).zip(skinning) {
            let mut blend = Affine3A::ZERO;
            for (&bone, &weight) in weights.bones.iter().zip(&weights.weights) {
                let bone = &bones[bone as usize];
                blend.matrix3 += bone.matrix3 * weight;
                blend.translation += bone.translation * weight;
            }
            vertices.push(blend.transform_point3(*vertex));
            normals.push(blend.transform_vector3(*normal).normalize_or_zero());
        }
        let parent_axes = std::array::from_fn(|joint| {
            if joint == 0 {
                Mat3::IDENTITY
            } else {
                Mat3::from(bones[PARENTS[joint]].matrix3)
            }
        });
        Self {
            shaped,
            state: *state,
            vertices,
            normals,
            joints: joints.map(|joint| joint + state.trans),
            corrected,
            bones,
            parent_axes,
            shape_shifts: None,
        }
    }

    /// Prepares the derivatives by betas as well.
    pub(crate) fn with_shape_derivatives(mut self) -> Self {
        let rest = &self.shaped.joint_dirs;
        // A bone takes x to R (x - J) + p, with p the posed joint: its shift is dp - R dJ.
        let mut joint_shifts = [[Vec3::ZERO; BETA_COUNT]; JOINT_COUNT];
        let mut shape_shifts = Box::new([[Vec3::ZERO; BETA_COUNT]; JOINT_COUNT]);
        for joint in 0..JOINT_COUNT {
            let parent = PARENTS[joint];
            for beta in 0..BETA_COUNT {
                let rest_shift = rest[beta][joint];
                joint_shifts[joint][beta] = if joint == 0 {
                    rest_shift
                } else {
                    joint_shifts[parent][beta]
                        + self.parent_axes[joint] * (rest_shift - rest[beta][parent])
                };
                shape_shifts[joint][beta] = joint_shifts[joint][beta]
                    - Vec3::from(self.bones[joint].matrix3 * Vec3A::from(rest_shift));
            }
        }
        self.shape_shifts = Some(shape_shifts);
        self
    }

    /// Adds `direction . d(vertex)/d(unknowns)` to a row.
    pub(crate) fn add_vertex(&self, row: &mut Row, vertex: usize, direction: Vec3) {
        let weights = &self.shaped.surface.skinning[vertex];
        let influences = &self.shaped.surface.influences[vertex];
        let point = self.corrected[vertex];
        let carried: [Vec3; 4] = std::array::from_fn(|slot| {
            self.bones[weights.bones[slot] as usize].transform_point3(point) * weights.weights[slot]
        });
        row.add(TRANS, direction);
        for k in 0..influences.count as usize {
            let joint = influences.joints[k] as usize;
            let mask = influences.bone_masks[k];
            let mut arm = Vec3::ZERO;
            let mut weight = 0.0;
            for (slot, (point, share)) in carried.iter().zip(&weights.weights).enumerate() {
                if mask & (1 << slot) != 0 {
                    arm += *point;
                    weight += share;
                }
            }
            // x moves by d x (arm - w p): along the direction, that is d . ((arm - w p) x direction).
            arm -= self.joints[joint] * weight;
            let turn = self.parent_axes[joint].transpose() * arm.cross(direction);
            row.add(FIRST_JOINT + 3 * joint, turn);
        }
        self.add_shape(row, vertex, direction);
    }

    /// The part of [`Self::add_vertex`] that the betas have, where they are asked for.
    fn add_shape(&self, row: &mut Row, vertex: usize, direction: Vec3) {
        let Some(shifts) = &self.shape_shifts else {
            return;
        };
        let surface = &self.shaped.surface;
        let weights = &surface.skinning[vertex];
        let model_vertex = surface.vertices[vertex] as usize;
        let mut betas = [0.0; BETA_COUNT];
        for (&bone, &weight) in weights.bones.iter().zip(&weights.weights) {
            if weight == 0.0 {
                continue;
            }
            let bone = bone as usize;
            let rest_direction =
                self.bones[bone].matrix3.transpose() * Vec3A::from(direction * weight);
            for (k, beta) in betas.iter_mut().enumerate() {
                let Some(shape) = surface.model.shape_dirs.get(k) else {
                    break;
                };
                *beta += rest_direction.dot(Vec3A::from(shape[model_vertex]))
                    + direction.dot(shifts[bone][k]) * weight;
            }
        }
        row.add_betas(&betas);
    }

    pub(crate) fn highest_y(&self) -> f32 {
        self.vertices.iter().fold(f32::MIN, |high, v| high.max(v.y))
    }

    pub(crate) fn lowest_y(&self) -> f32 {
        self.vertices.iter().fold(f32::MAX, |low, v| low.min(v.y))
    }
}

fn corrected_vertices(shaped: &ShapedSurface, rotations: &[Mat3; JOINT_COUNT]) -> Vec<Vec3> {
    /// A corrective input below this moves nothing visibly.
    const NEGLIGIBLE: f32 = 1e-3;
    let mut vertices = shaped.vertices.clone();
    let inputs = (1..JOINT_COUNT).flat_map(|joint| {
        let rotation = rotations[joint] - Mat3::IDENTITY;
        (0..9).map(move |entry| rotation.col(entry % 3)[entry / 3])
    });
    for (direction, value) in shaped.surface.pose_dirs.iter().zip(inputs) {
        if value.abs() < NEGLIGIBLE {
            continue;
        }
        for (&vertex, &offset) in direction.vertices.iter().zip(&direction.offsets) {
            vertices[vertex as usize] += offset * value;
        }
    }
    vertices
}
