//! The body as the solver moves it: rotations instead of axis-angles, so that a turn has no seam.

use effigy_capture::Rigid3;
use glam::{Mat3, Quat, Vec3};

use crate::smpl::{BodyParams, JOINT_COUNT};

/// Where each unknown lies in a step: three of `trans`, three a joint, ten betas.
pub(crate) const TRANS: usize = 0;
pub(crate) const FIRST_JOINT: usize = 3;
pub(crate) const FIRST_BETA: usize = FIRST_JOINT + 3 * JOINT_COUNT;
pub(crate) const BETA_COUNT: usize = 10;
pub(crate) const POSE_UNKNOWNS: usize = FIRST_BETA;
pub(crate) const ALL_UNKNOWNS: usize = FIRST_BETA + BETA_COUNT;

/// [`BodyParams`] with each joint's rotation (relative to its parent) as a quaternion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct BodyState {
    pub(crate) betas: [f32; BETA_COUNT],
    pub(crate) rotations: [Quat; JOINT_COUNT],
    pub(crate) trans: Vec3,
}

impl BodyState {
    /// The average body in the zero pose at the origin.
    pub(crate) const REST: Self = Self {
        betas: [0.0; BETA_COUNT],
        rotations: [Quat::IDENTITY; JOINT_COUNT],
        trans: Vec3::ZERO,
    };

    /// The same body after its world was moved; the root turns about `pelvis`, its rest joint.
    pub(crate) fn seen_from(&self, new_from_old: Rigid3, pelvis: Vec3) -> Self {
        let mut moved = *self;
        moved.rotations[0] = (new_from_old.rotation * self.rotations[0]).normalize();
        moved.trans = new_from_old * (self.trans + pelvis) - pelvis;
        moved
    }

    pub(crate) fn from_params(params: &BodyParams) -> Self {
        Self {
            betas: params.betas,
            rotations: params.theta.map(Quat::from_scaled_axis),
            trans: params.trans,
        }
    }

    pub(crate) fn to_params(self) -> BodyParams {
        BodyParams { betas: self.betas, theta: self.rotations.map(axis_angle), trans: self.trans }
    }

    /// A step of the solver: `trans += d`, `R_j <- exp(d_j) R_j` (in the parent's axes), `betas += d`.
    pub(crate) fn moved_by(&self, step: &[f64]) -> Self {
        let vec3_at = |i: usize| Vec3::new(step[i] as f32, step[i + 1] as f32, step[i + 2] as f32);
        let mut moved = *self;
        moved.trans += vec3_at(TRANS);
        for (joint, rotation) in moved.rotations.iter_mut().enumerate() {
            let turn = Quat::from_scaled_axis(vec3_at(FIRST_JOINT + 3 * joint));
            *rotation = (turn * *rotation).normalize();
        }
        if step.len() > FIRST_BETA {
            for (beta, &d) in moved.betas.iter_mut().zip(&step[FIRST_BETA..]) {
                *beta += d as f32;
            }
        }
        moved
    }
}

/// The rotation vector of a unit quaternion, at most pi long.
pub(crate) fn axis_angle(rotation: Quat) -> Vec3 {
    let shortest = if rotation.w < 0.0 {
        -rotation
    } else {
        rotation
    };
    shortest.to_scaled_axis()
}

/// The inverse of SO(3)'s left Jacobian: how `log(exp(d) exp(phi))` changes with `d` at zero.
pub(crate) fn left_jacobian_inverse(phi: Vec3) -> Mat3 {
    let angle_squared = phi.length_squared();
    let cross = cross_matrix(phi);
    let quadratic = if angle_squared < 1e-4 {
        1.0 / 12.0
    } else {
        let angle = angle_squared.sqrt();
        1.0 / angle_squared - 1.0 / (2.0 * angle * (0.5 * angle).tan())
    };
    Mat3::IDENTITY - cross * 0.5 + cross * cross * quadratic
}

/// `[v]x`, so that `[v]x u = v x u`.
pub(crate) fn cross_matrix(v: Vec3) -> Mat3 {
    Mat3::from_cols(
        Vec3::new(0.0, v.z, -v.y),
        Vec3::new(-v.z, 0.0, v.x),
        Vec3::new(v.y, -v.x, 0.0),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rotation_vectors_survive_the_round_trip_through_the_state() {
        let mut params = BodyParams::ZERO;
        params.theta[0] = Vec3::new(0.1, 3.0, -0.2);
        params.theta[16] = Vec3::new(0.3, -0.8, -1.2);
        let back = BodyState::from_params(&params).to_params();
        for (a, b) in params.theta.iter().zip(&back.theta) {
            assert!((*a - *b).length() < 1e-5, "{a} became {b}");
        }
    }

    #[test]
    fn inverse_left_jacobian_agrees_with_finite_differences() {
        for phi in [
            Vec3::new(0.004, -0.002, 0.003),
            Vec3::new(0.5, -1.2, 0.7),
            Vec3::new(2.0, 0.4, 1.5),
        ] {
            let analytic = left_jacobian_inverse(phi);
            let step = 1e-3;
            for axis in 0..3 {
                let d = Vec3::AXES[axis] * step;
                let log =
                    |d: Vec3| axis_angle(Quat::from_scaled_axis(d) * Quat::from_scaled_axis(phi));
                let numeric = (log(d) - log(-d)) / (2.0 * step);
                // Single precision over a step of 1e-3: about 1e-7 / 1e-3.
                assert!(
                    (numeric - analytic.col(axis)).length() < 2e-3,
                    "{phi} axis {axis}"
                );
            }
        }
    }
}
