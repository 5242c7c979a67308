//! Joints do not bend beyond what people can do.

use glam::{Mat3, Vec3};

use super::{Row, RowSink, Term};
use crate::{
    prior::JOINT_PRIORS,
    state::{FIRST_JOINT, axis_angle, left_jacobian_inverse},
    surface::PosedSurface,
};

/// `sum w (theta - limit)^2` over the axis-angle components beyond their limits.
#[derive(Clone, Copy, Debug)]
pub(crate) struct JointLimits {
    pub(crate) sigma_rad: f32,
}

impl Term for JointLimits {
    fn emit(&self, body: &PosedSurface<'_>, sink: &mut dyn RowSink) {
        let weight = 1.0 / (self.sigma_rad * self.sigma_rad);
        let mut row = Row::new(0.0, 0.0);
        for (joint, limits) in JOINT_PRIORS.iter().enumerate().skip(1) {
            let theta = axis_angle(body.state.rotations[joint]);
            let beyond = theta - theta.clamp(Vec3::from(limits.min), Vec3::from(limits.max));
            if beyond == Vec3::ZERO {
                continue;
            }
            let slope = left_jacobian_inverse(theta);
            for axis in 0..3 {
                if beyond[axis] != 0.0 {
                    row.restart(beyond[axis], weight, weight * beyond[axis] * beyond[axis]);
                    row.add(FIRST_JOINT + 3 * joint, row_of(&slope, axis));
                    sink.take(&row);
                }
            }
        }
    }
}

pub(super) fn row_of(matrix: &Mat3, row: usize) -> Vec3 {
    matrix.row(row)
}

#[cfg(test)]
mod tests {
    use glam::Quat;

    use super::*;
    use crate::{
        residual::{CostSum, checker},
        smpl::JOINT_COUNT,
    };

    #[test]
    fn derivatives_agree_with_finite_differences() {
        let mut state = checker::test_state();
        state.rotations[4] = Quat::from_scaled_axis(Vec3::new(-0.5, 0.7, -0.1));
        state.rotations[5] = Quat::from_scaled_axis(Vec3::new(1.0, 0.1, 0.1));
        state.rotations[18] = Quat::from_scaled_axis(Vec3::new(0.3, 0.8, 0.2));
        checker::assert_derivatives_at(&JointLimits { sigma_rad: 0.1 }, &state);
    }

    #[test]
    fn a_knee_bent_forwards_costs_and_one_bent_backwards_does_not() {
        let shaped = checker::test_surface();
        let cost = |bend_rad: f32| {
            let mut state = checker::test_state();
            state.rotations = [Quat::IDENTITY; JOINT_COUNT];
            state.rotations[4] = Quat::from_rotation_x(bend_rad);
            let mut sum = CostSum::default();
            JointLimits { sigma_rad: 0.1 }.emit(&PosedSurface::new(&shaped, &state), &mut sum);
            sum.0
        };
        assert_eq!(cost(1.2), 0.0);
        assert!(cost(-0.6) > 4.0);
    }
}
