//! Phase cameras: little noise, but mixed pixels at edges and no answer from dark or slanted surfaces.

use effigy_capture::SensorModel;

use super::Shot;
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
        }
    }

    pub(super) fn expose(&self, view: &View, shot: Shot, metres: &mut [f32]) {
        let random = shot.randomness(0x70f);
        let mask = IrMask::new(view);
        for y in 0..view.height {
            for x in 0..view.width {
                let pixel = y * view.width + x;
                if view.depth_m[pixel] > 0.0 && mask.lights(x, y) {
                    metres[pixel] = self.measure(view, x, y, random);
                }
            }
        }
    }

    /// One pixel; 0 for no answer.
    fn measure(&self, view: &View, x: usize, y: usize, random: Randomness) -> f32 {
        let pixel = y * view.width + x;
        let at = pixel as u64 * DRAWS;
        let around = Neighbourhood::of(view, x, y);
        if around.max_m - around.min_m > self.hole_step_m {
            return 0.0;
        }
        let truth_m = view.depth_m[pixel];
        let (ideal_m, slope) = if around.max_m - around.min_m > self.mixing_step_m {
            (self.mixed(truth_m, around, random, at), 0.0)
        } else {
            (truth_m, around.slope_m_per_px())
        };
        if ideal_m <= 0.0 {
            return 0.0;
        }
        let signal = view.reflectance[pixel] * view.cosine[pixel] / (ideal_m * ideal_m);
        let [hopeless, sufficient] = [0.6, 1.4].map(|share| share * self.least_signal);
        let lost = signal < sufficient
            && (signal < hopeless || signal < random.between(at + 2, hopeless, sufficient));
        if lost {
            return 0.0;
        }
        // Looking a little aside shifts depth along the slope: one more normal error beside the axial one.
        let aside_m = self.shift_px * slope;
        let axial_m = self.model.sigma_m(ideal_m, view.incidence_rad[pixel]);
        ideal_m + axial_m.hypot(aside_m) * random.gaussian(at + 3)
    }

    /// A pixel beside an edge: the silhouette crosses it about half of the time, and then anywhere.
    fn mixed(&self, truth_m: f32, around: Neighbourhood, random: Randomness, at: u64) -> f32 {
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
struct Neighbourhood {
    min_m: f32,
    max_m: f32,
    /// Metres a pixel.
    slope_x: f32,
    slope_y: f32,
}

impl Neighbourhood {
    fn slope_m_per_px(self) -> f32 {
        self.slope_x.hypot(self.slope_y)
    }

    fn of(view: &View, x: usize, y: usize) -> Self {
        let at = |x: usize, y: usize| view.depth_m[y * view.width + x];
        let centre = at(x, y);
        let (left, right) = (x.saturating_sub(1), (x + 1).min(view.width - 1));
        let (above, below) = (y.saturating_sub(1), (y + 1).min(view.height - 1));
        let (mut min_m, mut max_m) = (centre, centre);
        for row in [above, y, below] {
            for depth_m in [at(left, row), at(x, row), at(right, row)] {
                if depth_m > 0.0 {
                    min_m = min_m.min(depth_m);
                    max_m = max_m.max(depth_m);
                }
            }
        }
        Self {
            min_m,
            max_m,
            slope_x: 0.5 * (at(right, y) - at(left, y)),
            slope_y: 0.5 * (at(x, below) - at(x, above)),
        }
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
