//! Linear blend skinning: from shape and pose to vertices.

use glam::{Affine3A, Mat3, Vec3};

use super::{
    BodyModel, BodyParams, JOINT_COUNT, PARENTS, model::VertexWeights,
    rodrigues::rotation_from_axis_angle,
};

/// For each bone, the transform that takes rest space (zero pose) to the posed body, without `trans`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BoneTransforms(pub [Affine3A; JOINT_COUNT]);

/// A body in a pose; everything in the space of the parameters' `trans`.
#[derive(Clone, Debug)]
pub struct PosedBody {
    pub vertices: Vec<Vec3>,
    pub joints: [Vec3; JOINT_COUNT],
    /// Rest to posed, root rotation included, `trans` not included.
    pub bones: BoneTransforms,
}

impl BodyModel {
    /// The body for these parameters (Loper et al. 2015, eq. 2 to 8).
    pub fn pose(&self, params: &BodyParams) -> PosedBody {
        let shaped = self.shaped_vertices(&params.betas);
        let joints = self.joints(&shaped);
        self.pose_shaped(shaped, &joints, &params.theta, params.trans)
    }

    /// As [`Self::pose`], from an already shaped (or personal) zero-pose body.
    pub fn pose_shaped(
        &self,
        mut shaped: Vec<Vec3>,
        rest_joints: &[Vec3; JOINT_COUNT],
        theta: &[Vec3; JOINT_COUNT],
        trans: Vec3,
    ) -> PosedBody {
        self.add_pose_correctives(&mut shaped, theta);
        let (bones, joints) = BoneTransforms::from_pose(theta, rest_joints);
        let mut vertices = shaped;
        for (vertex, weights) in vertices.iter_mut().zip(&self.skinning) {
            *vertex = bones.blend(weights).transform_point3(*vertex) + trans;
        }
        PosedBody { vertices, joints: joints.map(|joint| joint + trans), bones }
    }

    /// Adds `P r` with `r = vec(R_j - I)` to zero-pose vertices; the root does not take part.
    pub fn add_pose_correctives(&self, vertices: &mut [Vec3], theta: &[Vec3; JOINT_COUNT]) {
        self.add_rotation_correctives(vertices, &theta.map(rotation_from_axis_angle));
    }

    /// As [`Self::add_pose_correctives`], from rotation matrices relative to the parents.
    pub fn add_rotation_correctives(&self, vertices: &mut [Vec3], rotations: &[Mat3; JOINT_COUNT]) {
        for (rotation, directions) in rotations[1..].iter().zip(self.pose_dirs.chunks_exact(9)) {
            let rotation = *rotation - Mat3::IDENTITY;
            for (entry, direction) in directions.iter().enumerate() {
                let value = rotation.row(entry / 3)[entry % 3];
                if value == 0.0 {
                    continue;
                }
                for (&vertex, &offset) in direction.vertices.iter().zip(&direction.offsets) {
                    vertices[vertex as usize] += offset * value;
                }
            }
        }
    }
}

impl BoneTransforms {
    pub const IDENTITY: Self = Self([Affine3A::IDENTITY; JOINT_COUNT]);

    /// `G_j = G_parent [R_j | J_j - J_parent]`, `A_j = G_j [I | -J_j]`; returns `A` and the posed joints.
    pub fn from_pose(
        theta: &[Vec3; JOINT_COUNT],
        rest_joints: &[Vec3; JOINT_COUNT],
    ) -> (Self, [Vec3; JOINT_COUNT]) {
        Self::from_rotations(&theta.map(rotation_from_axis_angle), rest_joints)
    }

    /// As [`Self::from_pose`], from rotation matrices relative to the parents.
    pub fn from_rotations(
        rotations: &[Mat3; JOINT_COUNT],
        rest_joints: &[Vec3; JOINT_COUNT],
    ) -> (Self, [Vec3; JOINT_COUNT]) {
        let mut global = [Affine3A::IDENTITY; JOINT_COUNT];
        for joint in 0..JOINT_COUNT {
            let parent = PARENTS[joint];
            let offset = if joint == 0 {
                rest_joints[0]
            } else {
                rest_joints[joint] - rest_joints[parent]
            };
            let local = Affine3A::from_mat3_translation(rotations[joint], offset);
            global[joint] = if joint == 0 {
                local
            } else {
                global[parent] * local
            };
        }
        let joints = global.map(|g| Vec3::from(g.translation));
        let mut bones = global;
        for (bone, rest_joint) in bones.iter_mut().zip(rest_joints) {
            *bone *= Affine3A::from_translation(-*rest_joint);
        }
        (Self(bones), joints)
    }

    /// Skins `rest` vertices into `posed` ones.
    pub fn skin_into(
        &self,
        skinning: &[VertexWeights],
        rest: &[Vec3],
        trans: Vec3,
        posed: &mut [Vec3],
    ) {
        for ((out, vertex), weights) in posed.iter_mut().zip(rest).zip(skinning) {
            *out = self.blend(weights).transform_point3(*vertex) + trans;
        }
    }

    /// The weighted sum of bone transforms for one vertex.
    pub fn blend(&self, weights: &VertexWeights) -> Affine3A {
        let mut sum = Affine3A::ZERO;
        for (&bone, &weight) in weights.bones.iter().zip(&weights.weights) {
            let transform = &self.0[bone as usize];
            sum.matrix3 += transform.matrix3 * weight;
            sum.translation += transform.translation * weight;
        }
        sum
    }
}
