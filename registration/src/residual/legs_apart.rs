//! One leg is not inside the other: seen from the side, the near leg's points would draw both to where it is.

use glam::Vec3;

use super::{Row, RowSink, Term};
use crate::surface::{LegStation, PosedSurface};

/// A place where one leg is in the other.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LegContact {
    station: LegStation,
    least_m: f32,
    /// Unit, from the right leg to the left one.
    along: Vec3,
}

/// `sum w r^2`, `r = least - n . (x_left - x_right)` where that is more than zero; `x` is the middle of a leg, `n` the
/// direction in which they part.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LegsApart<'a> {
    pub(crate) contacts: &'a [LegContact],
    pub(crate) sigma_m: f32,
    /// Of all places down the legs together.
    pub(crate) weight: f32,
}

impl Term for LegsApart<'_> {
    fn emit(&self, body: &PosedSurface<'_>, sink: &mut dyn RowSink) {
        let mut row = Row::new(0.0, 0.0);
        let places = body.shaped.surface.legs.len().max(1) as f32;
        let each = self.weight / places / (self.sigma_m * self.sigma_m);
        for contact in self.contacts {
            let along = contact.along;
            let residual = contact.least_m - along.dot(apart(body, &contact.station));
            if residual <= 0.0 {
                continue;
            }
            row.restart(residual, each, each * residual * residual);
            if sink.wants_derivatives() {
                let LegStation { left, right, .. } = contact.station;
                for (vertices, sign) in [(left, -0.5), (right, 0.5)] {
                    for vertex in vertices {
                        body.add_vertex(&mut row, vertex as usize, along * sign);
                    }
                }
            }
            sink.take(&row);
        }
    }
}

/// Where legs are in each other as the body stands.
pub(crate) fn leg_contacts(body: &PosedSurface<'_>, found: &mut Vec<LegContact>) {
    /// Flesh gives way: legs may be this much closer than their radii say.
    const GIVE: f32 = 0.8;
    let hips = (body.joints[1] - body.joints[2]).normalize_or_zero();
    found.clear();
    for &station in &body.shaped.surface.legs {
        let least_m = GIVE * station.least_m;
        let apart = apart(body, &station);
        let short_m = least_m - apart.length();
        if short_m > 0.0 {
            // Legs in one place tell no direction; then hips do.
            let along = (apart + short_m * hips).normalize_or(hips);
            found.push(LegContact { station, least_m, along });
        }
    }
}

/// From the middle of the right leg to that of the left one.
fn apart(body: &PosedSurface<'_>, station: &LegStation) -> Vec3 {
    let middle = |[inner, outer]: [u32; 2]| {
        0.5 * (body.vertices[inner as usize] + body.vertices[outer as usize])
    };
    middle(station.left) - middle(station.right)
}

#[cfg(test)]
mod tests {
    use glam::Quat;

    use super::*;
    use crate::{
        residual::{CostSum, checker},
        smpl::JOINT_COUNT,
        solve::{Damping, take_step},
        state::BodyState,
    };

    /// Standing straight, the left leg swung to the right by this.
    fn swung(rad: f32) -> BodyState {
        let mut state = checker::test_state();
        state.rotations = [Quat::IDENTITY; JOINT_COUNT];
        state.rotations[1] = Quat::from_rotation_z(-rad);
        state
    }

    fn contacts(body: &PosedSurface<'_>) -> Vec<LegContact> {
        let mut found = Vec::new();
        leg_contacts(body, &mut found);
        found
    }

    fn term(contacts: &[LegContact]) -> LegsApart<'_> {
        LegsApart { contacts, sigma_m: 0.01, weight: 1.0 }
    }

    fn cost(body: &PosedSurface<'_>) -> f64 {
        let mut sum = CostSum::default();
        term(&contacts(body)).emit(body, &mut sum);
        sum.0
    }

    #[test]
    fn legs_side_by_side_cost_nothing_and_legs_in_one_place_move_apart() {
        let shaped = checker::test_surface();
        assert_eq!(cost(&PosedSurface::new(&shaped, &swung(0.0))), 0.0);
        let mut body = PosedSurface::new(&shaped, &swung(0.22));
        let before = cost(&body);
        assert!(before > 1.0, "{before}: the left foot is in the right one");
        let mut damping = Damping::default();
        for _ in 0..4 {
            let contacts = contacts(&body);
            body = take_step(body, &[&term(&contacts)], &mut damping).0;
        }
        let after = cost(&body);
        assert!(after < 0.05 * before, "{before} became {after}");
    }

    #[test]
    fn derivatives_agree_with_finite_differences() {
        let shaped = checker::test_surface();
        let state = swung(0.25);
        let body = PosedSurface::new(&shaped, &state);
        let mut deep = contacts(&body);
        // The others cease to count within the differences' steps.
        deep.retain(|found| found.least_m - apart(&body, &found.station).length() > 0.02);
        checker::assert_derivatives_at(&term(&deep), &state);
    }
}
