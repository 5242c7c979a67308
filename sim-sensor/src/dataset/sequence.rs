//! A sequence in memory: surfaces in star pose, and what follows from them.

use effigy_capture::{DepthImage, FrameId, Intrinsics, Rigid3};
use effigy_fusion::mesh::{TriangleMesh, z_buffer::Rasterizer};
use effigy_registration::{
    BodyParams,
    smpl::{BoneTransforms, JOINT_COUNT, VertexWeights, star_transforms},
};
use glam::{Quat, Vec3};

use super::plan::SequencePlan;
use crate::truth::{GroundTruth, Truth};

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
    /// All that can be seen from outside in some frame.
    pub triangles: Vec<[u32; 3]>,
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
        let mut gathered = Gathered::default();
        for frame in 0..u64::from(plan.frames) {
            if !go_on() {
                return None;
            }
            gathered.add(truth.at(FrameId(frame)));
        }
        Some(gathered.finish(plan.clone(), truth))
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

    /// MetaAvatar's view of a frame, without noise (seed paper, section 4.1): from `yaw_rad` to the side of where a
    /// camera at [`protocol_camera`] stands. Depth in millimetres, and where the camera stands.
    pub fn protocol_depth(&self, frame: usize, yaw_rad: f32) -> (DepthImage, Rigid3) {
        let (camera, distance_m) = protocol_camera();
        let pelvis = self.rest_joints[0] + self.frames[frame].trans;
        let turn = Quat::from_rotation_y(yaw_rad);
        let world_from_camera = Rigid3 {
            rotation: turn * Quat::from_rotation_x(std::f32::consts::PI),
            translation: pelvis + turn * Vec3::Z * distance_m,
        };
        let camera_from_world = world_from_camera.inverse();
        let mesh = self.posed_mesh(frame);
        let seen: Vec<Vec3> = mesh
            .vertices
            .iter()
            .map(|&v| camera_from_world * v)
            .collect();
        let mut rasterizer = Rasterizer::new(camera);
        let raster = rasterizer.draw(&seen, &mesh.triangles);
        let depth = raster.depth.iter().map(|z| (z * 1e3).round() as u16);
        let image = DepthImage::new(camera.width, camera.height, depth.collect());
        (
            image.expect("the raster has the camera's size"),
            world_from_camera,
        )
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

/// MetaAvatar's camera and its distance from the body in metres: 250 x 250 pixels, f = 250 px.
pub fn protocol_camera() -> (Intrinsics, f32) {
    let intrinsics =
        Intrinsics { width: 250, height: 250, fx: 250.0, fy: 250.0, cx: 125.0, cy: 125.0 };
    (intrinsics, 3.0)
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
            plan,
        }
    }
}
