//! How posed vertices and joints move with theta, betas and trans.
//!
//! Pose correctives enter at their present value; their own (small) change with theta is left out.
//! Everything else is exact, the way betas move the joints included.

use std::sync::Arc;

use glam::{Mat3, Vec3};

use super::{BodyModel, BodyParams, JOINT_COUNT, PARENTS, PosedBody, Poser};

/// Columns of a row: 72 of theta (joint by joint, x y z), 10 of betas, 3 of trans.
pub const PARAMETER_COUNT: usize = 85;
const FIRST_BETA: usize = 72;
const FIRST_TRANS: usize = 82;

/// A posed body that knows its derivatives; reused from pose to pose.
#[derive(Clone, Debug)]
pub struct PoseJacobian {
    poser: Poser,
    trans: Vec3,
    /// For each joint, the axes about which its three theta components turn everything after it.
    axes: [[Vec3; 3]; JOINT_COUNT],
    /// Rest joints a unit of each beta; constant for a model.
    joint_shape_dirs: [[Vec3; 10]; JOINT_COUNT],
    /// Posed joints (without trans) a unit of each beta.
    posed_joint_dirs: [[Vec3; 10]; JOINT_COUNT],
    /// The translations of the bone transforms a unit of each beta.
    bone_dirs: [[Vec3; 10]; JOINT_COUNT],
}

impl PoseJacobian {
    pub fn new(model: Arc<BodyModel>) -> Self {
        let zero = [[Vec3::ZERO; 10]; JOINT_COUNT];
        let joint_shape_dirs = std::array::from_fn(|joint| {
            let row = &model.joint_regressor[joint];
            std::array::from_fn(|beta| row.apply(&model.shape_dirs[beta]))
        });
        let mut jacobian = Self {
            poser: Poser::new(model),
            trans: Vec3::ZERO,
            axes: [[Vec3::ZERO; 3]; JOINT_COUNT],
            joint_shape_dirs,
            posed_joint_dirs: zero,
            bone_dirs: zero,
        };
        jacobian.update(&BodyParams::ZERO);
        jacobian
    }

    /// Poses the body and prepares the derivatives there.
    pub fn update(&mut self, params: &BodyParams) -> &PosedBody {
        self.poser.pose(params);
        self.trans = params.trans;
        let bones = &self.poser.posed().bones;
        let global: [Mat3; JOINT_COUNT] = bones.0.map(|bone| Mat3::from(bone.matrix3));
        for joint in 0..JOINT_COUNT {
            let parent = if joint == 0 {
                Mat3::IDENTITY
            } else {
                global[PARENTS[joint]]
            };
            let axes = parent * left_jacobian(params.theta[joint]);
            self.axes[joint] = [axes.x_axis, axes.y_axis, axes.z_axis];
            for beta in 0..10 {
                let moved = self.joint_shape_dirs[joint][beta];
                self.posed_joint_dirs[joint][beta] = if joint == 0 {
                    moved
                } else {
                    let before = self.joint_shape_dirs[PARENTS[joint]][beta];
                    self.posed_joint_dirs[PARENTS[joint]][beta] + parent * (moved - before)
                };
                self.bone_dirs[joint][beta] =
                    self.posed_joint_dirs[joint][beta] - global[joint] * moved;
            }
        }
        self.poser.posed()
    }

    /// The body at the parameters of the last [`Self::update`].
    pub fn posed(&self) -> &PosedBody {
        self.poser.posed()
    }

    pub fn poser(&self) -> &Poser {
        &self.poser
    }

    /// Metres of the posed vertex a unit of each parameter.
    pub fn vertex_rows(&self, vertex: usize, rows: &mut [Vec3; PARAMETER_COUNT]) {
        let model = self.poser.model();
        let skin = &model.skinning[vertex];
        let rest = self.poser.corrected()[vertex];
        let bones = &self.poser.posed().bones;
        let blended = Mat3::from(bones.blend(skin).matrix3);
        for beta in 0..10 {
            rows[FIRST_BETA + beta] = blended * model.shape_dirs[beta][vertex];
        }
        // What hangs on each joint: the weight, and the weighted positions, of the bones after it.
        let mut hanging = [(0.0_f32, Vec3::ZERO); JOINT_COUNT];
        for (&bone, &weight) in skin.bones.iter().zip(&skin.weights) {
            if weight == 0.0 {
                continue;
            }
            let bone = bone as usize;
            let position = (bones.0[bone].transform_point3(rest) + self.trans) * weight;
            for beta in 0..10 {
                rows[FIRST_BETA + beta] += self.bone_dirs[bone][beta] * weight;
            }
            for_each_up_the_chain(bone, |joint| {
                hanging[joint].0 += weight;
                hanging[joint].1 += position;
            });
        }
        self.write_theta_and_trans(&hanging, rows);
    }

    /// Metres of the posed joint a unit of each parameter.
    pub fn joint_rows(&self, joint: usize, rows: &mut [Vec3; PARAMETER_COUNT]) {
        rows[FIRST_BETA..FIRST_TRANS].copy_from_slice(&self.posed_joint_dirs[joint]);
        let mut hanging = [(0.0, Vec3::ZERO); JOINT_COUNT];
        if joint != 0 {
            let position = self.poser.posed().joints[joint];
            for_each_up_the_chain(PARENTS[joint], |above| hanging[above] = (1.0, position));
        }
        self.write_theta_and_trans(&hanging, rows);
    }

    /// A turn `d` of joint j about its axis `a` moves a point `x` on it by `a x (x - joint) d`.
    fn write_theta_and_trans(
        &self,
        hanging: &[(f32, Vec3); JOINT_COUNT],
        rows: &mut [Vec3; PARAMETER_COUNT],
    ) {
        let joints = &self.poser.posed().joints;
        for (joint, &(weight, position)) in hanging.iter().enumerate() {
            let arm = position - joints[joint] * weight;
            for (component, axis) in self.axes[joint].iter().enumerate() {
                rows[3 * joint + component] = axis.cross(arm);
            }
        }
        rows[FIRST_TRANS..].copy_from_slice(&Vec3::AXES);
    }
}

fn for_each_up_the_chain(from: usize, mut act: impl FnMut(usize)) {
    let mut joint = from;
    loop {
        act(joint);
        if joint == 0 {
            return;
        }
        joint = PARENTS[joint];
    }
}

/// `d exp(w + dw) = exp(J dw) exp(w)`: `J = a I + b [w]x + c w w^T` with `a = sin t / t`,
/// `b = (1 - cos t) / t^2`, `c = (1 - a) / t^2`.
fn left_jacobian(axis_angle: Vec3) -> Mat3 {
    let squared = axis_angle.length_squared();
    let (a, b, c) = if squared < 1e-4 {
        (
            1.0 - squared / 6.0,
            0.5 - squared / 24.0,
            1.0 / 6.0 - squared / 120.0,
        )
    } else {
        let angle = squared.sqrt();
        let a = angle.sin() / angle;
        (a, (1.0 - angle.cos()) / squared, (1.0 - a) / squared)
    };
    let w = axis_angle;
    Mat3::from_cols(
        glam::vec3(a, b * w.z, -b * w.y) + w * (c * w.x),
        glam::vec3(-b * w.z, a, b * w.x) + w * (c * w.y),
        glam::vec3(b * w.y, -b * w.x, a) + w * (c * w.z),
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::smpl::rotation_from_axis_angle;

    #[test]
    fn left_jacobian_is_the_derivative_of_the_rotation() {
        let w = glam::vec3(0.7, -1.1, 0.4);
        let step = 5e-3;
        for axis in 0..3 {
            let mut d = Vec3::ZERO;
            d[axis] = step;
            let difference = rotation_from_axis_angle(w + d) - rotation_from_axis_angle(w - d);
            let spin = difference * (0.5 / step) * rotation_from_axis_angle(w).transpose();
            let expected = glam::vec3(spin.y_axis.z, spin.z_axis.x, spin.x_axis.y);
            // A central difference of step h is off by h^2 / 6.
            assert!((left_jacobian(w).col(axis) - expected).length() < 1e-4);
        }
    }
}
