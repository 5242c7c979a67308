//! What really was in front of the sensor.

use std::sync::Arc;

use effigy_capture::{FrameId, Rigid3, Timestamp};
use effigy_fusion::mesh::TriangleMesh;
use effigy_registration::{
    BodyModel, BodyParams, PosedBody,
    smpl::{JOINT_COUNT, VertexWeights},
};
use glam::Vec3;

use crate::{
    cloth::{ClothedSurface, rms_between_m},
    error::SimError,
    person::Person,
    scenario::Scenario,
    scene::Scene,
};

/// The truth about each frame of a scenario.
#[derive(Clone, Debug)]
pub struct Truth {
    scene: Scene,
}

/// The truth about one frame. Vertex `i` of the clothed surfaces is one point in all frames of a scenario. Without
/// simulated clothes it is also vertex `i` of the body; with them the body's vertices come first, the garments'
/// follow, and triangles are only those that can be seen from outside.
#[derive(Clone, Debug)]
pub struct GroundTruth {
    pub id: FrameId,
    pub timestamp: Timestamp,
    /// In world space; of an individual, the body model's nearest to them.
    pub params: BodyParams,
    /// Root mean square distance of corresponding vertices from the body of `params` to the minimal body; 0 where
    /// the body model can be the person exactly.
    pub params_residual_m: f32,
    pub world_from_camera: Rigid3,
    /// The body under the clothes, in world space.
    pub minimal: PosedBody,
    /// The outer surface, with normals and colours.
    pub clothed_in_world: TriangleMesh,
    /// The outer surface of this pose in star pose, vertex by vertex.
    pub clothed_canonical: Vec<Vec3>,
    /// The surface in star pose once more, with triangles and normals of its own, where clothes are simulated.
    pub in_cloth: Option<ClothTruth>,
    pub rest_joints: [Vec3; JOINT_COUNT],
}

/// What simulated clothes add to the truth.
#[derive(Clone, Debug)]
pub struct ClothTruth {
    /// The visible surface in star pose, with the normals of that surface.
    pub canonical: TriangleMesh,
    /// Skinning weights of each vertex; those of garments are diffused over the garment.
    pub weights: Vec<VertexWeights>,
    /// 0 for the person, 1 for the innermost garment, and so on.
    pub layers: Vec<u8>,
}

impl Truth {
    pub fn new(scenario: &Scenario, body: Arc<BodyModel>) -> Result<Self, SimError> {
        Ok(Self { scene: Scene::new(scenario, body)? })
    }

    pub(crate) fn of_scene(scene: Scene) -> Self {
        Self { scene }
    }

    pub fn person(&self) -> &Person {
        &self.scene.person
    }

    pub(crate) fn scene(&self) -> &Scene {
        &self.scene
    }

    /// Only the parameters: cheap.
    pub fn params(&self, frame: FrameId) -> BodyParams {
        let pose = self.scene.pose(frame);
        self.scene.person.params(&pose.theta, pose.trans)
    }

    /// Only the body under the clothes, in world space, and where the camera stands: cheap.
    pub fn minimal(&self, frame: FrameId) -> (PosedBody, Rigid3) {
        let person = &self.scene.person;
        let pose = self.scene.pose(frame);
        let minimal = if person.individual.is_some() {
            person.minimal_posed(&pose.theta, pose.trans)
        } else {
            person.body.pose(&person.params(&pose.theta, pose.trans))
        };
        (minimal, self.scene.world_from_camera)
    }

    /// Frames in any order; with simulated clothes a frame far ahead costs the frames between.
    pub fn at(&self, frame: FrameId) -> GroundTruth {
        let person = &self.scene.person;
        let pose = self.scene.pose(frame);
        let params = person.params(&pose.theta, pose.trans);
        let (minimal, world_from_camera) = self.minimal(frame);
        let params_residual_m = if person.individual.is_some() {
            rms_between_m(&minimal.vertices, &person.body.pose(&params).vertices)
        } else {
            0.0
        };
        let (clothed_in_world, clothed_canonical, in_cloth) = match self.scene.in_cloth(frame) {
            Some(mut surface) => {
                surface.posed.colors = person.paint.vertex_colors();
                let ClothedSurface { posed, canonical, weights, layers } = surface.envelope();
                let vertices = canonical.vertices.clone();
                (
                    posed,
                    vertices,
                    Some(ClothTruth { canonical, weights, layers }),
                )
            }
            None => (
                person.clothed_posed(&pose.theta, pose.trans),
                person.clothed_canonical(&pose.theta),
                None,
            ),
        };
        GroundTruth {
            id: frame,
            timestamp: self.scene.scenario.timestamp(frame),
            params,
            params_residual_m,
            world_from_camera,
            minimal,
            clothed_in_world,
            clothed_canonical,
            in_cloth,
            rest_joints: person.rest_joints,
        }
    }
}
