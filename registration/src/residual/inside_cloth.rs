//! The body stays inside the clothes: which side of the body a depth point is on decides what it costs.

/// Scales, in metres, of the distance from the body's surface to an observed point, along the surface's normal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ClothSide {
    /// A point outside the body by this much costs one: cloth may stand off.
    pub(crate) outside: f32,
    /// A point inside the body by this much costs one: cloth never does that.
    pub(crate) inside: f32,
    /// Beyond this the point belongs to something else (Geman-McClure).
    pub(crate) outlier: f32,
}

impl ClothSide {
    /// Weight and robust cost of a signed distance (positive: outside the body), with the depth's own sigma.
    pub(crate) fn weight_and_cost(self, distance_m: f32, sigma_m: f32) -> (f32, f32) {
        let scale_m = if distance_m < 0.0 {
            self.inside
        } else {
            self.outside
        };
        let plain = 1.0 / (scale_m * scale_m + sigma_m * sigma_m);
        let share = 1.0 / (1.0 + (distance_m / self.outlier).powi(2));
        (
            plain * share * share,
            plain * share * distance_m * distance_m,
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIDE: ClothSide = ClothSide { outside: 0.02, inside: 0.006, outlier: 0.06 };

    #[test]
    fn three_centimetres_of_cloth_cost_less_than_two_centimetres_of_skin_outside_it() {
        let (_, cloth) = SIDE.weight_and_cost(0.03, 0.002);
        let (_, skin) = SIDE.weight_and_cost(-0.02, 0.002);
        assert!(cloth < 0.5 * skin, "{cloth} against {skin}");
    }

    #[test]
    fn the_weight_is_the_slope_of_the_cost() {
        for distance_m in [-0.05, -0.01, 0.004, 0.03, 0.1_f32] {
            let (weight, _) = SIDE.weight_and_cost(distance_m, 0.003);
            let step_m = 1e-4;
            let (_, above) = SIDE.weight_and_cost(distance_m + step_m, 0.003);
            let (_, below) = SIDE.weight_and_cost(distance_m - step_m, 0.003);
            let slope = (above - below) / (2.0 * step_m);
            let claimed = 2.0 * weight * distance_m;
            assert!(
                (slope - claimed).abs() < 0.02 * claimed.abs().max(1.0),
                "{slope} {claimed}"
            );
        }
    }
}
