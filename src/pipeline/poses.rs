//! `--poses`: each frame's body in the depth camera's space, for others to score.

use std::{collections::BTreeMap, path::Path};

use anyhow::Context as _;
use effigy_capture::Rigid3;
use effigy_registration::{
    BodyModel, BodyParams, RegisteredFrame, Tracking,
    smpl::{BoneTransforms, JOINT_NAMES, rotation_from_axis_angle},
};
use glam::{Mat3, Quat, Vec3};
use serde::Serialize;

use crate::files;

/// The whole file.
#[derive(Debug, Serialize)]
struct PosesFile<'a> {
    schema: &'static str,
    space: &'static str,
    frames: &'a [PoseRecord],
}

/// One frame; what is not tracked has no numbers.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct PoseRecord {
    frame: u64,
    timestamp_ns: u64,
    state: &'static str,
    #[serde(flatten)]
    body: Option<BodyInCamera>,
}

#[derive(Clone, Debug, Serialize)]
struct BodyInCamera {
    betas: [f32; 10],
    theta: [Vec3; 24],
    trans: Vec3,
    joints: BTreeMap<&'static str, Vec3>,
    residual_rms_m: f32,
}

/// Collects the frames of a run.
#[derive(Debug, Default)]
pub(crate) struct PoseLog {
    frames: Vec<PoseRecord>,
}

impl PoseLog {
    pub(crate) fn add(&mut self, registered: &RegisteredFrame, body: &BodyModel) {
        let (state, in_camera) = match &registered.tracking {
            Tracking::Tracked { params, residual_rms_m, .. } => {
                let camera_from_world = registered.world_from_camera.inverse();
                (
                    "tracked",
                    Some(in_camera(params, camera_from_world, body, *residual_rms_m)),
                )
            }
            Tracking::Partial { .. } => ("partial", None),
            Tracking::Lost { .. } => ("lost", None),
        };
        self.frames.push(PoseRecord {
            frame: registered.clean.id.0,
            timestamp_ns: registered.clean.timestamp.0,
            state,
            body: in_camera,
        });
    }

    pub(crate) fn write(&self, path: &Path) -> anyhow::Result<()> {
        let file = PosesFile {
            schema: "effigy.poses/1",
            space: "depth camera: x right, y down, z forward, metres; theta is axis-angle, radians",
            frames: &self.frames,
        };
        let text = serde_json::to_string(&file).context("poses are plain numbers")?;
        files::write(path, text + "\n")
    }
}

fn in_camera(
    params: &BodyParams,
    camera_from_world: Rigid3,
    body: &BodyModel,
    residual_rms_m: f32,
) -> BodyInCamera {
    let rest_joints = body.joints(&body.shaped_vertices(&params.betas));
    let moved = transformed(params, camera_from_world, rest_joints[0]);
    let (_, joints) = BoneTransforms::from_pose(&moved.theta, &rest_joints);
    BodyInCamera {
        betas: moved.betas,
        theta: moved.theta,
        trans: moved.trans,
        joints: JOINT_NAMES
            .into_iter()
            .zip(joints.map(|joint| joint + moved.trans))
            .collect(),
        residual_rms_m,
    }
}

/// The same body in another space: the root turns about the pelvis, so `trans` has to make up for it.
pub(crate) fn transformed(params: &BodyParams, b_from_a: Rigid3, rest_pelvis: Vec3) -> BodyParams {
    let root = b_from_a.rotation_matrix() * rotation_from_axis_angle(params.theta[0]);
    let mut moved = *params;
    moved.theta[0] = axis_angle(root);
    moved.trans = b_from_a * (rest_pelvis + params.trans) - rest_pelvis;
    moved
}

fn axis_angle(rotation: Mat3) -> Vec3 {
    Quat::from_mat3(&rotation).normalize().to_scaled_axis()
}
