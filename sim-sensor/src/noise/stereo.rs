//! Two imagers and a matcher: errors live in disparity, and are shared by whoever shares a matching window.

use effigy_capture::SensorModel;

use super::Shot;
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
    /// Share of windows that fail for no visible reason.
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
        correlated_noise(
            shot,
            0x57e,
            self.window_px,
            size,
            &mut buffers.noise,
            &mut buffers.scratch,
        );
        correlated_noise(
            shot,
            0x57f,
            self.window_px,
            size,
            &mut buffers.texture,
            &mut buffers.scratch,
        );
        self.fatten(size, buffers);
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
                let hidden = matched > nearest_match + 0.5;
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
        if view.cosine[pixel] > 0.95 {
            return 1.0;
        }
        let model = SensorModel::Stereo { baseline_m: 1.0, focal_px: 1.0, subpixel_rms_px: 1.0 };
        model.sigma_m(1.0, view.incidence_rad[pixel])
    }

    /// How much more texture a dark or slanted surface needs to be matched.
    fn weakness(&self, view: &View, pixel: usize) -> f32 {
        let darkness = (1.0 - view.reflectance[pixel] / self.dark_reflectance).max(0.0);
        let slant = (1.0 - view.cosine[pixel] / self.least_cosine).max(0.0);
        5.0 * (darkness + slant)
    }

    /// A window that straddles an edge takes the nearer surface's disparity: objects grow at their edges.
    fn fatten(&self, [width, height]: [usize; 2], buffers: &mut Buffers) {
        let reach = self.window_px / 2;
        buffers.fattened.clone_from(&buffers.disparity);
        for y in 0..height {
            for x in 0..width {
                let pixel = y * width + x;
                // The edge wobbles with the texture around it, from nothing to half a window.
                let grown = (reach as f32 * (0.5 + 0.35 * buffers.texture[pixel])).round();
                let grown = (grown.max(0.0) as usize).min(reach);
                if grown == 0 {
                    continue;
                }
                let (low, high) = (x.saturating_sub(grown), (x + grown).min(width - 1));
                let (up, down) = (y.saturating_sub(grown), (y + grown).min(height - 1));
                let nearest = [
                    y * width + low,
                    y * width + high,
                    up * width + x,
                    down * width + x,
                ]
                .iter()
                .map(|&p| buffers.disparity[p])
                .fold(buffers.disparity[pixel], f32::max);
                if nearest > buffers.disparity[pixel] + EDGE_STEP_PX {
                    buffers.fattened[pixel] = nearest;
                }
            }
        }
    }
}

/// Normal noise of deviation 1, alike over a window: white noise under two boxes, so that likeness fades
/// instead of breaking off. Sums of 25 x 25 and more even numbers are as good as normal.
fn correlated_noise(
    shot: Shot,
    purpose: u64,
    window_px: usize,
    [width, height]: [usize; 2],
    noise: &mut Vec<f32>,
    scratch: &mut Vec<f32>,
) {
    let random = shot.randomness(purpose);
    let radius = (window_px / 3).max(1);
    let n = (2 * radius + 1) as f32;
    // What two boxes leave of white noise's variance, along each axis.
    let kept: f32 = (1..2 * n as i32)
        .map(|k| (n - (k as f32 - n).abs()) / (n * n))
        .map(|weight| weight * weight)
        .sum();
    let gain = 12f32.sqrt() / kept;
    noise.clear();
    noise.extend((0..width * height).map(|pixel| (random.uniform(pixel as u64) - 0.5) * gain));
    for _ in 0..2 {
        box_rows(noise, scratch, [width, height], radius);
        box_columns(scratch, noise, [width, height], radius);
    }
}

/// A moving mean along rows. The border wraps around, which keeps the variance there.
fn box_rows(from: &[f32], to: &mut Vec<f32>, [width, height]: [usize; 2], radius: usize) {
    to.resize(width * height, 0.0);
    let share = 1.0 / (2 * radius + 1) as f32;
    let mut padded = vec![0.0; width + 2 * radius];
    for y in 0..height {
        let row = &from[y * width..(y + 1) * width];
        padded[..radius].copy_from_slice(&row[width - radius..]);
        padded[radius..width + radius].copy_from_slice(row);
        padded[width + radius..].copy_from_slice(&row[..radius]);
        add_shifted(
            &mut to[y * width..(y + 1) * width],
            share,
            (0..=2 * radius).map(|k| &padded[k..]),
        );
    }
}

/// A moving mean along columns, wrapping likewise.
fn box_columns(from: &[f32], to: &mut Vec<f32>, [width, height]: [usize; 2], radius: usize) {
    to.resize(width * height, 0.0);
    let share = 1.0 / (2 * radius + 1) as f32;
    for y in 0..height {
        let rows = (0..=2 * radius).map(|k| &from[(y + k + height - radius) % height * width..]);
        add_shifted(&mut to[y * width..(y + 1) * width], share, rows);
    }
}

fn add_shifted<'a>(out: &mut [f32], share: f32, terms: impl Iterator<Item = &'a [f32]>) {
    out.fill(0.0);
    for term in terms {
        for (sum, value) in out.iter_mut().zip(term) {
            *sum += value * share;
        }
    }
}

/// The value below minus which a standard normal falls with this probability; enough for shares of 1e-4 to 0.1.
fn normal_threshold(share: f32) -> f32 {
    let t = (-2.0 * share.clamp(1e-6, 0.4).ln()).sqrt();
    t - (2.30753 + 0.27061 * t) / (1.0 + 0.99229 * t + 0.04481 * t * t)
}
