//! What a motion needs to know about the body that will perform it.

use glam::Vec3;

use crate::smpl::{BodyModel, BoneTransforms, JOINT_COUNT, VertexWeights};

/// Ankles and balls of the feet.
const FOOT_JOINTS: [u8; 4] = [7, 8, 10, 11];

/// A body in the zero pose: where its joints are, and what it stands on.
#[derive(Clone, Debug)]
pub struct RestBody {
    pub joints: [Vec3; JOINT_COUNT],
    soles: Vec<(Vec3, VertexWeights)>,
    others: Vec<(Vec3, VertexWeights)>,
}

impl RestBody {
    /// The minimal body of these betas.
    pub fn of(body: &BodyModel, betas: &[f32; 10]) -> Self {
        let shaped = body.shaped_vertices(betas);
        Self::with_surface(body, &body.joints(&shaped), &shaped)
    }

    /// A body with a surface of its own (shoes, say) on the model's topology, in the zero pose.
    pub fn with_surface(body: &BodyModel, joints: &[Vec3; JOINT_COUNT], vertices: &[Vec3]) -> Self {
        Self::skinned(joints, vertices, &body.skinning)
    }

    /// Any surface in the zero pose that SMPL's bones move.
    pub fn skinned(
        joints: &[Vec3; JOINT_COUNT],
        vertices: &[Vec3],
        skinning: &[VertexWeights],
    ) -> Self {
        let on_foot = |weights: &VertexWeights| {
            let share = |(bone, weight): (&u8, &f32)| {
                if FOOT_JOINTS.contains(bone) {
                    *weight
                } else {
                    0.0
                }
            };
            weights
                .bones
                .iter()
                .zip(&weights.weights)
                .map(share)
                .sum::<f32>()
                > 0.5
        };
        let (soles, others): (Vec<_>, Vec<_>) = vertices
            .iter()
            .copied()
            .zip(skinning.iter().copied())
            .partition(|(_, weights)| on_foot(weights));
        // Enough to notice a hand or a knee on the floor.
        let others = others.into_iter().step_by(16).collect();
        Self { joints: *joints, soles, others }
    }

    /// The lowest point of the feet in the zero pose: the height of the floor there.
    pub fn sole_height_m(&self) -> f32 {
        let lowest = self.soles.iter().map(|(v, _)| v.y).fold(f32::MAX, f32::min);
        if lowest == f32::MAX {
            self.joints[7].y - 0.08
        } else {
            lowest
        }
    }

    /// The height of the lowest point of the body in a pose, `trans` not included.
    pub fn lowest_point_m(&self, theta: &[Vec3; JOINT_COUNT]) -> f32 {
        let (bones, joints) = BoneTransforms::from_pose(theta, &self.joints);
        let lowest_joint = joints.iter().map(|j| j.y).fold(f32::MAX, f32::min);
        self.soles
            .iter()
            .chain(&self.others)
            .map(|(vertex, weights)| bones.blend(weights).transform_point3(*vertex).y)
            .fold(lowest_joint, f32::min)
    }
}
