//! Axis-angle to rotation matrix.

use glam::{Mat3, Vec3};

/// Rodrigues' formula, with its series near zero: `R = I + a [w]x + b [w]x^2`,
/// `a = sin t / t`, `b = (1 - cos t) / t^2`, `t = |w|`.
pub fn rotation_from_axis_angle(axis_angle: Vec3) -> Mat3 {
    let squared = axis_angle.length_squared();
    let (a, b) = if squared < 1e-6 {
        (1.0 - squared / 6.0, 0.5 - squared / 24.0)
    } else {
        let angle = squared.sqrt();
        (angle.sin() / angle, (1.0 - angle.cos()) / squared)
    };
    let cross = Mat3::from_cols(
        glam::vec3(0.0, axis_angle.z, -axis_angle.y),
        glam::vec3(-axis_angle.z, 0.0, axis_angle.x),
        glam::vec3(axis_angle.y, -axis_angle.x, 0.0),
    );
    Mat3::IDENTITY + cross * a + (cross * cross) * b
}
