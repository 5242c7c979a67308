//! From one frame to the next a body goes on moving about as it did.

use glam::Vec3;

use super::{Row, RowSink, Term, joint_limits::row_of};
use crate::{
    smpl::JOINT_COUNT,
    state::{BodyState, FIRST_JOINT, TRANS, axis_angle, left_jacobian_inverse},
    surface::PosedSurface,
};

/// `w (|log(R R_predicted^-1)|^2 / sigma^2 + |trans - predicted|^2 / sigma^2)`.
#[derive(Clone, Debug)]
pub(crate) struct Temporal<'a> {
    pub(crate) predicted: &'a BodyState,
    pub(crate) rotation_sigma_rad: f32,
    pub(crate) trans_sigma_m: f32,
    pub(crate) weight: f32,
}

impl Term for Temporal<'_> {
    fn emit(&self, body: &PosedSurface<'_>, sink: &mut dyn RowSink) {
        let mut row = Row::new(0.0, 0.0);
        for joint in 0..JOINT_COUNT {
            let turn = body.state.rotations[joint] * self.predicted.rotations[joint].inverse();
            let turn = axis_angle(turn);
            let slope = left_jacobian_inverse(turn);
            for axis in 0..3 {
                let residual = turn[axis] / self.rotation_sigma_rad;
                row.restart(residual, self.weight, self.weight * residual * residual);
                row.add(
                    FIRST_JOINT + 3 * joint,
                    row_of(&slope, axis) / self.rotation_sigma_rad,
                );
                sink.take(&row);
            }
        }
        let moved = (body.state.trans - self.predicted.trans) / self.trans_sigma_m;
        for axis in 0..3 {
            row.restart(
                moved[axis],
                self.weight,
                self.weight * moved[axis] * moved[axis],
            );
            row.add(TRANS, Vec3::AXES[axis] / self.trans_sigma_m);
            sink.take(&row);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::residual::checker;

    #[test]
    fn derivatives_agree_with_finite_differences() {
        let mut step = [0.07; crate::state::ALL_UNKNOWNS];
        step[5] = -0.4;
        let predicted = checker::test_state().moved_by(&step);
        checker::assert_derivatives(&Temporal {
            predicted: &predicted,
            rotation_sigma_rad: 0.2,
            trans_sigma_m: 0.05,
            weight: 1.0,
        });
    }
}
