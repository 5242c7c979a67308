//! A pinhole with a lens in front of it.

use glam::{Vec2, Vec3, vec2};
use serde::{Deserialize, Serialize};

use super::{Intrinsics, brown_conrady, kannala_brandt};

/// Lens distortion, with the coefficients in OpenCV's order.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub enum Distortion {
    #[default]
    None,
    /// `k1, k2, p1, p2, k3, k4, k5, k6`: the rational model; `k4..k6` are 0 for plumb-bob.
    BrownConrady([f32; 8]),
    /// `k1..k4` of the equidistant fisheye model.
    KannalaBrandt([f32; 4]),
}

#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct CameraModel {
    pub intrinsics: Intrinsics,
    pub distortion: Distortion,
}

impl CameraModel {
    /// The pixel on which a point in camera space falls. The caller keeps z positive.
    #[inline]
    pub fn project(&self, point: Vec3) -> Vec2 {
        let on_plane = match &self.distortion {
            Distortion::None => point.truncate() / point.z,
            Distortion::BrownConrady(k) => brown_conrady::distort(k, point.truncate() / point.z),
            Distortion::KannalaBrandt(k) => kannala_brandt::project(*k, point),
        };
        let Intrinsics { fx, fy, cx, cy, .. } = self.intrinsics;
        vec2(fx * on_plane.x + cx, fy * on_plane.y + cy)
    }

    /// The point on a pixel's ray at a depth (along z). NaN where the lens has no ray for the pixel.
    #[inline]
    pub fn unproject(&self, pixel: Vec2, depth_m: f32) -> Vec3 {
        (self.ray(pixel) * depth_m).extend(depth_m)
    }

    /// Where a pixel's ray meets the plane z = 1. NaN where the lens has no ray for the pixel.
    #[inline]
    pub fn ray(&self, pixel: Vec2) -> Vec2 {
        let Intrinsics { fx, fy, cx, cy, .. } = self.intrinsics;
        let on_plane = vec2((pixel.x - cx) / fx, (pixel.y - cy) / fy);
        match &self.distortion {
            Distortion::None => on_plane,
            Distortion::BrownConrady(k) => brown_conrady::undistort(k, on_plane),
            Distortion::KannalaBrandt(k) => kannala_brandt::undistort(*k, on_plane),
        }
    }

    /// [`Self::ray`] of every pixel, row by row: undistortion is iterative, so compute it once.
    pub fn rays(&self) -> Vec<Vec2> {
        let Intrinsics { width, height, .. } = self.intrinsics;
        (0..height)
            .flat_map(|y| (0..width).map(move |x| self.ray(vec2(x as f32, y as f32))))
            .collect()
    }
}

impl From<Intrinsics> for CameraModel {
    fn from(intrinsics: Intrinsics) -> Self {
        Self { intrinsics, distortion: Distortion::None }
    }
}

#[cfg(test)]
mod tests {
    use glam::vec3;

    use super::*;

    const AZURE: [f32; 8] = [4.21, 2.53, -6.1e-5, -2.2e-5, 0.129, 4.55, 3.83, 0.658];
    const PLUMB_BOB: [f32; 8] = [-0.28, 0.075, 0.0012, -0.0009, 0.011, 0.0, 0.0, 0.0];
    const FISHEYE: [f32; 4] = [-0.021, 0.0071, -0.0042, 0.0006];

    fn camera(distortion: Distortion) -> CameraModel {
        let intrinsics =
            Intrinsics { width: 640, height: 576, fx: 504.12, fy: 504.05, cx: 321.7, cy: 333.4 };
        CameraModel { intrinsics, distortion }
    }

    fn points() -> [Vec3; 4] {
        [
            vec3(0.3, -0.2, 1.1),
            vec3(-0.8, 0.7, 1.5),
            vec3(0.05, 0.9, 2.0),
            vec3(-1.0, -0.9, 1.3),
        ]
    }

    /// OpenCV 4's own answers (`projectPoints`), printed to a thousandth of a pixel.
    fn assert_projects(camera: &CameraModel, points: &[Vec3], pixels: [[f32; 2]; 4]) {
        for (point, pixel) in points.iter().zip(pixels) {
            let error_px = camera.project(*point).distance(Vec2::from(pixel));
            assert!(
                error_px < 1.5e-3,
                "{point} falls {error_px} px from OpenCV's {pixel:?}"
            );
        }
    }

    #[test]
    fn rational_lens_projects_like_opencv() {
        assert_projects(
            &camera(Distortion::BrownConrady(AZURE)),
            &points(),
            [
                [454.509, 244.869],
                [87.927, 537.903],
                [333.533, 546.391],
                [21.578, 63.306],
            ],
        );
    }

    #[test]
    fn plumb_bob_lens_projects_like_opencv() {
        assert_projects(
            &camera(Distortion::BrownConrady(PLUMB_BOB)),
            &points().map(|p| p * vec3(0.6, 0.6, 1.0)),
            [
                [403.245, 279.056],
                [167.859, 468.030],
                [329.082, 466.891],
                [111.271, 144.431],
            ],
        );
    }

    #[test]
    fn fisheye_lens_projects_like_opencv() {
        assert_projects(
            &camera(Distortion::KannalaBrandt(FISHEYE)),
            &points(),
            [
                [454.287, 245.021],
                [89.475, 536.568],
                [333.498, 545.743],
                [24.467, 65.928],
            ],
        );
    }

    #[test]
    fn unprojecting_then_projecting_returns_every_pixel() {
        for distortion in [
            Distortion::None,
            Distortion::BrownConrady(AZURE),
            Distortion::BrownConrady(PLUMB_BOB),
            Distortion::KannalaBrandt(FISHEYE),
        ] {
            let camera = camera(distortion);
            for y in (0..576).step_by(5).chain([575]) {
                for x in (0..640).step_by(5).chain([639]) {
                    let pixel = vec2(x as f32, y as f32);
                    let error_px = camera.project(camera.unproject(pixel, 1.7)).distance(pixel);
                    assert!(
                        error_px < 0.01,
                        "{distortion:?}: {pixel} comes back {error_px} px off"
                    );
                }
            }
        }
    }

    #[test]
    fn a_pixel_outside_the_lens_has_no_ray() {
        // This lens folds over at a radius of about 1.05: nothing reaches beyond 0.72 on the plane.
        let folding = camera(Distortion::BrownConrady([
            -0.3, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0,
        ]));
        let ray = folding.ray(vec2(2000.0, 333.0));
        assert!(
            ray.is_nan(),
            "{ray} projects to {}",
            folding.project(ray.extend(1.0))
        );
        assert!(folding.unproject(vec2(2000.0, 333.0), 1.0).is_nan());
    }

    #[test]
    fn ray_table_is_row_major() {
        let camera = camera(Distortion::KannalaBrandt(FISHEYE));
        assert_eq!(camera.rays()[3 * 640 + 17], camera.ray(vec2(17.0, 3.0)));
    }
}
