//! Somebody stands: the lower foot's sole is on the floor, whether the sensor can tell it from the floor or not.

use glam::Vec3;

use super::{Row, RowSink, Term};
use crate::surface::PosedSurface;

/// `sum w (y - sole)^2` over the lowest vertices, robust: who jumps is let go.
#[derive(Clone, Debug)]
pub(crate) struct Standing<'a> {
    pub(crate) vertices: &'a [u32],
    pub(crate) sole_m: f32,
    pub(crate) sigma_m: f32,
    pub(crate) outlier_m: f32,
    /// Of all vertices together.
    pub(crate) weight: f32,
}

impl Term for Standing<'_> {
    fn emit(&self, body: &PosedSurface<'_>, sink: &mut dyn RowSink) {
        let mut row = Row::new(0.0, 0.0);
        let each = self.weight / self.vertices.len().max(1) as f32;
        let plain = each / (self.sigma_m * self.sigma_m);
        for &vertex in self.vertices {
            let above_m = body.vertices[vertex as usize].y - self.sole_m;
            let share = 1.0 / (1.0 + (above_m / self.outlier_m).powi(2));
            row.restart(
                above_m,
                plain * share * share,
                plain * share * above_m * above_m,
            );
            if sink.wants_derivatives() {
                body.add_vertex(&mut row, vertex as usize, Vec3::Y);
            }
            sink.take(&row);
        }
    }
}

/// The vertices of the lower foot that would touch the floor first; none if both feet are high above it.
pub(crate) fn sole_of_lower_foot(
    body: &PosedSurface<'_>,
    foot_vertices: &[u32],
    found: &mut Vec<u32>,
) {
    /// A foot higher than this does not stand.
    const HIGHEST_M: f32 = 0.10;
    /// Flat enough to touch together.
    const LAYER_M: f32 = 0.012;
    found.clear();
    let height_m = |vertex: u32| body.vertices[vertex as usize].y;
    let lowest_m = foot_vertices
        .iter()
        .map(|&vertex| height_m(vertex))
        .fold(f32::MAX, f32::min);
    if lowest_m > HIGHEST_M {
        return;
    }
    found.extend(
        foot_vertices
            .iter()
            .filter(|&&vertex| height_m(vertex) < lowest_m + LAYER_M),
    );
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        residual::{CostSum, checker},
        smpl::JOINT_COUNT,
        state::BodyState,
        surface::PosedSurface,
    };

    fn standing(vertices: &[u32]) -> Standing<'_> {
        Standing { vertices, sole_m: 0.01, sigma_m: 0.01, outlier_m: 0.05, weight: 1.0 }
    }

    #[test]
    fn derivatives_agree_with_finite_differences() {
        let vertices: Vec<u32> = (0..400).step_by(29).collect();
        let term = Standing { outlier_m: 10.0, ..standing(&vertices) };
        checker::assert_derivatives(&term);
    }

    #[test]
    fn a_body_that_hovers_is_drawn_down_onto_its_soles() {
        let shaped = checker::test_surface();
        let feet: Vec<u32> = (0..shaped.vertices.len() as u32)
            .filter(|&v| matches!(shaped.surface.main_bone(v as usize), 7 | 8 | 10 | 11))
            .collect();
        let hovering = |lift_m: f32| {
            let mut state = checker::test_state();
            state.rotations = [glam::Quat::IDENTITY; JOINT_COUNT];
            let body = PosedSurface::new(&shaped, &state);
            state.trans.y += lift_m - body.lowest_y();
            state
        };
        let cost = |state: &BodyState| {
            let body = PosedSurface::new(&shaped, state);
            let mut soles = Vec::new();
            sole_of_lower_foot(&body, &feet, &mut soles);
            let mut sum = CostSum::default();
            standing(&soles).emit(&body, &mut sum);
            sum.0
        };
        assert!(cost(&hovering(0.01)) < 0.5 * cost(&hovering(0.03)));
        assert_eq!(
            cost(&hovering(0.3)),
            0.0,
            "nobody stands 0.3 m above the floor"
        );
    }
}
