//! Feet do not go through the floor, which is at y = 0, nor through the soles under them.

use glam::Vec3;

use super::{Row, RowSink, Term};
use crate::surface::PosedSurface;

/// `sum w min(0, y - sole)^2` over the vertices of ankles and feet.
#[derive(Clone, Debug)]
pub(crate) struct FloorTerm<'a> {
    pub(crate) vertices: &'a [u32],
    pub(crate) sole_m: f32,
    pub(crate) sigma_m: f32,
    pub(crate) weight: f32,
}

impl Term for FloorTerm<'_> {
    fn emit(&self, body: &PosedSurface<'_>, sink: &mut dyn RowSink) {
        let mut row = Row::new(0.0, 0.0);
        let weight = self.weight / (self.sigma_m * self.sigma_m);
        for &vertex in self.vertices {
            let below_m = (body.vertices[vertex as usize].y - self.sole_m).min(0.0);
            row.restart(below_m, weight, weight * below_m * below_m);
            if sink.wants_derivatives() {
                if below_m == 0.0 {
                    continue;
                }
                body.add_vertex(&mut row, vertex as usize, Vec3::Y);
            }
            sink.take(&row);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{residual::checker, surface::PosedSurface};

    #[test]
    fn derivatives_agree_with_finite_differences() {
        let shaped = checker::test_surface();
        let body = PosedSurface::new(&shaped, &checker::test_state());
        let below: Vec<u32> = (0..body.vertices.len() as u32)
            .filter(|&v| body.vertices[v as usize].y < -0.02)
            .collect();
        checker::assert_derivatives(&FloorTerm {
            vertices: &below,
            sole_m: 0.01,
            sigma_m: 0.01,
            weight: 1.0,
        });
    }
}
