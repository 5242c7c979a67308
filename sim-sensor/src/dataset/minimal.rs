//! The body under a sequence's clothes.

use std::sync::Arc;

use effigy_registration::{
    BodyModel, PosedBody,
    smpl::{BoneTransforms, JOINT_COUNT, star_transforms},
};
use glam::Vec3;

use super::sequence::Sequence;
use crate::{
    error::SimError,
    person::{Outfit, Person},
};

/// One person's minimal body in any pose: vertices of the body model, in its order.
#[derive(Clone, Debug)]
pub struct MinimalBody(Source);

#[derive(Clone, Debug)]
enum Source {
    /// A surface and flesh of their own.
    Simulated(Box<Person>),
    Scanned(Box<Scan>),
}

/// Somebody on a body model.
#[derive(Clone, Debug)]
struct Scan {
    body: Arc<BodyModel>,
    zero_pose: Vec<Vec3>,
    rest_joints: [Vec3; JOINT_COUNT],
}

impl Sequence {
    /// The minimal body of the sequence's person, who was made on this body model.
    pub fn minimal_body(&self, body: &Arc<BodyModel>) -> Result<MinimalBody, SimError> {
        let body = Arc::clone(body);
        if let Some(scenario) = &self.plan.scenario {
            let person = scenario.person(body, Outfit::UNDER);
            return Ok(MinimalBody(Source::Simulated(Box::new(person))));
        }
        let (found, expected) = (self.minimal.len(), body.vertex_count());
        if found != expected {
            return Err(SimError::Sequence {
                name: self.plan.name.clone(),
                problem: format!(
                    "its minimal body has {found} vertices, expected the body model's {expected}; take the body it was imported with"
                ),
            });
        }
        let (zero_pose, rest_joints) = (self.minimal.clone(), self.rest_joints);
        let scan = Scan { body, zero_pose, rest_joints };
        Ok(MinimalBody(Source::Scanned(Box::new(scan))))
    }
}

impl MinimalBody {
    /// In the space of `trans`; a sequence's frame has both.
    pub fn posed(&self, theta: &[Vec3; JOINT_COUNT], trans: Vec3) -> PosedBody {
        match &self.0 {
            Source::Simulated(person) => person.minimal_posed(theta, trans),
            Source::Scanned(scan) => {
                let (bones, joints) = BoneTransforms::from_pose(theta, &scan.rest_joints);
                let vertices = scan.skinned(theta, &bones);
                PosedBody {
                    vertices: vertices.into_iter().map(|vertex| vertex + trans).collect(),
                    joints: joints.map(|joint| joint + trans),
                    bones,
                }
            }
        }
    }

    /// The body of a pose (correctives included), moved to star pose.
    pub fn star(&self, theta: &[Vec3; JOINT_COUNT]) -> Vec<Vec3> {
        match &self.0 {
            Source::Simulated(person) => person.minimal_canonical(theta),
            Source::Scanned(scan) => scan.skinned(theta, &star_transforms(&scan.rest_joints)),
        }
    }
}

impl Scan {
    fn skinned(&self, theta: &[Vec3; JOINT_COUNT], bones: &BoneTransforms) -> Vec<Vec3> {
        let mut vertices = self.zero_pose.clone();
        self.body.add_pose_correctives(&mut vertices, theta);
        for (vertex, weights) in vertices.iter_mut().zip(&self.body.skinning) {
            *vertex = bones.blend(weights).transform_point3(*vertex);
        }
        vertices
    }
}
