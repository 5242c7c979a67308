//! The rational radial and tangential lens of Brown and Conrady, in OpenCV's order of coefficients.

use glam::{Vec2, vec2};

use super::newton;

/// Where the lens sends a point on the normalised image plane (x / z, y / z).
pub(super) fn distort(k: &[f32; 8], p: Vec2) -> Vec2 {
    Lens::new(k).at(p).0
}

/// The point on the normalised image plane that the lens sends to `distorted`; NaN if there is none.
pub(super) fn undistort(k: &[f32; 8], distorted: Vec2) -> Vec2 {
    let lens = Lens::new(k);
    newton::invert_2d(|p| lens.at(p), distorted)
}

/// The coefficients under their names; `k4..k6` are the denominator of the rational model.
struct Lens {
    numerator: [f32; 3],
    denominator: [f32; 3],
    p1: f32,
    p2: f32,
}

impl Lens {
    fn new(&[k1, k2, p1, p2, k3, k4, k5, k6]: &[f32; 8]) -> Self {
        Self { numerator: [k1, k2, k3], denominator: [k4, k5, k6], p1, p2 }
    }

    /// The distorted point and the symmetric Jacobian `[dx/dx, dx/dy = dy/dx, dy/dy]`.
    fn at(&self, p: Vec2) -> (Vec2, [f32; 3]) {
        let r2 = p.length_squared();
        let (n, dn) = one_plus_polynomial(self.numerator, r2);
        let (d, dd) = one_plus_polynomial(self.denominator, r2);
        let radial = n / d;
        let radial_by_r2 = (dn - radial * dd) / d;
        let (x, y) = (p.x, p.y);
        let (p1, p2) = (self.p1, self.p2);
        let distorted = vec2(
            x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
            y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y,
        );
        let jacobian = [
            radial + 2.0 * x * x * radial_by_r2 + 2.0 * p1 * y + 6.0 * p2 * x,
            2.0 * x * y * radial_by_r2 + 2.0 * p1 * x + 2.0 * p2 * y,
            radial + 2.0 * y * y * radial_by_r2 + 6.0 * p1 * y + 2.0 * p2 * x,
        ];
        (distorted, jacobian)
    }
}

/// `1 + a t + b t^2 + c t^3` and its derivative by `t`.
fn one_plus_polynomial([a, b, c]: [f32; 3], t: f32) -> (f32, f32) {
    (
        1.0 + t * (a + t * (b + t * c)),
        a + t * (2.0 * b + 3.0 * t * c),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn jacobian_agrees_with_finite_differences() {
        let k = [0.2, -0.1, 1e-3, -2e-3, 0.02, 0.1, 0.05, -0.01];
        let p = vec2(0.4, -0.3);
        let h = 1e-2;
        let lens = Lens::new(&k);
        let (_, jacobian) = lens.at(p);
        let by_x = (distort(&k, p + vec2(h, 0.0)) - distort(&k, p - vec2(h, 0.0))) / (2.0 * h);
        let by_y = (distort(&k, p + vec2(0.0, h)) - distort(&k, p - vec2(0.0, h))) / (2.0 * h);
        // Central differences with h = 0.01 err by h^2 times the third derivative, below 1e-4 here.
        for (got, expected) in [
            (jacobian[0], by_x.x),
            (jacobian[1], by_x.y),
            (jacobian[1], by_y.x),
            (jacobian[2], by_y.y),
        ] {
            approx::assert_abs_diff_eq!(got, expected, epsilon = 2e-4);
        }
    }
}
