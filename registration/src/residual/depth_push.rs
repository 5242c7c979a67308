//! The body cannot be in front of what the camera saw through it.

use glam::Vec3;

use super::{Row, RowSink, Term};
use crate::surface::PosedSurface;

/// A vertex in front of the observed depth on its own ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Push {
    pub(crate) vertex: u32,
    /// The observed depth there less what may be noise, in metres along the camera's axis.
    pub(crate) depth_m: f32,
}

/// `sum w max(0, depth - z(x))^2`, robust.
#[derive(Clone, Debug)]
pub(crate) struct DepthPush<'a> {
    pub(crate) pushes: &'a [Push],
    /// The camera's axis and the camera's place along it, in the world.
    pub(crate) axis_in_world: Vec3,
    pub(crate) camera_in_world: Vec3,
    pub(crate) sigma_m: f32,
    pub(crate) outlier_m: f32,
    pub(crate) weight: f32,
}

impl Term for DepthPush<'_> {
    fn emit(&self, body: &PosedSurface<'_>, sink: &mut dyn RowSink) {
        let mut row = Row::new(0.0, 0.0);
        let plain = self.weight / (self.sigma_m * self.sigma_m);
        for push in self.pushes {
            let vertex = push.vertex as usize;
            let z = self
                .axis_in_world
                .dot(body.vertices[vertex] - self.camera_in_world);
            let depth_m = (push.depth_m - z).max(0.0);
            let share = 1.0 / (1.0 + (depth_m / self.outlier_m).powi(2));
            row.restart(
                depth_m,
                plain * share * share,
                plain * share * depth_m * depth_m,
            );
            if sink.wants_derivatives() && depth_m > 0.0 {
                body.add_vertex(&mut row, vertex, -self.axis_in_world);
            }
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
        let pushes: Vec<Push> = (0..400)
            .step_by(13)
            .map(|vertex| Push { vertex, depth_m: 3.5 })
            .collect();
        checker::assert_derivatives(&DepthPush {
            pushes: &pushes,
            axis_in_world: -Vec3::Z,
            camera_in_world: Vec3::new(0.0, 1.1, 0.3),
            sigma_m: 0.03,
            outlier_m: 0.3,
            weight: 1.0,
        });
    }
}
