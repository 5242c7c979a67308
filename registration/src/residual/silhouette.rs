//! The body stays inside its silhouette: vertices seen beside the person are drawn back into the mask.

use glam::{Vec2, Vec3};

use super::{Row, RowSink, Term};
use crate::{observe::View, surface::PosedSurface};

/// A vertex that falls outside the mask, and the mask's nearest place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Pull {
    pub(crate) vertex: u32,
    /// The nearest cell of the mask, in the view's cells.
    pub(crate) target: Vec2,
    /// Unit vector from the target to the vertex, in the view.
    pub(crate) direction: Vec2,
    /// Metres a cell at the vertex's depth.
    pub(crate) metres_per_cell: f32,
}

/// `sum w max(0, g . (u(x) - u0) - slack)^2`, in metres at the vertex's depth, robust.
#[derive(Clone, Debug)]
pub(crate) struct Silhouette<'a> {
    pub(crate) pulls: &'a [Pull],
    pub(crate) view: &'a View,
    /// The mask is worn at its rim by about this much.
    pub(crate) slack_cells: f32,
    pub(crate) sigma_m: f32,
    pub(crate) outlier_m: f32,
    pub(crate) weight: f32,
}

impl Term for Silhouette<'_> {
    fn emit(&self, body: &PosedSurface<'_>, sink: &mut dyn RowSink) {
        let mut row = Row::new(0.0, 0.0);
        let plain = self.weight / (self.sigma_m * self.sigma_m);
        for pull in self.pulls {
            let vertex = pull.vertex as usize;
            let in_camera = self.view.camera_from_world * body.vertices[vertex];
            let cells = pull
                .direction
                .dot(self.view.pinhole.project(in_camera) - pull.target);
            let out_m = (cells - self.slack_cells).max(0.0) * pull.metres_per_cell;
            let share = 1.0 / (1.0 + (out_m / self.outlier_m).powi(2));
            row.restart(out_m, plain * share * share, plain * share * out_m * out_m);
            if sink.wants_derivatives() && out_m > 0.0 {
                let slope = self.slope_in_world(pull, in_camera);
                body.add_vertex(&mut row, vertex, slope);
            }
            sink.take(&row);
        }
    }
}

impl Silhouette<'_> {
    /// `d residual / d x`: `u = f x / z + c`, so `du = f (dx / z - x dz / z^2)`.
    fn slope_in_world(&self, pull: &Pull, in_camera: Vec3) -> Vec3 {
        let pinhole = &self.view.pinhole;
        let gx = pull.direction.x * pinhole.fx;
        let gy = pull.direction.y * pinhole.fy;
        let z = in_camera.z;
        let in_camera_slope = Vec3::new(
            gx / z,
            gy / z,
            -(gx * in_camera.x + gy * in_camera.y) / (z * z),
        ) * pull.metres_per_cell;
        self.view.camera_from_world.rotation.inverse() * in_camera_slope
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::residual::checker;

    #[test]
    fn derivatives_agree_with_finite_differences() {
        let view = View::empty_for_tests();
        let pulls: Vec<Pull> = (0..400)
            .step_by(11)
            .map(|vertex| Pull {
                vertex,
                target: Vec2::new(-300.0, -300.0),
                direction: Vec2::new(0.6, 0.8),
                metres_per_cell: 0.01,
            })
            .collect();
        checker::assert_derivatives(&Silhouette {
            pulls: &pulls,
            view: &view,
            slack_cells: 1.0,
            sigma_m: 0.02,
            outlier_m: 0.1,
            weight: 1.0,
        });
    }
}
