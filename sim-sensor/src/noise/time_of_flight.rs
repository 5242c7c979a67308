//! Phase cameras: little noise, but mixed pixels at edges and no answer from dark or slanted surfaces.

use effigy_capture::SensorModel;

use glam::vec2;

use super::{Shot, multi_path::Detours};
use crate::{random::Randomness, render::View};

/// How a time-of-flight camera errs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TimeOfFlight {
    pub model: SensorModel,
    /// Where the exposure's pixel really looks, relative to its centre.
    pub shift_px: f32,
    /// A step in a 3x3 neighbourhood beyond which the sensor itself gives up.
    pub hole_step_m: f32,
    /// A step from which two surfaces mix in one pixel.
    pub mixing_step_m: f32,
    /// The share of mixed pixels that the sensor notices and leaves out.
    pub mixed_noticed_share: f32,
    /// Reflectance times cosine over squared depth below which there is no answer.
    pub least_signal: f32,
    /// Detours of light that make a pixel read farther than this are noticed, and left out.
    pub most_excess_m: f32,
}

/// Images that live from frame to frame.
#[derive(Clone, Debug, Default)]
pub struct Buffers {
    detours: Detours,
    /// The nearest and the farthest depth of the 3x3 pixels around.
    nearest: Vec<f32>,
    farthest: Vec<f32>,
    scratch: Vec<f32>,
    /// What the infrared lamp lights.
    lit: Vec<bool>,
}

/// Random draws for one pixel: one counter each.
const DRAWS: u64 = 4;

impl TimeOfFlight {
    pub fn azure(model: SensorModel) -> Self {
        Self {
            model,
            shift_px: 0.25,
            hole_step_m: 0.8,
            mixing_step_m: 0.04,
            mixed_noticed_share: 0.35,
            least_signal: 0.0045,
            most_excess_m: 0.03,
        }
    }

    pub(super) fn expose(
        &self,
        view: &View,
        shot: Shot,
        buffers: &mut Buffers,
        metres: &mut [f32],
    ) {
        let random = shot.randomness(0x70f);
        buffers.detours.measure(view);
        buffers.find_extremes(view);
        buffers.find_lit(view);
        for y in 0..view.height {
            for x in 0..view.width {
                let pixel = y * view.width + x;
                if view.depth_m[pixel] <= 0.0 || !buffers.lit[pixel] {
                    continue;
                }
                let measured_m = self.measure(view, [x, y], buffers, random);
                if measured_m > 0.0 {
                    let excess_m = buffers.detours.excess_m(view, x, y);
                    if excess_m <= self.most_excess_m {
                        metres[pixel] = measured_m + excess_m;
                    }
                }
            }
        }
    }

    /// One pixel; 0 for no answer.
    fn measure(
        &self,
        view: &View,
        [x, y]: [usize; 2],
        buffers: &Buffers,
        random: Randomness,
    ) -> f32 {
        let pixel = y * view.width + x;
        let at = pixel as u64 * DRAWS;
        let around = Extremes { min_m: buffers.nearest[pixel], max_m: buffers.farthest[pixel] };
        if around.max_m - around.min_m > self.hole_step_m {
            return 0.0;
        }
        let truth_m = view.depth_m[pixel];
        let (ideal_m, slope2) = if around.max_m - around.min_m > self.mixing_step_m {
            (self.mixed(truth_m, around, random, at), 0.0)
        } else {
            (truth_m, squared_slope(view, x, y))
        };
        if ideal_m <= 0.0 {
            return 0.0;
        }
        let signal = view.reflectance[pixel] * view.cosine[pixel];
        let least = self.least_signal * ideal_m * ideal_m;
        let [hopeless, sufficient] = [0.6 * least, 1.4 * least];
        let lost = signal < sufficient
            && (signal < hopeless || signal < random.between(at + 2, hopeless, sufficient));
        if lost {
            return 0.0;
        }
        // Looking a little aside shifts depth along the slope: one more normal error beside the axial one.
        let axial_m = self.model.sigma_m(ideal_m, view.incidence_rad[pixel]);
        let variance = axial_m * axial_m + self.shift_px * self.shift_px * slope2;
        ideal_m + variance.sqrt() * random.gaussian(at + 3)
    }

    /// A pixel beside an edge: the silhouette crosses it about half of the time, and then anywhere.
    fn mixed(&self, truth_m: f32, around: Extremes, random: Randomness, at: u64) -> f32 {
        let covered = random.between(at, -0.5, 0.5);
        if covered <= 0.0 {
            return truth_m;
        }
        if random.uniform(at + 1) < self.mixed_noticed_share {
            return 0.0;
        }
        let nearer = truth_m - around.min_m > around.max_m - truth_m;
        let other_m = if nearer { around.min_m } else { around.max_m };
        truth_m + (other_m - truth_m) * covered
    }
}

/// The depths around a pixel.
#[derive(Clone, Copy)]
struct Extremes {
    min_m: f32,
    max_m: f32,
}

/// Squared metres a squared pixel.
fn squared_slope(view: &View, x: usize, y: usize) -> f32 {
    let at = |x: usize, y: usize| view.depth_m[y * view.width + x];
    let (left, right) = (x.saturating_sub(1), (x + 1).min(view.width - 1));
    let (above, below) = (y.saturating_sub(1), (y + 1).min(view.height - 1));
    0.25 * vec2(at(right, y) - at(left, y), at(x, below) - at(x, above)).length_squared()
}

impl Buffers {
    /// The mask is the same for all frames.
    fn find_lit(&mut self, view: &View) {
        if self.lit.len() != view.depth_m.len() {
            let mask = IrMask::new(view);
            let at = |pixel: usize| mask.lights(pixel % view.width, pixel / view.width);
            self.lit = (0..view.depth_m.len()).map(at).collect();
        }
    }

    fn find_extremes(&mut self, view: &View) {
        let size = [view.width, view.height];
        // Nothing at all is neither near nor far.
        let nothing_is = |value: f32| move |z: &f32| if *z > 0.0 { *z } else { value };
        self.nearest.clear();
        self.nearest
            .extend(view.depth_m.iter().map(nothing_is(f32::MAX)));
        spread(&mut self.nearest, &mut self.scratch, size, f32::min);
        self.farthest.clone_from(&view.depth_m);
        spread(&mut self.farthest, &mut self.scratch, size, f32::max);
    }
}

/// Each pixel's best of the 3x3 around it, along rows and then columns.
fn spread(
    image: &mut [f32],
    scratch: &mut Vec<f32>,
    [width, height]: [usize; 2],
    best: impl Fn(f32, f32) -> f32,
) {
    scratch.resize(image.len(), 0.0);
    for (row, out) in image
        .chunks_exact(width)
        .zip(scratch.chunks_exact_mut(width))
    {
        out.copy_from_slice(row);
        for (to, from) in out[1..].iter_mut().zip(row) {
            *to = best(*to, *from);
        }
        for (to, from) in out.iter_mut().zip(&row[1..]) {
            *to = best(*to, *from);
        }
    }
    image.copy_from_slice(scratch);
    let last = (height - 1) * width;
    for (to, from) in image[width..].iter_mut().zip(&scratch[..last]) {
        *to = best(*to, *from);
    }
    for (to, from) in image[..last].iter_mut().zip(&scratch[width..]) {
        *to = best(*to, *from);
    }
}

/// The infrared lamp lights a hexagon: the image's corners stay dark.
struct IrMask {
    half_width: f32,
    half_height: f32,
}

impl IrMask {
    /// Corners are cut where the sum of both coordinates, each from 0 to 1, passes this.
    const CORNER: f32 = 1.55;

    fn new(view: &View) -> Self {
        Self { half_width: view.width as f32 * 0.5, half_height: view.height as f32 * 0.5 }
    }

    fn lights(&self, x: usize, y: usize) -> bool {
        let u = (x as f32 + 0.5 - self.half_width).abs() / self.half_width;
        let v = (y as f32 + 0.5 - self.half_height).abs() / self.half_height;
        u + v < Self::CORNER
    }
}
