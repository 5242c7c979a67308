//! A sequence in memory: surfaces in star pose, and what follows from them.

use effigy_capture::FrameId;
use effigy_fusion::mesh::TriangleMesh;
use effigy_registration::{
    BodyParams,
    smpl::{BoneTransforms, JOINT_COUNT, VertexWeights, star_transforms},
};
use glam::Vec3;

use super::{
    history::{ClothFacts, cloth_facts, history_floor_cm, revisited},
    plan::{SequencePlan, Split},
};
use crate::{
    cloth::Behaviour,
    truth::{GroundTruth, Truth},
};

/// Everything known about one person in one outfit doing one thing.
#[derive(Clone, Debug, PartialEq)]
pub struct Sequence {
    pub plan: SequencePlan,
    pub betas: [f32; 10],
    /// Zero-pose joints of the minimal body.
    pub rest_joints: [Vec3; JOINT_COUNT],
    /// Skinning weights of each vertex of the outer surface; those of cloth are diffused over the garment.
    pub weights: Vec<VertexWeights>,
    /// 0 for the person, 1 for the innermost garment, and so on; one a vertex.
    pub layers: Vec<u8>,
    /// The vertices' numbers among all of the person's and of the clothes', hidden ones included: the same point has
    /// the same number in all sequences of a person in an outfit. The first are the body model's.
    pub numbers: Vec<u32>,
    /// All that can be seen from outside in some frame.
    pub triangles: Vec<[u32; 3]>,
    /// A scanned person's minimal body in zero pose; empty for simulated people: see [`Sequence::minimal_body`].
    pub minimal: Vec<Vec3>,
    /// What the clothes do; `None` where none are simulated.
    pub cloth: Option<ClothFacts>,
    pub frames: Vec<SequenceFrame>,
}

#[derive(Clone, Debug, PartialEq)]
pub struct SequenceFrame {
    /// In the scenario.
    pub id: FrameId,
    pub theta: [Vec3; JOINT_COUNT],
    /// Of the person's own body, whose zero-pose joints are the sequence's.
    pub trans: Vec3,
    /// Of the body model that comes nearest: its pelvis lies on the person's.
    pub params_trans: Vec3,
    /// The outer surface of this pose in star pose, correctives and folds included.
    pub star: Vec<Vec3>,
    /// Which triangles can be seen from outside.
    pub visible: Vec<bool>,
}

impl Sequence {
    /// Simulates a plan's frames one after the other; `None` if `go_on` says so between two of them.
    pub(super) fn simulate(
        plan: &SequencePlan,
        truth: &Truth,
        mut go_on: impl FnMut() -> bool,
    ) -> Option<Self> {
        let revisited = match plan.split {
            Split::Train => Vec::new(),
            Split::Test => revisited(plan.frames),
        };
        let mut gathered = Gathered::default();
        let mut visits = Vec::new();
        let mut behaviour = Behaviour::default();
        for frame in 0..u64::from(plan.frames) {
            if !go_on() {
                return None;
            }
            let truth_now = truth.at(FrameId(frame));
            if revisited.contains(&frame) {
                visits.push((frame, truth_now.clothed_in_world.clone()));
            }
            gathered.add(truth_now);
            truth.scene().worn_at(FrameId(frame), |wear| {
                behaviour.add_strains(wear);
                if frame.is_multiple_of(4) {
                    behaviour.add_clearances(&wear.clearances_m());
                }
            });
        }
        visits.reverse();
        let last = u64::from(plan.frames.saturating_sub(1));
        let floor_cm = history_floor_cm(truth, &gathered.weights, &visits, last);
        let mut sequence = gathered.finish(plan.clone(), truth);
        sequence.cloth = cloth_facts(&sequence, &behaviour, floor_cm);
        Some(sequence)
    }

    /// The body model that comes nearest to the person.
    pub fn params(&self, frame: usize) -> BodyParams {
        let SequenceFrame { theta, params_trans, .. } = self.frames[frame];
        BodyParams { betas: self.betas, theta, trans: params_trans }
    }

    /// What can be seen from outside, in star pose, with the normals of that surface.
    pub fn star_mesh(&self, frame: usize) -> TriangleMesh {
        self.outer(frame, self.frames[frame].star.clone())
    }

    /// What can be seen from outside, in the space of the pose's `trans`.
    pub fn posed_mesh(&self, frame: usize) -> TriangleMesh {
        let SequenceFrame { theta, trans, star, .. } = &self.frames[frame];
        let (bones, _) = BoneTransforms::from_pose(theta, &self.rest_joints);
        let stars = star_transforms(&self.rest_joints);
        let posed = star.iter().zip(&self.weights).map(|(&point, weights)| {
            let at_rest = stars.blend(weights).inverse().transform_point3(point);
            bones.blend(weights).transform_point3(at_rest) + *trans
        });
        self.outer(frame, posed.collect())
    }

    /// Only what is visible; vertices keep their numbers.
    fn outer(&self, frame: usize, vertices: Vec<Vec3>) -> TriangleMesh {
        let visible = &self.frames[frame].visible;
        let triangles = self.triangles.iter().zip(visible);
        let seen = triangles.filter(|(_, visible)| **visible).map(|(t, _)| *t);
        let mut mesh = TriangleMesh::new(vertices, seen.collect());
        mesh.compute_normals();
        mesh
    }
}

/// Frames as they come, with all vertices, before the hidden ones are left out.
#[derive(Default)]
struct Gathered {
    weights: Vec<VertexWeights>,
    layers: Vec<u8>,
    frames: Vec<(SequenceFrame, Vec<[u32; 3]>)>,
}

impl Gathered {
    fn add(&mut self, truth: GroundTruth) {
        let GroundTruth {
            id,
            params,
            clothed_in_world,
            clothed_canonical,
            in_cloth,
            minimal,
            rest_joints,
            ..
        } = truth;
        if let Some(cloth) = in_cloth
            && self.frames.is_empty()
        {
            (self.weights, self.layers) = (cloth.weights, cloth.layers);
        }
        let frame = SequenceFrame {
            id,
            theta: params.theta,
            trans: minimal.joints[0] - rest_joints[0],
            params_trans: params.trans,
            star: clothed_canonical,
            visible: Vec::new(),
        };
        self.frames.push((frame, clothed_in_world.triangles));
    }

    /// Leaves out what is never seen, and numbers the rest anew.
    fn finish(self, plan: SequencePlan, truth: &Truth) -> Sequence {
        let person = truth.person();
        let (mut weights, mut layers) = (self.weights, self.layers);
        if weights.is_empty() {
            weights.clone_from(&person.body.skinning);
            layers = vec![0; weights.len()];
        }
        let mut triangles: Vec<[u32; 3]> = self
            .frames
            .iter()
            .flat_map(|(_, seen)| seen.iter().copied())
            .collect();
        triangles.sort_unstable();
        triangles.dedup();
        let mut number = vec![u32::MAX; weights.len()];
        let mut kept: Vec<usize> = triangles.iter().flatten().map(|&v| v as usize).collect();
        kept.sort_unstable();
        kept.dedup();
        for (new, &old) in kept.iter().enumerate() {
            number[old] = new as u32;
        }
        let frames = self.frames.into_iter().map(|(frame, mut seen)| {
            seen.sort_unstable();
            let visible = triangles
                .iter()
                .map(|t| seen.binary_search(t).is_ok())
                .collect();
            let star = kept.iter().map(|&v| frame.star[v]).collect();
            SequenceFrame { star, visible, ..frame }
        });
        Sequence {
            betas: person.betas,
            rest_joints: person.rest_joints,
            weights: kept.iter().map(|&v| weights[v]).collect(),
            layers: kept.iter().map(|&v| layers[v]).collect(),
            frames: frames.collect(),
            triangles: triangles
                .iter()
                .map(|t| t.map(|v| number[v as usize]))
                .collect(),
            numbers: kept.iter().map(|&v| v as u32).collect(),
            minimal: Vec::new(),
            cloth: None,
            plan,
        }
    }
}
