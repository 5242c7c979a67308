//! The equidistant fisheye of Kannala and Brandt, as OpenCV's `fisheye` has it.

use glam::{Vec2, Vec3};

use super::newton;

/// Where a point in camera space falls on the distorted normalised plane.
pub(super) fn project(k: [f32; 4], point: Vec3) -> Vec2 {
    let across = point.truncate();
    let radius = across.length();
    // Near the axis atan(r / z) / r tends to 1 / z.
    if radius < 1e-9 * point.z.abs() {
        return across / point.z;
    }
    across * (bend(k, radius.atan2(point.z)).0 / radius)
}

/// The point on the normalised plane whose ray falls on `distorted`; NaN if it is not in front.
pub(super) fn undistort(k: [f32; 4], distorted: Vec2) -> Vec2 {
    let bent = distorted.length();
    if bent < 1e-9 {
        return distorted;
    }
    let angle = newton::invert_increasing(|angle| bend(k, angle), bent);
    if angle >= std::f32::consts::FRAC_PI_2 {
        return Vec2::NAN;
    }
    distorted * (angle.tan() / bent)
}

/// `theta (1 + k1 theta^2 + ... + k4 theta^8)` and its derivative.
fn bend([k1, k2, k3, k4]: [f32; 4], theta: f32) -> (f32, f32) {
    let t = theta * theta;
    let value = theta * (1.0 + t * (k1 + t * (k2 + t * (k3 + t * k4))));
    let slope = 1.0 + t * (3.0 * k1 + t * (5.0 * k2 + t * (7.0 * k3 + t * 9.0 * k4)));
    (value, slope)
}
