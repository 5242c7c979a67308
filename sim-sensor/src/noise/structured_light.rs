//! Kinect v1: a projected pattern, disparity in eighths of a pixel, noise after Nguyen, Izadi and Lovell.

use effigy_capture::SensorModel;

use super::{Shot, correlated::correlated_noise};
use crate::render::View;

/// How a structured-light camera errs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StructuredLight {
    pub focal_px: f32,
    pub baseline_m: f32,
    pub steps_per_px: f32,
    /// Where an edge is seen, relative to where it is; on frontal surfaces.
    pub lateral_px: f32,
    /// How much worse that gets with `theta / (pi/2 - theta)`.
    pub lateral_slant_px: f32,
    /// Pixels to either side that share a matching window's error.
    pub window_radius_px: usize,
    /// Beyond this incidence the pattern is smeared past recognition.
    pub most_incidence_rad: f32,
    pub least_reflectance: f32,
}

/// Images that live from frame to frame.
#[derive(Clone, Debug, Default)]
pub struct Buffers {
    axial: Vec<f32>,
    aside: [Vec<f32>; 2],
    scratch: Vec<f32>,
}

/// A step in depth that belongs to an edge: on one surface it is the axial noise that speaks.
const EDGE_STEP_M: f32 = 0.04;

impl StructuredLight {
    pub fn kinect() -> Self {
        Self {
            focal_px: 585.0,
            baseline_m: 0.075,
            steps_per_px: 8.0,
            lateral_px: 0.8,
            lateral_slant_px: 0.035,
            window_radius_px: 1,
            most_incidence_rad: 1.35,
            least_reflectance: 0.12,
        }
    }

    pub(super) fn expose(
        &self,
        view: &View,
        shot: Shot,
        buffers: &mut Buffers,
        metres: &mut [f32],
    ) {
        let size = [view.width, view.height];
        let (radius, scratch) = (self.window_radius_px, &mut buffers.scratch);
        correlated_noise(shot, 0x51, radius, size, &mut buffers.axial, scratch);
        for (aside, purpose) in buffers.aside.iter_mut().zip([0x52, 0x53]) {
            correlated_noise(shot, purpose, radius, size, aside, scratch);
        }
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
                let hidden = matched > nearest_match;
                nearest_match = nearest_match.min(matched);
                let incidence = view.incidence_rad[pixel];
                let dark = view.reflectance[pixel] < self.least_reflectance;
                if hidden || dark || incidence > self.most_incidence_rad {
                    continue;
                }
                let aside = [0, 1].map(|axis: usize| buffers.aside[axis][pixel]);
                let seen_m = self.seen_m(view, [x, y], aside);
                metres[pixel] = self.measured_m(seen_m, incidence, buffers.axial[pixel]);
            }
        }
    }

    /// A depth with its noise, in whole steps of disparity.
    fn measured_m(&self, seen_m: f32, incidence_rad: f32, noise: f32) -> f32 {
        let steps_at_1m = self.focal_px * self.baseline_m * self.steps_per_px;
        let step_m = seen_m * seen_m / steps_at_1m;
        let sigma_m = SensorModel::StructuredLight.sigma_m(seen_m, incidence_rad);
        // Rounding adds a twelfth of a squared step of its own.
        let own_m = (sigma_m * sigma_m - step_m * step_m / 12.0).max(0.0).sqrt();
        let noisy_m = seen_m + own_m * noise;
        steps_at_1m / (steps_at_1m / noisy_m.max(0.1)).round().max(1.0)
    }

    /// The depth a pixel's window finds: near an edge that of the other side, now and then.
    fn seen_m(&self, view: &View, [x, y]: [usize; 2], aside: [f32; 2]) -> f32 {
        let pixel = y * view.width + x;
        let theta = view.incidence_rad[pixel].min(1.4);
        let lateral_px =
            self.lateral_px + self.lateral_slant_px * theta / (std::f32::consts::FRAC_PI_2 - theta);
        let moved = |at: usize, share: f32, size: usize| {
            (at as f32 + lateral_px * share)
                .round()
                .clamp(0.0, size as f32 - 1.0) as usize
        };
        let there = moved(y, aside[1], view.height) * view.width + moved(x, aside[0], view.width);
        let (here_m, there_m) = (view.depth_m[pixel], view.depth_m[there]);
        let edge = there_m > 0.0 && (there_m - here_m).abs() > EDGE_STEP_M;
        if edge { there_m } else { here_m }
    }
}
