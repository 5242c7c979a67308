//! The surface of one person in the zero pose.

use std::sync::Arc;

use glam::Vec3;

use super::{Surface, vertex_normals};
use crate::{smpl::JOINT_COUNT, state::BETA_COUNT};

/// A [`Surface`] with betas applied; poses of it need no shape arithmetic any more.
#[derive(Clone, Debug)]
pub(crate) struct ShapedSurface {
    pub(crate) surface: Arc<Surface>,
    pub(crate) betas: [f32; BETA_COUNT],
    /// Zero pose, metres.
    pub(crate) vertices: Vec<Vec3>,
    pub(crate) normals: Vec<Vec3>,
    pub(crate) rest_joints: [Vec3; JOINT_COUNT],
    /// How the joints move with each beta.
    pub(crate) joint_dirs: [[Vec3; JOINT_COUNT]; BETA_COUNT],
}

impl ShapedSurface {
    pub(crate) fn new(surface: &Arc<Surface>, betas: [f32; BETA_COUNT]) -> Self {
        Self::wearing(surface, betas, None)
    }

    /// The surface of what the person wears: each of the model's vertices moved by an offset in the zero pose.
    pub(crate) fn wearing(
        surface: &Arc<Surface>,
        betas: [f32; BETA_COUNT],
        offsets: Option<&[Vec3]>,
    ) -> Self {
        let model = &surface.model;
        let mut whole = model.shaped_vertices(&betas);
        // Joints are the body's, whatever it wears.
        let rest_joints = model.joints(&whole);
        for (vertex, offset) in whole.iter_mut().zip(offsets.unwrap_or_default()) {
            *vertex += *offset;
        }
        let whole_normals = vertex_normals(&whole, &model.triangles);
        let joint_dirs = std::array::from_fn(|k| {
            model
                .shape_dirs
                .get(k)
                .map_or([Vec3::ZERO; JOINT_COUNT], |direction| {
                    model.joints(direction)
                })
        });
        let pick = |from: &[Vec3]| surface.vertices.iter().map(|&v| from[v as usize]).collect();
        Self {
            betas,
            vertices: pick(&whole),
            normals: pick(&whole_normals),
            rest_joints,
            joint_dirs,
            surface: Arc::clone(surface),
        }
    }
}
