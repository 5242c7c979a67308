//! How far two neighbouring depths may differ and still belong to one surface.

use effigy_capture::{Intrinsics, SensorModel};

/// Depth between two entries.
const SPACING_M: f32 = 0.01;
/// Depths beyond this share the last entry.
const FARTHEST_M: f32 = 20.0;

/// The sensor's noise by depth, as a table: asked for every pixel, so it must be cheap.
#[derive(Clone, Debug)]
pub struct Tolerance {
    sigma_m: Vec<f32>,
    /// Metres between the rays of neighbouring pixels, a metre away.
    pixel_pitch: f32,
}

impl Tolerance {
    pub fn new(sensor: SensorModel, camera: &Intrinsics) -> Self {
        let entries = (FARTHEST_M / SPACING_M) as usize;
        let sigma_at = |entry: usize| sensor.sigma_m(entry as f32 * SPACING_M, 0.0);
        Self {
            sigma_m: (0..=entries).map(sigma_at).collect(),
            pixel_pitch: 2.0 / (camera.fx + camera.fy),
        }
    }

    /// Standard deviation of a depth seen face on. The depth is a number, not NaN.
    #[inline]
    pub fn sigma_m(&self, depth_m: f32) -> f32 {
        self.sigma_m[((depth_m / SPACING_M) as usize).min(self.sigma_m.len() - 1)]
    }

    /// How far apart the rays of neighbouring pixels are at a depth.
    #[inline]
    pub fn pixel_size_m(&self, depth_m: f32) -> f32 {
        self.pixel_pitch * depth_m
    }

    /// The largest difference between depths `pixels` apart on a surface that falls away by `slope` metres
    /// a metre, if each errs by up to `sigmas` standard deviations of a difference.
    #[inline]
    pub fn step_m(&self, depth_m: f32, pixels: f32, slope: f32, sigmas: f32) -> f32 {
        sigmas * std::f32::consts::SQRT_2 * self.sigma_m(depth_m)
            + slope * pixels * self.pixel_pitch * depth_m
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tolerance_grows_with_noise_and_pixel_size() {
        let sensor = SensorModel::TimeOfFlight { floor_m: 0.0005, slope: 0.001 };
        let camera = Intrinsics { width: 1, height: 1, fx: 500.0, fy: 500.0, cx: 0.0, cy: 0.0 };
        let tolerance = Tolerance::new(sensor, &camera);
        assert!((tolerance.sigma_m(1.5) - 0.0015).abs() < 2e-5);
        // One pixel at 2 m is 4 mm wide.
        assert!((tolerance.step_m(2.0, 1.0, 1.0, 0.0) - 0.004).abs() < 1e-6);
        assert_eq!(tolerance.sigma_m(1e9), tolerance.sigma_m(20.0));
    }
}
