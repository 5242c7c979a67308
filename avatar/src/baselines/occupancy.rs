//! Occupancy instead of distance: the loss, and the places of which the minimal body alone says on which side they are.

use effigy_fusion::{FusionError, TriangleMesh, mesh::closest_point::ClosestPoint};
use effigy_registration::BodyModel;
use glam::Vec3;
use rand::{Rng, RngExt as _, SeedableRng as _, rngs::StdRng};

use crate::{
    Subject,
    fine_tune::sampling::random_in_box,
    sdf::loss::{Known, LossPoint, LossTerms, Scale},
    skinning::star_body,
};

/// The network's output over this is the logit of being outside: half a centimetre off the surface is 73 % certain.
const SOFTNESS: f32 = 0.005;

/// Deeper in the minimal body than this a point is inside whatever is worn...
const SURELY_INSIDE_M: f32 = 0.01;
/// ...and farther from it than this, outside.
const SURELY_OUTSIDE_M: f32 = 0.08;

const LABELLED_POINTS: usize = 20_000;

/// Random places of the unit box that are inside or outside for certain.
pub struct BodyLabels {
    points: Vec<(Vec3, f32)>,
}

impl BodyLabels {
    pub fn new(model: &BodyModel, subject: &Subject, seed: u64) -> Result<Self, FusionError> {
        let star = TriangleMesh::new(star_body(model, &subject.betas), model.triangles.clone());
        let body = ClosestPoint::from_mesh(&star)?;
        let mut rng = StdRng::seed_from_u64(seed);
        let places: Vec<Vec3> = (0..LABELLED_POINTS)
            .map(|_| random_in_box(&mut rng))
            .collect();
        let in_canonical: Vec<Vec3> = places
            .iter()
            .map(|&place| subject.unit_box.canonical_from_unit(place))
            .collect();
        let distances_m = body.signed_distance_all(&in_canonical);
        let labelled = places.into_iter().zip(distances_m);
        let points = labelled.filter(|(_, distance_m)| {
            *distance_m < -SURELY_INSIDE_M || *distance_m > SURELY_OUTSIDE_M
        });
        Ok(Self { points: points.collect() })
    }

    /// Puts such a place where nothing is known.
    pub(super) fn fill(&self, points: &mut [Vec3], known: &mut [LossPoint], rng: &mut impl Rng) {
        if self.points.is_empty() {
            return;
        }
        for (point, known) in points.iter_mut().zip(known) {
            if known.known == Known::Nothing {
                let (place, distance) = self.points[rng.random_range(0..self.points.len())];
                (*point, known.known) = (place, Known::Distance(distance));
            }
        }
    }
}

/// Binary cross entropy of the side that is known; a point on the surface says nothing.
pub(super) fn occupancy_loss(
    scale: Scale,
    point: &LossPoint,
    value: f32,
) -> (LossTerms, f32, Vec3) {
    let outside = match point.known {
        Known::Distance(distance) => distance > 0.0,
        Known::Free { .. } => true,
        Known::Surface { .. } | Known::Nothing | Known::Repelled => {
            return (LossTerms::default(), 0.0, Vec3::ZERO);
        }
    };
    let logit = value / SOFTNESS;
    let towards = if outside { logit } else { -logit };
    // ln(1 + exp(-x)) without overflow.
    let entropy = (-towards.abs()).exp().ln_1p() + (-towards).max(0.0);
    let weight = scale.of_data(point.weight);
    let slope = -1.0 / (1.0 + towards.exp());
    let bar = weight * slope / SOFTNESS * if outside { 1.0 } else { -1.0 };
    let terms = LossTerms { distance: f64::from(weight * entropy), ..LossTerms::default() };
    (terms, bar, Vec3::ZERO)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_slope_of_the_entropy_matches_finite_differences() {
        for distance in [-0.02, 0.02] {
            let point = LossPoint { known: Known::Distance(distance), weight: 1.0 };
            let scale = Scale::of([point].iter());
            let loss = |value: f32| occupancy_loss(scale, &point, value);
            for value in [-0.02_f32, -0.003, 0.001, 0.015] {
                let step = 1e-4;
                let (above, below) = (loss(value + step).0.total(), loss(value - step).0.total());
                let measured = (above - below) / f64::from(2.0 * step);
                let error = (measured - f64::from(loss(value).1)).abs();
                // Single precision over this step, of slopes up to 200.
                assert!(error < 0.5, "{distance} {value}: {measured} off by {error}");
            }
        }
    }
}
