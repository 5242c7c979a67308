//! Where nothing is seen, joints are as people usually hold them.

use glam::Vec3;

use super::{Row, RowSink, Term, joint_limits::row_of};
use crate::{
    prior::JOINT_PRIORS,
    state::{FIRST_JOINT, axis_angle, left_jacobian_inverse},
    surface::PosedSurface,
};

/// `w sum ((theta - mean) / sigma)^2`: a Gaussian for each axis of each joint, and an upright root.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PosePrior {
    pub(crate) weight: f32,
}

impl Term for PosePrior {
    fn emit(&self, body: &PosedSurface<'_>, sink: &mut dyn RowSink) {
        let mut row = Row::new(0.0, 0.0);
        for (joint, prior) in JOINT_PRIORS.iter().enumerate().skip(1) {
            let theta = axis_angle(body.state.rotations[joint]);
            let slope = left_jacobian_inverse(theta);
            for axis in 0..3 {
                let residual = (theta[axis] - prior.mean[axis]) / prior.sigma[axis];
                row.restart(residual, self.weight, self.weight * residual * residual);
                row.add(
                    FIRST_JOINT + 3 * joint,
                    row_of(&slope, axis) / prior.sigma[axis],
                );
                sink.take(&row);
            }
        }
        self.emit_upright(body, &mut row, sink);
    }
}

impl PosePrior {
    /// The pelvis' own up axis stays near the world's: residuals are its x and z.
    fn emit_upright(self, body: &PosedSurface<'_>, row: &mut Row, sink: &mut dyn RowSink) {
        /// People bend at the hips before they tilt the pelvis much further than this.
        const TILT_SIGMA_RAD: f32 = 0.4;
        let up = body.state.rotations[0] * Vec3::Y;
        for axis in [Vec3::X, Vec3::Z] {
            let residual = up.dot(axis) / TILT_SIGMA_RAD;
            row.restart(residual, self.weight, self.weight * residual * residual);
            // up moves by d x up; along the axis that is d . (up x axis).
            row.add(FIRST_JOINT, up.cross(axis) / TILT_SIGMA_RAD);
            sink.take(row);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::residual::checker;

    #[test]
    fn derivatives_agree_with_finite_differences() {
        checker::assert_derivatives(&PosePrior { weight: 1.0 });
    }
}
