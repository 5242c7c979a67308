//! Closes small holes inside a surface.

use serde::{Deserialize, Serialize};

use super::tolerance::Tolerance;
use crate::maps::{DepthMap, Region};

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct FillConfig {
    /// How far to look for the hole's edge; 0 fills nothing. Three pixels are 15 mm at 2 m.
    pub radius_px: usize,
    /// The edges must agree within this many standard deviations of a difference...
    pub range_sigmas: f32,
    /// ...plus what a surface this steep (metres a metre) explains.
    pub slope: f32,
}

impl Default for FillConfig {
    fn default() -> Self {
        Self { radius_px: 3, range_sigmas: 3.0, slope: 2.0 }
    }
}

/// A pixel filled from its surroundings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Filled {
    pub pixel: usize,
    pub depth_m: f32,
}

/// Depths for the empty pixels of a region that have chosen pixels on opposite sides, near and alike.
///
/// The depth between two edges is interpolated; where both pairs of sides qualify, the closer pair counts more.
pub fn fill_holes(
    depth: &DepthMap,
    chosen: &[bool],
    region: &Region,
    tolerance: &Tolerance,
    config: &FillConfig,
) -> Vec<Filled> {
    let mut filled = Vec::new();
    for y in region.rows.clone() {
        for x in region.columns.clone() {
            let pixel = y * depth.width + x;
            if !depth.metres[pixel].is_nan() {
                continue;
            }
            let across = Line { here: pixel, step: 1, before: x, after: depth.width - 1 - x };
            let down =
                Line { here: pixel, step: depth.width, before: y, after: depth.height - 1 - y };
            let found = [across, down].map(|line| line.bridge(depth, chosen, tolerance, config));
            let (sum, weight) = found
                .into_iter()
                .flatten()
                .fold((0.0, 0.0), |(sum, total), (depth_m, weight)| {
                    (sum + weight * depth_m, total + weight)
                });
            if weight > 0.0 {
                filled.push(Filled { pixel, depth_m: sum / weight });
            }
        }
    }
    filled
}

/// A row or a column through a pixel, with the pixels there are before and after it.
struct Line {
    here: usize,
    step: usize,
    before: usize,
    after: usize,
}

impl Line {
    /// The depth half-way across the hole and its weight, if both its edges are near and alike.
    fn bridge(
        &self,
        depth: &DepthMap,
        chosen: &[bool],
        tolerance: &Tolerance,
        config: &FillConfig,
    ) -> Option<(f32, f32)> {
        let edge = |available: usize, at: &dyn Fn(usize) -> usize| {
            (1..=config.radius_px.min(available))
                .find(|&distance| !depth.metres[at(distance)].is_nan())
                .filter(|&distance| chosen[at(distance)])
                .map(|distance| (distance as f32, depth.metres[at(distance)]))
        };
        let (to_first, first_m) = edge(self.before, &|distance| self.here - distance * self.step)?;
        let (to_second, second_m) = edge(self.after, &|distance| self.here + distance * self.step)?;
        let gap = to_first + to_second;
        let limit_m = tolerance.step_m(first_m, gap, config.slope, config.range_sigmas);
        let alike = (first_m - second_m).abs() < limit_m;
        alike.then(|| ((first_m * to_second + second_m * to_first) / gap, 1.0 / gap))
    }
}

#[cfg(test)]
mod tests {
    use effigy_capture::{Intrinsics, SensorModel};

    use super::*;

    fn fill(depth: &DepthMap) -> Vec<Filled> {
        let sensor = SensorModel::TimeOfFlight { floor_m: 0.0005, slope: 0.001 };
        let camera = Intrinsics { width: 30, height: 20, fx: 500.0, fy: 500.0, cx: 0.0, cy: 0.0 };
        let tolerance = Tolerance::new(sensor, &camera);
        let chosen: Vec<bool> = depth.metres.iter().map(|depth| !depth.is_nan()).collect();
        fill_holes(
            depth,
            &chosen,
            &Region::whole(30, 20),
            &tolerance,
            &FillConfig::default(),
        )
    }

    fn slope_with_hole(size: usize) -> (DepthMap, Vec<f32>) {
        let truth: Vec<f32> = (0..600).map(|p| 1.5 + 0.002 * (p % 30) as f32).collect();
        let mut metres = truth.clone();
        for y in 8..8 + size {
            metres[y * 30 + 10..y * 30 + 10 + size].fill(f32::NAN);
        }
        (DepthMap { width: 30, height: 20, metres }, truth)
    }

    #[test]
    fn a_small_hole_in_a_slope_is_filled_with_the_slope() {
        let (depth, truth) = slope_with_hole(3);
        let filled = fill(&depth);
        assert_eq!(filled.len(), 9);
        for Filled { pixel, depth_m } in filled {
            assert!((depth_m - truth[pixel]).abs() < 1e-6);
        }
    }

    #[test]
    fn the_middle_of_a_large_hole_and_the_gap_beside_a_step_stay_open() {
        let (depth, _) = slope_with_hole(8);
        assert!(fill(&depth).is_empty());
        let metres = (0..600).map(|p| match p % 30 {
            0..14 => 1.5,
            14 => f32::NAN,
            _ => 1.6,
        });
        let depth = DepthMap { width: 30, height: 20, metres: metres.collect() };
        assert!(fill(&depth).is_empty());
    }
}
