//! Drops pixels that hang between a near and a far surface, or alone in the air.

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::tolerance::Tolerance;
use crate::maps::{DepthMap, Region};

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct FlyingPixelConfig {
    /// A neighbour supports a pixel if their depths differ by less than this many standard deviations...
    pub range_sigmas: f32,
    /// ...plus what a surface this steep (metres a metre) explains: 2 is 63 degrees.
    pub slope: f32,
    /// A pixel is kept with this many of its 8 neighbours in support. A straight edge leaves 5, a right
    /// angle 3, a strip of one pixel 2.
    pub neighbours: u32,
}

impl Default for FlyingPixelConfig {
    fn default() -> Self {
        Self { range_sigmas: 3.0, slope: 2.0, neighbours: 4 }
    }
}

/// Removes unsupported pixels of a region. `before` is working memory.
pub fn drop_flying_pixels(
    depth: &mut DepthMap,
    region: &Region,
    tolerance: &Tolerance,
    config: &FlyingPixelConfig,
    before: &mut Vec<f32>,
) {
    let (width, height) = (depth.width, depth.height);
    before.clone_from(&depth.metres);
    let before = &*before;
    let rows = region.rows.start * width..region.rows.end * width;
    depth.metres[rows]
        .par_chunks_mut(width)
        .enumerate()
        .for_each(|(row, metres)| {
            let y = region.rows.start + row;
            for x in region.columns.clone() {
                let center = metres[x];
                if center.is_nan() {
                    continue;
                }
                let limit_m = tolerance.step_m(center, 1.0, config.slope, config.range_sigmas);
                let support = support(before, [width, height], [x, y], limit_m);
                if support < config.neighbours {
                    metres[x] = f32::NAN;
                }
            }
        });
}

/// How many of the 8 neighbours are within the limit; those beyond the image's border count as if they were.
#[inline]
fn support(depths: &[f32], [width, height]: [usize; 2], [x, y]: [usize; 2], limit_m: f32) -> u32 {
    let center = depths[y * width + x];
    let supports = |index: usize| u32::from((depths[index] - center).abs() < limit_m);
    if x > 0 && y > 0 && x + 1 < width && y + 1 < height {
        let above = (y - 1) * width + x;
        let here = y * width + x;
        let below = (y + 1) * width + x;
        return (supports(above - 1) + supports(above) + supports(above + 1))
            + (supports(here - 1) + supports(here + 1))
            + (supports(below - 1) + supports(below) + supports(below + 1));
    }
    let mut count = 0;
    for (dx, dy) in [
        (-1, -1),
        (0, -1),
        (1, -1),
        (-1, 0),
        (1, 0),
        (-1, 1),
        (0, 1),
        (1, 1),
    ] {
        let (at_x, at_y) = (x.wrapping_add_signed(dx), y.wrapping_add_signed(dy));
        count += if at_x < width && at_y < height {
            supports(at_y * width + at_x)
        } else {
            1
        };
    }
    count
}

#[cfg(test)]
mod tests {
    use effigy_capture::{Intrinsics, SensorModel};

    use super::*;

    fn cleaned(mut depth: DepthMap) -> DepthMap {
        let sensor = SensorModel::TimeOfFlight { floor_m: 0.0005, slope: 0.001 };
        let camera = Intrinsics { width: 40, height: 30, fx: 500.0, fy: 500.0, cx: 0.0, cy: 0.0 };
        let tolerance = Tolerance::new(sensor, &camera);
        let whole = Region::whole(40, 30);
        drop_flying_pixels(
            &mut depth,
            &whole,
            &tolerance,
            &FlyingPixelConfig::default(),
            &mut Vec::new(),
        );
        depth
    }

    fn step_with_mixed_pixels() -> DepthMap {
        let metres = (0..40 * 30)
            .map(|pixel| match pixel % 40 {
                0..20 => 1.5,
                // Mixed by a different share in each row.
                20 => 1.6 + 0.7 * ((pixel / 40 * 7 % 10) as f32 / 10.0),
                _ => 2.5,
            })
            .collect();
        DepthMap { width: 40, height: 30, metres }
    }

    #[test]
    fn pixels_between_two_surfaces_are_dropped_and_both_surfaces_kept() {
        let cleaned = cleaned(step_with_mixed_pixels());
        for (pixel, depth_m) in cleaned.metres.iter().enumerate() {
            assert_eq!(depth_m.is_nan(), pixel % 40 == 20, "pixel {pixel}");
        }
    }

    #[test]
    fn a_surface_seen_at_sixty_degrees_is_kept_whole() {
        let slope = 60_f32.to_radians().tan() * 2.0 / 500.0;
        let metres = (0..40 * 30)
            .map(|pixel| 2.0 + slope * (pixel % 40) as f32)
            .collect();
        let cleaned = cleaned(DepthMap { width: 40, height: 30, metres });
        assert_eq!(cleaned.valid_count(), 1200);
    }
}
