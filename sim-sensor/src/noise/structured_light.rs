//! Kinect v1: a projected pattern, disparity in eighths of a pixel, noise after Nguyen, Izadi and Lovell.

use effigy_capture::SensorModel;

use super::Shot;
use crate::render::View;

/// How a structured-light camera errs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StructuredLight {
    pub focal_px: f32,
    pub baseline_m: f32,
    pub steps_per_px: f32,
    /// Where the pixel's window really looks, relative to its centre.
    pub shift_px: f32,
    /// Beyond this incidence the pattern is smeared past recognition.
    pub most_incidence_rad: f32,
    pub least_reflectance: f32,
}

const DRAWS: u64 = 4;

impl StructuredLight {
    pub fn kinect() -> Self {
        Self {
            focal_px: 585.0,
            baseline_m: 0.075,
            steps_per_px: 8.0,
            shift_px: 0.8,
            most_incidence_rad: 1.35,
            least_reflectance: 0.12,
        }
    }

    pub(super) fn expose(&self, view: &View, shot: Shot, metres: &mut [f32]) {
        let random = shot.randomness(0x51);
        let focal_baseline = self.focal_px * self.baseline_m;
        for y in 0..view.height {
            // The projector stands to the right: what a nearer surface hides from it lies to that one's left.
            let mut nearest_match = f32::MAX;
            for x in (0..view.width).rev() {
                let pixel = y * view.width + x;
                let truth_m = view.depth_m[pixel];
                if truth_m <= 0.0 {
                    continue;
                }
                let matched = x as f32 - focal_baseline / truth_m;
                let hidden = matched > nearest_match + 0.5;
                nearest_match = nearest_match.min(matched);
                let incidence = view.incidence_rad[pixel];
                let dark = view.reflectance[pixel] < self.least_reflectance;
                if hidden || dark || incidence > self.most_incidence_rad {
                    continue;
                }
                let at = pixel as u64 * DRAWS;
                let shifted =
                    self.shifted(view, x, y, [random.gaussian(at), random.gaussian(at + 1)]);
                let step_m = shifted * shifted / (focal_baseline * self.steps_per_px);
                let sigma_m = SensorModel::StructuredLight.sigma_m(shifted, incidence);
                // Rounding adds a twelfth of a squared step of its own.
                let white_m = (sigma_m * sigma_m - step_m * step_m / 12.0).max(0.0).sqrt();
                let noisy = shifted + white_m * random.gaussian(at + 2);
                let steps = (focal_baseline / noisy.max(0.1) * self.steps_per_px).round();
                metres[pixel] = focal_baseline * self.steps_per_px / steps.max(1.0);
            }
        }
    }

    /// The depth where the pixel's window really looks.
    fn shifted(&self, view: &View, x: usize, y: usize, draws: [f32; 2]) -> f32 {
        let moved = |at: usize, draw: f32, size: usize| {
            (at as f32 + self.shift_px * draw)
                .round()
                .clamp(0.0, size as f32 - 1.0) as usize
        };
        let there = view.depth_m
            [moved(y, draws[1], view.height) * view.width + moved(x, draws[0], view.width)];
        if there > 0.0 {
            there
        } else {
            view.depth_m[y * view.width + x]
        }
    }
}
