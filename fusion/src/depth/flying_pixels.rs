//! Drops pixels that hang between a near and a far surface, or alone in the air.

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::tolerance::Tolerance;
use crate::{
    maps::{DepthMap, Region},
    simd,
};

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
    if region.is_empty() {
        return;
    }
    let width = depth.width;
    let copied = copy_with_border(depth, region, before);
    let rows = region.rows.start * width..region.rows.end * width;
    depth.metres[rows]
        .par_chunks_mut(width)
        .enumerate()
        .for_each_init(
            || (Vec::new(), Vec::new()),
            |(limits_m, support), (row, metres)| {
                let metres = &mut metres[region.columns.clone()];
                limits_m.clear();
                limits_m.extend(metres.iter().map(|&depth_m| {
                    // NaN counts as 0 here; it supports nothing and is not supported.
                    tolerance.step_m(depth_m, 1.0, config.slope, config.range_sigmas)
                }));
                count_support(&copied, row, limits_m, support);
                for (depth_m, &support) in metres.iter_mut().zip(&*support) {
                    if support < config.neighbours as f32 {
                        *depth_m = f32::NAN;
                    }
                }
            },
        );
}

/// A region's depths with a border of one pixel; beyond the image the border repeats its edge.
struct Copied<'a> {
    metres: &'a [f32],
    stride: usize,
}

fn copy_with_border<'a>(depth: &DepthMap, region: &Region, before: &'a mut Vec<f32>) -> Copied<'a> {
    before.clear();
    let stride = region.columns.len() + 2;
    for y in region.rows.start..region.rows.end + 2 {
        let row = y.saturating_sub(1).min(depth.height - 1) * depth.width;
        before.push(depth.metres[row + region.columns.start.saturating_sub(1)]);
        before.extend(&depth.metres[row..][region.columns.clone()]);
        before.push(depth.metres[row + region.columns.end.min(depth.width - 1)]);
    }
    Copied { metres: before, stride }
}

/// How many of each pixel's 8 neighbours are within its limit, for one row.
fn count_support(copied: &Copied<'_>, row: usize, limits_m: &[f32], support: &mut Vec<f32>) {
    let count = limits_m.len();
    support.clear();
    support.resize(count, 0.0);
    let line = |row: usize, shift: usize| &copied.metres[row * copied.stride + shift..][..count];
    let center = line(row + 1, 1);
    for (down, right) in [
        (0, 0),
        (0, 1),
        (0, 2),
        (1, 0),
        (1, 2),
        (2, 0),
        (2, 1),
        (2, 2),
    ] {
        let neighbours = line(row + down, right);
        simd::run(
            #[inline(always)]
            || {
                for index in 0..count {
                    let near = (neighbours[index] - center[index]).abs() < limits_m[index];
                    support[index] += f32::from(u8::from(near));
                }
            },
        );
    }
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
