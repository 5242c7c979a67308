//! A field of a point and a pose in one network.

use std::sync::Arc;

use glam::Vec3;
use rand::{SeedableRng as _, rngs::StdRng};

use super::{Architecture, PoseMap, pose_code::quaternions};
use crate::{
    PoseField, PoseInput, SignedDistanceField,
    nn::field_mlp::{CodeAt, FieldMlp},
};

/// The network, and how it is told the pose.
#[derive(Clone)]
pub struct ConditionedField {
    pub(super) architecture: Architecture,
    pub(super) mlp: FieldMlp,
    pose_map: Option<Arc<PoseMap>>,
}

impl ConditionedField {
    /// Before any learning.
    pub fn new(architecture: Architecture, seed: u64) -> Self {
        let mlp = FieldMlp::init(architecture.config(), &mut StdRng::seed_from_u64(seed));
        Self { architecture, mlp, pose_map: None }
    }

    /// Tells each point only the pose of joints near it.
    pub fn with_pose_map(self, map: Arc<PoseMap>) -> Self {
        Self { pose_map: Some(map), ..self }
    }

    pub fn parameter_count(&self) -> usize {
        self.mlp.parameters.len()
    }

    /// What points are told in a pose.
    pub(super) fn codes<'a>(&'a self, pose: &PoseInput) -> Box<dyn CodeAt + 'a> {
        match &self.pose_map {
            Some(map) => Box::new(map.in_pose(pose)),
            None => Box::new(quaternions(pose)),
        }
    }
}

impl PoseField for ConditionedField {
    fn field(&self, pose: &PoseInput) -> Box<dyn SignedDistanceField> {
        Box::new(InPose { field: self.clone(), pose: *pose })
    }

    fn kind(&self) -> &'static str {
        "conditioned"
    }

    fn to_bytes(&self) -> Vec<u8> {
        bytemuck::cast_slice(&self.mlp.parameters).to_vec()
    }
}

struct InPose {
    field: ConditionedField,
    pose: PoseInput,
}

impl SignedDistanceField for InPose {
    fn values(&self, points: &[Vec3], out: &mut [f32]) {
        let codes = self.field.codes(&self.pose);
        self.field.mlp.values(points, &*codes, out);
    }

    fn values_and_gradients(&self, points: &[Vec3], values: &mut [f32], gradients: &mut [Vec3]) {
        let codes = self.field.codes(&self.pose);
        let mlp = &self.field.mlp;
        mlp.values_and_gradients(points, &*codes, values, gradients);
    }
}
