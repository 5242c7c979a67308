//! From one frame to the next a body goes on moving about as it did.

use glam::Vec3;

use super::{Row, RowSink, Term, joint_limits::row_of};
use crate::{
    smpl::JOINT_COUNT,
    state::{BodyState, FIRST_JOINT, TRANS, axis_angle, left_jacobian_inverse},
    surface::PosedSurface,
};

/// What is expected of the next frame.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Prediction {
    pub(crate) state: BodyState,
    /// For each joint 1 if it hardly moves, falling to 0 with speed; and for `trans`.
    pub(crate) joints_still: [f32; JOINT_COUNT],
    pub(crate) trans_still: f32,
}

/// `w (|log(R R_predicted^-1)|^2 / sigma^2 + |trans - predicted|^2 / sigma^2)`.
#[derive(Clone, Debug)]
pub(crate) struct Temporal<'a> {
    pub(crate) predicted: &'a Prediction,
    pub(crate) rotation_sigma_rad: f32,
    pub(crate) trans_sigma_m: f32,
    pub(crate) weight: f32,
    /// What comes to the weight for a joint at rest: whoever holds still goes on holding still, while a movement
    /// is known only by what is seen.
    pub(crate) still_weight: f32,
}

impl Term for Temporal<'_> {
    fn emit(&self, body: &PosedSurface<'_>, sink: &mut dyn RowSink) {
        let mut row = Row::new(0.0, 0.0);
        let predicted = &self.predicted.state;
        for joint in 0..JOINT_COUNT {
            let weight = self.weight + self.still_weight * self.predicted.joints_still[joint];
            let turn = body.state.rotations[joint] * predicted.rotations[joint].inverse();
            let turn = axis_angle(turn);
            let slope = left_jacobian_inverse(turn);
            for axis in 0..3 {
                let residual = turn[axis] / self.rotation_sigma_rad;
                row.restart(residual, weight, weight * residual * residual);
                row.add(
                    FIRST_JOINT + 3 * joint,
                    row_of(&slope, axis) / self.rotation_sigma_rad,
                );
                sink.take(&row);
            }
        }
        let weight = self.weight + self.still_weight * self.predicted.trans_still;
        let moved = (body.state.trans - predicted.trans) / self.trans_sigma_m;
        for axis in 0..3 {
            row.restart(moved[axis], weight, weight * moved[axis] * moved[axis]);
            row.add(TRANS, Vec3::AXES[axis] / self.trans_sigma_m);
            sink.take(&row);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::residual::{CostSum, checker};

    #[test]
    fn a_joint_at_rest_is_held_and_a_moving_one_is_let_go() {
        let shaped = checker::test_surface();
        let state = checker::test_state();
        let mut predicted =
            Prediction { state, joints_still: [0.0; JOINT_COUNT], trans_still: 0.0 };
        predicted.joints_still[18] = 1.0;
        let cost_of_turning = |joint: usize| {
            let mut turned = state;
            turned.rotations[joint] = glam::Quat::from_rotation_y(0.1) * turned.rotations[joint];
            let mut sum = CostSum::default();
            let term = Temporal {
                predicted: &predicted,
                rotation_sigma_rad: 0.1,
                trans_sigma_m: 0.05,
                weight: 1.0,
                still_weight: 8.0,
            };
            term.emit(&PosedSurface::new(&shaped, &turned), &mut sum);
            sum.0
        };
        let (still, moving) = (cost_of_turning(18), cost_of_turning(19));
        assert!((still / moving - 9.0).abs() < 0.01, "{still} and {moving}");
    }

    #[test]
    fn derivatives_agree_with_finite_differences() {
        let mut step = [0.07; crate::state::ALL_UNKNOWNS];
        step[5] = -0.4;
        let state = checker::test_state().moved_by(&step);
        let predicted = Prediction { state, joints_still: [0.3; JOINT_COUNT], trans_still: 0.6 };
        checker::assert_derivatives(&Temporal {
            predicted: &predicted,
            rotation_sigma_rad: 0.2,
            trans_sigma_m: 0.05,
            weight: 1.0,
            still_weight: 3.0,
        });
    }
}
