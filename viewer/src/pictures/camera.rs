//! Where a picture of a mesh is taken from.

use effigy_capture::{Intrinsics, Rigid3};
use glam::{Mat3, Quat, Vec3, vec3};

use super::Framing;

/// A portrait lens: little perspective.
const FIELD_OF_VIEW_RAD: f32 = 0.5;
/// Air around what is framed, as a share.
const AIR: f32 = 0.08;
/// Nothing is looked at from closer than this.
const MIN_DISTANCE_M: f32 = 0.05;

/// A pinhole standing in the world.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PictureCamera {
    pub intrinsics: Intrinsics,
    pub camera_from_world: Rigid3,
}

impl PictureCamera {
    /// The depth camera itself, showing what a framing shows.
    pub fn of_sensor(sensor: &Intrinsics, world_from_camera: Rigid3, framing: &Framing) -> Self {
        Self {
            intrinsics: framing.intrinsics(sensor),
            camera_from_world: world_from_camera.inverse(),
        }
    }

    /// Frames all points upright, seen from an azimuth about the world's y axis: 0 looks at the front of
    /// somebody who faces +z, a quarter turn at his left side.
    pub fn around(points: &[Vec3], azimuth_rad: f32, elevation_rad: f32, size: [u32; 2]) -> Self {
        let (low, high) = bounds(points);
        let target = 0.5 * (low + high);
        let tan_y = (0.5 * FIELD_OF_VIEW_RAD).tan();
        let tan_x = tan_y * size[0] as f32 / size[1] as f32;
        let mut camera = Self::orbit(target, 1.0, [azimuth_rad, elevation_rad], size);
        // Each point must project inside: |x| <= tan_x (z + d).
        let turned = camera.camera_from_world.rotation;
        let needed = points.iter().map(|point| {
            let p = turned * (*point - target);
            (p.x.abs() / tan_x).max(p.y.abs() / tan_y) * (1.0 + AIR) - p.z
        });
        let distance_m = needed.fold(MIN_DISTANCE_M, f32::max);
        camera.camera_from_world.translation = turned * -target + vec3(0.0, 0.0, distance_m);
        camera
    }

    /// Looks at a target from a distance; `[azimuth, elevation]` as in [`Self::around`].
    pub fn orbit(target: Vec3, distance_m: f32, angles_rad: [f32; 2], size: [u32; 2]) -> Self {
        let [azimuth, elevation] = angles_rad;
        let (sin_a, cos_a) = azimuth.sin_cos();
        let (sin_e, cos_e) = elevation.sin_cos();
        let forward = -vec3(sin_a * cos_e, sin_e, cos_a * cos_e);
        let right = vec3(cos_a, 0.0, -sin_a);
        let world_from_camera = Mat3::from_cols(right, forward.cross(right), forward);
        let rotation = Quat::from_mat3(&world_from_camera).inverse();
        let translation = rotation * -target + vec3(0.0, 0.0, distance_m);
        let focal = 0.5 * size[1] as f32 / (0.5 * FIELD_OF_VIEW_RAD).tan();
        let intrinsics = Intrinsics {
            width: size[0],
            height: size[1],
            fx: focal,
            fy: focal,
            cx: 0.5 * size[0] as f32 - 0.5,
            cy: 0.5 * size[1] as f32 - 0.5,
        };
        Self { intrinsics, camera_from_world: Rigid3 { rotation, translation } }
    }

    /// The same view with `factor` times as many pixels a side.
    pub(super) fn enlarged(&self, factor: u32) -> Self {
        let f = factor as f32;
        let i = self.intrinsics;
        let intrinsics = Intrinsics {
            width: i.width * factor,
            height: i.height * factor,
            fx: i.fx * f,
            fy: i.fy * f,
            cx: (i.cx + 0.5) * f - 0.5,
            cy: (i.cy + 0.5) * f - 0.5,
        };
        Self { intrinsics, ..*self }
    }
}

fn bounds(points: &[Vec3]) -> (Vec3, Vec3) {
    let finite = points.iter().filter(|p| p.is_finite());
    finite
        .fold(None, |bounds: Option<(Vec3, Vec3)>, &p| {
            Some(bounds.map_or((p, p), |(low, high)| (low.min(p), high.max(p))))
        })
        .unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use std::f32::consts::FRAC_PI_2;

    use super::*;

    #[test]
    fn the_front_camera_sees_the_persons_left_on_the_right_and_up_above() {
        let camera = PictureCamera::orbit(Vec3::ZERO, 3.0, [0.0, 0.0], [100, 100]);
        let seen = |p: Vec3| camera.intrinsics.project(camera.camera_from_world * p);
        assert!(seen(Vec3::X).x > seen(Vec3::ZERO).x);
        assert!(seen(Vec3::Y).y < seen(Vec3::ZERO).y);
        let depth = (camera.camera_from_world * Vec3::Z).z;
        // 3 m away, the front is 1 m nearer.
        assert!((depth - 2.0).abs() < 1e-5);
    }

    #[test]
    fn a_quarter_turn_looks_at_the_left_side() {
        let camera = PictureCamera::orbit(Vec3::ZERO, 3.0, [FRAC_PI_2, 0.0], [100, 100]);
        assert!(((camera.camera_from_world * Vec3::X).z - 2.0).abs() < 1e-5);
    }

    #[test]
    fn everything_asked_for_is_framed_from_every_side() {
        let points: Vec<Vec3> = (0..8)
            .map(|i| {
                vec3(
                    (i & 1) as f32,
                    (i >> 1 & 1) as f32 * 1.8,
                    (i >> 2) as f32 * 0.4,
                )
            })
            .collect();
        for turn in 0..12 {
            let azimuth = turn as f32 * 0.5;
            let camera = PictureCamera::around(&points, azimuth, 0.2, [200, 300]);
            let pixels = points
                .iter()
                .map(|p| camera.intrinsics.project(camera.camera_from_world * *p));
            let mut widest: f32 = 0.0;
            for p in pixels {
                assert!(
                    p.x > 0.0 && p.x < 199.0 && p.y > 0.0 && p.y < 299.0,
                    "{turn}: {p}"
                );
                widest = widest
                    .max((p.y - 149.5).abs() / 150.0)
                    .max((p.x - 99.5).abs() / 100.0);
            }
            // The air is 8 %: the largest point fills at least four fifths.
            assert!(widest > 0.8, "{turn}: {widest}");
        }
    }
}
