//! Depth points pull the body's surface towards them, along the normal.

use glam::Vec3;

use super::{ClothSide, Row, RowSink, Term};
use crate::surface::{PosedSurface, REGION_COUNT};

/// A depth point and the vertex it is believed to lie on; world space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Match {
    pub(crate) vertex: u32,
    pub(crate) point: Vec3,
    /// The mean of the depth's and the body's normal at the time of matching, outwards (Rusinkiewicz 2019: the
    /// chord between two points of a circle is at right angles to it, so curved limbs pull true).
    pub(crate) normal: Vec3,
    pub(crate) sigma_m: f32,
    /// Trust in the match itself, 0 to 1.
    pub(crate) trust: f32,
}

/// `sum w(r) r^2`, `r = n . (p - x) - standoff`, positive where the point is outside the expected clothes.
#[derive(Clone, Debug)]
pub(crate) struct PointToPlane<'a> {
    pub(crate) matches: &'a [Match],
    /// In each region of the body.
    pub(crate) cloth: [ClothSide; REGION_COUNT],
    /// How far clothes stand off the skin there on average, where there are any.
    pub(crate) standoff_m: [f32; REGION_COUNT],
    /// The same of hair.
    pub(crate) hair_m: f32,
    /// Where clothes span a hollow, what is outside of the body says this little about it.
    pub(crate) say_in_hollows: f32,
    /// How many independent measurements one match is worth: neighbours share their errors.
    pub(crate) weight: f32,
}

impl Term for PointToPlane<'_> {
    fn emit(&self, body: &PosedSurface<'_>, sink: &mut dyn RowSink) {
        let mut row = Row::new(0.0, 0.0);
        for found in self.matches {
            let vertex = found.vertex as usize;
            let surface = &body.shaped.surface;
            let region = surface.region[vertex] as usize;
            let standoff_m = self.standoff_m[region] * surface.clothed[vertex]
                + self.hair_m * surface.hairy[vertex];
            let distance_m = found.normal.dot(found.point - body.vertices[vertex]) - standoff_m;
            let (weight, cost) = self.cloth[region].weight_and_cost(distance_m, found.sigma_m);
            let spanned = distance_m > 0.0 && surface.spanned[vertex];
            let say = if spanned { self.say_in_hollows } else { 1.0 };
            let scale = self.weight * found.trust * say;
            row.restart(distance_m, weight * scale, cost * scale);
            if sink.wants_derivatives() {
                body.add_vertex(&mut row, vertex, -found.normal);
            }
            sink.take(&row);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::residual::{CostSum, checker};

    #[test]
    fn derivatives_agree_with_finite_differences() {
        let shaped = checker::test_surface();
        let body = PosedSurface::new(&shaped, &checker::test_state());
        let matches: Vec<Match> = (0..400)
            .step_by(7)
            .map(|vertex| Match {
                vertex,
                point: body.vertices[vertex as usize] + Vec3::new(0.01, 0.02, 0.03),
                normal: Vec3::new(0.3, 0.5, 0.8).normalize_or_zero(),
                sigma_m: 0.003,
                trust: 1.0,
            })
            .collect();
        let cloth = ClothSide { outside: 0.02, inside: 0.008, outlier: 0.06 };
        checker::assert_derivatives(&PointToPlane {
            matches: &matches,
            cloth: [cloth; REGION_COUNT],
            standoff_m: [0.01; REGION_COUNT],
            hair_m: 0.008,
            say_in_hollows: 0.05,
            weight: 1.0,
        });
    }

    /// Trousers hang below the crotch; they must not pull the hips down.
    #[test]
    fn cloth_across_a_hollow_has_next_to_no_say_and_a_point_inside_has_all() {
        let shaped = checker::test_surface();
        let body = PosedSurface::new(&shaped, &checker::test_state());
        let surface = &shaped.surface;
        let vertex = (0..surface.spanned.len())
            .find(|&v| surface.spanned[v])
            .expect("a body has a crotch");
        let cost = |off_m: f32| {
            let normal = body.normals[vertex];
            let found = Match {
                vertex: vertex as u32,
                point: body.vertices[vertex] + normal * off_m,
                normal,
                sigma_m: 0.003,
                trust: 1.0,
            };
            let mut sum = CostSum::default();
            let cloth = ClothSide { outside: 0.02, inside: 0.02, outlier: 10.0 };
            let term = PointToPlane {
                matches: &[found],
                cloth: [cloth; REGION_COUNT],
                standoff_m: [0.0; REGION_COUNT],
                hair_m: 0.0,
                say_in_hollows: 0.05,
                weight: 1.0,
            };
            term.emit(&body, &mut sum);
            sum.0
        };
        assert!(cost(0.03) < 0.1 * cost(-0.03));
    }
}
