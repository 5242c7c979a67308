//! What really was in front of the sensor.

use std::sync::Arc;

use effigy_capture::{FrameId, Rigid3, Timestamp};
use effigy_fusion::mesh::TriangleMesh;
use effigy_registration::{BodyModel, BodyParams, PosedBody, smpl::JOINT_COUNT};
use glam::Vec3;

use crate::{error::SimError, person::Person, scenario::Scenario, scene::Scene};

/// The truth about each frame of a scenario.
#[derive(Clone, Debug)]
pub struct Truth {
    scene: Scene,
}

/// The truth about one frame. Vertices correspond: index `i` is one point of the body in all surfaces.
#[derive(Clone, Debug)]
pub struct GroundTruth {
    pub id: FrameId,
    pub timestamp: Timestamp,
    /// In world space.
    pub params: BodyParams,
    pub world_from_camera: Rigid3,
    /// The body under the clothes, in world space.
    pub minimal: PosedBody,
    /// The outer surface, with normals and colours.
    pub clothed_in_world: TriangleMesh,
    /// The outer surface of this pose in star pose; skinning weights are the body's.
    pub clothed_canonical: Vec<Vec3>,
    pub rest_joints: [Vec3; JOINT_COUNT],
}

impl Truth {
    pub fn new(scenario: &Scenario, body: Arc<BodyModel>) -> Result<Self, SimError> {
        Ok(Self { scene: Scene::new(scenario, body)? })
    }

    pub fn person(&self) -> &Person {
        &self.scene.person
    }

    /// Only the parameters: cheap.
    pub fn params(&self, frame: FrameId) -> BodyParams {
        let pose = self.scene.pose(frame);
        self.scene.person.params(&pose.theta, pose.trans)
    }

    pub fn at(&self, frame: FrameId) -> GroundTruth {
        let person = &self.scene.person;
        let params = self.params(frame);
        GroundTruth {
            id: frame,
            timestamp: self.scene.timestamp(frame),
            params,
            world_from_camera: self.scene.world_from_camera,
            minimal: person.body.pose(&params),
            clothed_in_world: person.clothed_posed(&params.theta, params.trans),
            clothed_canonical: person.clothed_canonical(&params.theta),
            rest_joints: person.rest_joints,
        }
    }
}
