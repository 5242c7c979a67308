//! Two imagers and a matcher: errors live in disparity, and are shared by whoever shares a matching window.

use effigy_capture::SensorModel;

use super::{
    Shot,
    correlated::{correlated_noise, normal_threshold},
};
use crate::render::View;

/// How a stereo camera errs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stereo {
    pub focal_px: f32,
    pub baseline_m: f32,
    /// Root mean square of the disparity error on a frontal textured surface, sub-pixel steps included.
    pub subpixel_rms_px: f32,
    pub steps_per_px: f32,
    /// Width of the matching window: errors are alike over this distance.
    pub window_px: usize,
    /// Below this reflectance the matcher finds nothing to match, ever more often.
    pub dark_reflectance: f32,
    /// Cosine of incidence below which matches fail.
    pub least_cosine: f32,
    /// Share of windows that fail for want of texture; a projector that paints dots leaves few.
    pub hole_share: f32,
}

/// Images that live from frame to frame.
#[derive(Clone, Debug, Default)]
pub struct Buffers {
    disparity: Vec<f32>,
    fattened: Vec<f32>,
    noise: Vec<f32>,
    texture: Vec<f32>,
    scratch: Vec<f32>,
}

/// A step in disparity that makes two surfaces of it.
const EDGE_STEP_PX: f32 = 1.0;
/// How much an edge wobbles: deviation as a share of its growth.
const WOBBLE: f32 = 0.3;

impl Stereo {
    /// A camera after a stereo model; other models give one that sees nothing amiss.
    pub fn of(model: SensorModel) -> Self {
        let (baseline_m, focal_px, subpixel_rms_px) = match model {
            SensorModel::Stereo { baseline_m, focal_px, subpixel_rms_px } => {
                (baseline_m, focal_px, subpixel_rms_px)
            }
            SensorModel::StructuredLight | SensorModel::TimeOfFlight { .. } => (0.05, 424.0, 0.0),
        };
        Self {
            focal_px,
            baseline_m,
            subpixel_rms_px,
            steps_per_px: 32.0,
            window_px: 7,
            dark_reflectance: 0.16,
            least_cosine: 0.20,
            hole_share: 0.004,
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
        let focal_baseline = self.focal_px * self.baseline_m;
        buffers.disparity.clear();
        buffers.disparity.extend(
            view.depth_m
                .iter()
                .map(|&z| if z > 0.0 { focal_baseline / z } else { 0.0 }),
        );
        let radius = (self.window_px / 3).max(1);
        correlated_noise(
            shot,
            0x57e,
            radius,
            size,
            &mut buffers.noise,
            &mut buffers.scratch,
        );
        correlated_noise(
            shot,
            0x57f,
            radius,
            size,
            &mut buffers.texture,
            &mut buffers.scratch,
        );
        self.fatten(view, buffers);
        // Rounding to sub-pixel steps adds a twelfth of a squared step of its own.
        let rounding = 1.0 / (self.steps_per_px * self.steps_per_px * 12.0);
        let noise_px = (self.subpixel_rms_px * self.subpixel_rms_px - rounding)
            .max(0.0)
            .sqrt();
        // `texture` is normal: most windows have enough of it.
        let least_texture = -normal_threshold(self.hole_share);
        for y in 0..view.height {
            let row = y * view.width..(y + 1) * view.width;
            let mut nearest_match = f32::MAX;
            for x in (0..view.width).rev() {
                let pixel = row.start + x;
                let ideal = buffers.fattened[pixel];
                if ideal <= 0.0 {
                    continue;
                }
                // The second imager sees this point at x - d; somebody nearer may stand in the way.
                let matched = x as f32 - ideal;
                let hidden = matched > nearest_match;
                nearest_match = nearest_match.min(matched);
                if hidden || buffers.texture[pixel] < least_texture + self.weakness(view, pixel) {
                    continue;
                }
                let noisy =
                    ideal + Self::grazing_gain(view, pixel) * noise_px * buffers.noise[pixel];
                let stepped = (noisy * self.steps_per_px).round() / self.steps_per_px;
                metres[pixel] = if stepped > 0.0 {
                    focal_baseline / stepped
                } else {
                    0.0
                };
            }
        }
    }

    /// As in [`SensorModel::sigma_m`]: the model and the simulation agree on slanted surfaces too.
    fn grazing_gain(view: &View, pixel: usize) -> f32 {
        // Up to 60 degrees the model has no angle term.
        if view.cosine[pixel] > 0.5 {
            return 1.0;
        }
        let model = SensorModel::Stereo { baseline_m: 1.0, focal_px: 1.0, subpixel_rms_px: 1.0 };
        model.sigma_m(1.0, view.incidence_rad[pixel])
    }

    /// How fast disparity changes along rows or columns, over the plane of the surface itself.
    fn slope(&self, view: &View, pixel: usize) -> f32 {
        let normal = view.normals[pixel];
        // One over depth is `normal . ray / offset`.
        let offset_m = (normal.dot(view.ray(pixel)) * view.depth_m[pixel]).abs();
        self.baseline_m * normal.x.abs().max(normal.y.abs()) / offset_m.max(1e-3)
    }

    /// How much more texture a dark or slanted surface needs to be matched.
    fn weakness(&self, view: &View, pixel: usize) -> f32 {
        let darkness = (1.0 - view.reflectance[pixel] / self.dark_reflectance).max(0.0);
        let slant = (1.0 - view.cosine[pixel] / self.least_cosine).max(0.0);
        5.0 * (darkness + slant)
    }

    /// A window that straddles an edge takes the nearer surface's disparity: objects grow at their edges, by half
    /// a window on average, and the edge wobbles with the texture around it.
    fn fatten(&self, view: &View, buffers: &mut Buffers) {
        let [width, height] = [view.width, view.height];
        let mean_px = self.window_px as f32 * 0.5;
        buffers.fattened.clone_from(&buffers.disparity);
        for y in 0..height {
            for x in 0..width {
                let pixel = y * width + x;
                let grown_px = mean_px + WOBBLE * mean_px * buffers.texture[pixel];
                let grown = (grown_px.round().max(0.0) as usize).min(self.window_px);
                let nearest = nearest_around([x, y], grown, [width, height], buffers);
                let step_px = nearest - buffers.disparity[pixel] - EDGE_STEP_PX;
                // What rises as its own plane does is a slope, and no edge.
                if step_px > 0.0 && step_px > grown as f32 * self.slope(view, pixel) {
                    buffers.fattened[pixel] = nearest;
                }
            }
        }
    }
}

/// The largest disparity at a distance along rows and columns, and half of it: a thin thing is not stepped over.
fn nearest_around(
    [x, y]: [usize; 2],
    grown: usize,
    [width, height]: [usize; 2],
    buffers: &Buffers,
) -> f32 {
    let mut nearest = 0.0f32;
    for reach in [grown, grown / 2] {
        let (low, high) = (x.saturating_sub(reach), (x + reach).min(width - 1));
        let (up, down) = (y.saturating_sub(reach), (y + reach).min(height - 1));
        for at in [
            y * width + low,
            y * width + high,
            up * width + x,
            down * width + x,
        ] {
            nearest = nearest.max(buffers.disparity[at]);
        }
    }
    nearest
}
