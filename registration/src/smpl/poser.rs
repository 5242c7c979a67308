//! Posing again and again without allocating: the buffers and the last shape are kept.

use std::sync::Arc;

use glam::{Affine3A, Mat3, Vec3};

use super::{
    BodyModel, BodyParams, BoneTransforms, JOINT_COUNT, PosedBody, rotation_from_axis_angle,
};

/// A body model with the buffers of one posed body.
#[derive(Clone, Debug)]
pub struct Poser {
    model: Arc<BodyModel>,
    betas: [f32; 10],
    shaped: Vec<Vec3>,
    rest_joints: [Vec3; JOINT_COUNT],
    corrected: Vec<Vec3>,
    rotations: [Mat3; JOINT_COUNT],
    posed: PosedBody,
}

impl Poser {
    pub fn new(model: Arc<BodyModel>) -> Self {
        let shaped = model.template.clone();
        let rest_joints = model.joints(&shaped);
        let posed = PosedBody {
            vertices: shaped.clone(),
            joints: rest_joints,
            bones: BoneTransforms([Affine3A::IDENTITY; JOINT_COUNT]),
        };
        Self {
            betas: [0.0; 10],
            corrected: shaped.clone(),
            rotations: [Mat3::IDENTITY; JOINT_COUNT],
            shaped,
            rest_joints,
            posed,
            model,
        }
    }

    /// As [`BodyModel::pose`], bit for bit; the shape is only computed anew when betas change.
    pub fn pose(&mut self, params: &BodyParams) -> &PosedBody {
        if params.betas != self.betas {
            self.betas = params.betas;
            self.model.shape_into(&params.betas, &mut self.shaped);
            self.rest_joints = self.model.joints(&self.shaped);
        }
        self.rotations = params.theta.map(rotation_from_axis_angle);
        self.corrected.copy_from_slice(&self.shaped);
        self.model
            .add_rotation_correctives(&mut self.corrected, &self.rotations);
        let (bones, joints) = BoneTransforms::from_rotations(&self.rotations, &self.rest_joints);
        bones.skin_into(
            &self.model.skinning,
            &self.corrected,
            params.trans,
            &mut self.posed.vertices,
        );
        self.posed.bones = bones;
        self.posed.joints = joints.map(|joint| joint + params.trans);
        &self.posed
    }

    pub fn model(&self) -> &Arc<BodyModel> {
        &self.model
    }

    /// What the last [`Self::pose`] gave.
    pub fn posed(&self) -> &PosedBody {
        &self.posed
    }

    /// The shaped zero-pose body, pose correctives not included.
    pub fn shaped(&self) -> &[Vec3] {
        &self.shaped
    }

    /// The shaped zero-pose body with the last pose's correctives: what the bones move.
    pub fn corrected(&self) -> &[Vec3] {
        &self.corrected
    }

    pub fn rest_joints(&self) -> &[Vec3; JOINT_COUNT] {
        &self.rest_joints
    }
}
