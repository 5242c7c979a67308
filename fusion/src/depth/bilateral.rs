//! Edge-preserving smoothing that knows how noisy the sensor is and how the surface slopes.
//!
//! Tomasi and Manduchi's bilateral filter (1998), but neighbours are compared with the plane through the
//! pixel instead of with its depth: on a slanted surface the plain filter would average along the depth
//! contour only, and next to an edge it would pull the surface to one side.

use std::ops::Range;

use glam::Vec2;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::tolerance::Tolerance;
use crate::{
    maps::{DepthMap, Region},
    simd,
};

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct BilateralConfig {
    /// Half the window's width; 0 leaves the depth as it is, 8 is the most.
    pub radius_px: usize,
    /// Standard deviation of the weight over the image. Two pixels are a centimetre at 2 m: finer than
    /// cloth folds, coarser than a sensor's own correlation.
    pub spatial_sigma_px: f32,
    /// A neighbour that differs from the plane by this many of the sensor's standard deviations has no say.
    pub range_sigmas: f32,
}

impl Default for BilateralConfig {
    fn default() -> Self {
        Self { radius_px: 3, spatial_sigma_px: 2.0, range_sigmas: 6.0 }
    }
}

/// A window wider than this takes too long for a live stage.
const MAX_RADIUS_PX: usize = 8;
/// Stands for "no measurement": so far away that it never has a say.
const NOWHERE_M: f32 = 1.0e6;
/// A difference above this many metres a metre is a step, not a slope: 76 degrees.
const MAX_SLOPE: f32 = 4.0;
/// Noise that a slope's ends may have, in standard deviations of their difference.
const SLOPE_SIGMAS: f32 = 4.0;

/// The filter with its window and working memory.
#[derive(Clone, Debug)]
pub struct Bilateral {
    config: BilateralConfig,
    taps: Vec<Tap>,
    /// The region with a border, row-major.
    padded: Vec<f32>,
    slopes: Slopes,
}

#[derive(Clone, Copy, Debug)]
struct Tap {
    dx: isize,
    dy: isize,
    weight: f32,
}

/// Slopes of the surface in metres a pixel, one for each two by two pixels.
#[derive(Clone, Debug, Default)]
struct Slopes {
    columns: usize,
    depths: Vec<f32>,
    /// Before and after they are averaged over three cells square.
    rough: Vec<Vec2>,
    smooth: Vec<Vec2>,
}

impl Bilateral {
    pub fn new(config: &BilateralConfig) -> Self {
        let radius = config.radius_px.min(MAX_RADIUS_PX) as isize;
        let falloff = 0.5 / (config.spatial_sigma_px * config.spatial_sigma_px).max(1e-6);
        let window = (-radius..=radius).flat_map(|dy| (-radius..=radius).map(move |dx| (dx, dy)));
        let taps = window
            // A round window: its corners would weigh next to nothing.
            .filter(|&(dx, dy)| dx * dx + dy * dy <= radius * radius + radius)
            .map(|(dx, dy)| Tap { dx, dy, weight: (-falloff * (dx * dx + dy * dy) as f32).exp() })
            .collect();
        let config = config.clone();
        Self { config, taps, padded: Vec::new(), slopes: Slopes::default() }
    }

    /// Smooths the pixels of a region that `chosen` names; all others are read only.
    pub fn smooth(
        &mut self,
        depth: &mut DepthMap,
        region: &Region,
        chosen: &[bool],
        tolerance: &Tolerance,
    ) {
        if region.is_empty() || self.taps.len() < 2 {
            return;
        }
        let border = self.config.radius_px.min(MAX_RADIUS_PX);
        let stride = region.columns.len() + 2 * border;
        pad(&mut self.padded, depth, region, border);
        self.slopes.measure(&self.padded, stride, tolerance);
        let window = Window { filter: self, tolerance, stride, border };
        let width = depth.width;
        let rows = region.rows.start * width..region.rows.end * width;
        depth.metres[rows.clone()]
            .par_chunks_mut(width)
            .zip(chosen[rows].par_chunks(width))
            .enumerate()
            .for_each_init(RowSums::default, |sums, (row, (metres, chosen))| {
                let columns = region.columns.clone();
                window.smooth_row(row, &mut metres[columns.clone()], &chosen[columns], sums);
            });
    }
}

/// Copies a region with a border: of measurements within the image, of nothing beyond it.
fn pad(padded: &mut Vec<f32>, depth: &DepthMap, region: &Region, border: usize) {
    let stride = region.columns.len() + 2 * border;
    padded.clear();
    padded.resize(stride * (region.rows.len() + 2 * border), NOWHERE_M);
    let source = region.grown(border, depth.width, depth.height);
    let first_column = source.columns.start + border - region.columns.start;
    for y in source.rows.clone() {
        let row = (y + border - region.rows.start) * stride + first_column;
        let from = &depth.metres[y * depth.width..][source.columns.clone()];
        for (to, &metres) in padded[row..].iter_mut().zip(from) {
            *to = if metres.is_nan() { NOWHERE_M } else { metres };
        }
    }
}

impl Slopes {
    fn measure(&mut self, depths: &[f32], stride: usize, tolerance: &Tolerance) {
        let (columns, rows) = (stride / 2, depths.len() / stride / 2);
        self.columns = columns;
        self.shrink(depths, stride, tolerance);
        self.rough.clear();
        self.rough.resize(columns * rows, Vec2::ZERO);
        self.smooth.clone_from(&self.rough);
        for y in 1..rows.saturating_sub(1) {
            for cell in y * columns + 1..(y + 1) * columns - 1 {
                let limit_m = self.limit_m(cell, tolerance);
                self.rough[cell] = Vec2::new(
                    self.slope(cell, 1, limit_m),
                    self.slope(cell, columns, limit_m),
                );
            }
        }
        for y in 1..rows.saturating_sub(1) {
            for cell in y * columns + 1..(y + 1) * columns - 1 {
                self.smooth[cell] = self.mean_around(cell, self.limit_m(cell, tolerance));
            }
        }
    }

    /// The mean depth of each two by two pixels, of those near the first that is measured.
    fn shrink(&mut self, depths: &[f32], stride: usize, tolerance: &Tolerance) {
        let (columns, rows) = (stride / 2, depths.len() / stride / 2);
        self.depths.clear();
        self.depths.reserve(columns * rows);
        for y in 0..rows {
            for x in 0..columns {
                let corner = 2 * y * stride + 2 * x;
                let four = [corner, corner + 1, corner + stride, corner + stride + 1]
                    .map(|pixel| depths[pixel]);
                let first = four.into_iter().find(|&depth| depth < NOWHERE_M);
                self.depths.push(first.map_or(NOWHERE_M, |first| {
                    let limit_m = tolerance.step_m(first, 1.0, MAX_SLOPE, SLOPE_SIGMAS);
                    let near = four.map(|depth| (depth - first).abs() < limit_m);
                    let sum: f32 = (0..4).map(|i| if near[i] { four[i] } else { 0.0 }).sum();
                    sum / near.into_iter().filter(|&near| near).count() as f32
                }));
            }
        }
    }

    fn limit_m(&self, cell: usize, tolerance: &Tolerance) -> f32 {
        let depth_m = self.depths[cell];
        if depth_m < NOWHERE_M {
            tolerance.step_m(depth_m, 2.0, MAX_SLOPE, SLOPE_SIGMAS)
        } else {
            0.0
        }
    }

    /// Over the cells on both sides, or on the one that is on the same surface.
    fn slope(&self, cell: usize, step: usize, limit_m: f32) -> f32 {
        let here = self.depths[cell];
        let ahead = self.depths[cell + step] - here;
        let behind = here - self.depths[cell - step];
        match (ahead.abs() < limit_m, behind.abs() < limit_m) {
            (true, true) => 0.25 * (ahead + behind),
            (true, false) => 0.5 * ahead,
            (false, true) => 0.5 * behind,
            (false, false) => 0.0,
        }
    }

    fn mean_around(&self, cell: usize, limit_m: f32) -> Vec2 {
        let (mut sum, mut count) = (Vec2::ZERO, 0.0);
        for row in [cell - self.columns, cell, cell + self.columns] {
            for near in row - 1..=row + 1 {
                if (self.depths[near] - self.depths[cell]).abs() < limit_m {
                    sum += self.rough[near];
                    count += 1.0;
                }
            }
        }
        if count > 0.0 { sum / count } else { Vec2::ZERO }
    }
}

/// Everything a row needs.
struct Window<'a> {
    filter: &'a Bilateral,
    tolerance: &'a Tolerance,
    stride: usize,
    border: usize,
}

/// One number for each pixel of a row.
#[derive(Default)]
struct RowSums {
    slope_x: Vec<f32>,
    slope_y: Vec<f32>,
    /// One over the square of the range a neighbour must be in.
    narrowness: Vec<f32>,
    weights: Vec<f32>,
    offsets: Vec<f32>,
}

impl Window<'_> {
    fn smooth_row(&self, row: usize, metres: &mut [f32], chosen: &[bool], sums: &mut RowSums) {
        let Some(first) = chosen.iter().position(|&chosen| chosen) else {
            return;
        };
        let end = chosen
            .iter()
            .rposition(|&chosen| chosen)
            .map_or(0, |last| last + 1);
        self.prepare(row, first..end, sums);
        let start = (row + self.border) * self.stride + self.border + first;
        let centers = &self.filter.padded[start..start + end - first];
        simd::run(
            #[inline(always)]
            || {
                for tap in &self.filter.taps {
                    let shifted = start as isize + tap.dy * self.stride as isize + tap.dx;
                    let neighbours = &self.filter.padded[shifted as usize..][..end - first];
                    sums.add(tap, centers, neighbours);
                }
            },
        );
        for (index, (depth, &chosen)) in metres[first..end]
            .iter_mut()
            .zip(&chosen[first..end])
            .enumerate()
        {
            if chosen && !depth.is_nan() {
                *depth += sums.offsets[index] / sums.weights[index];
            }
        }
    }

    fn prepare(&self, row: usize, columns: Range<usize>, sums: &mut RowSums) {
        let padded_row = row + self.border;
        for values in [&mut sums.slope_x, &mut sums.slope_y, &mut sums.narrowness] {
            values.clear();
        }
        for values in [&mut sums.weights, &mut sums.offsets] {
            values.clear();
            values.resize(columns.len(), 0.0);
        }
        let slopes = &self.filter.slopes;
        let last_cell = slopes.smooth.len().saturating_sub(1);
        for x in columns {
            let padded_column = x + self.border;
            let cell = padded_row / 2 * slopes.columns + padded_column / 2;
            let slope = slopes.smooth[cell.min(last_cell)];
            sums.slope_x.push(slope.x);
            sums.slope_y.push(slope.y);
            let depth_m = self.filter.padded[padded_row * self.stride + padded_column];
            let range_m = self.filter.config.range_sigmas * self.tolerance.sigma_m(depth_m);
            sums.narrowness.push(1.0 / (range_m * range_m).max(1e-12));
        }
    }
}

impl RowSums {
    /// Adds one neighbour of every pixel; written so that the compiler can do several at a time.
    #[expect(clippy::inline_always, reason = "compiled anew for each vector unit")]
    #[inline(always)]
    fn add(&mut self, tap: &Tap, centers: &[f32], neighbours: &[f32]) {
        let count = centers.len();
        let (dx, dy, weight) = (tap.dx as f32, tap.dy as f32, tap.weight);
        let (slope_x, slope_y) = (&self.slope_x[..count], &self.slope_y[..count]);
        let narrowness = &self.narrowness[..count];
        let (weights, offsets) = (&mut self.weights[..count], &mut self.offsets[..count]);
        let neighbours = &neighbours[..count];
        for index in 0..count {
            let offset =
                neighbours[index] - centers[index] - slope_x[index] * dx - slope_y[index] * dy;
            // Tukey's biweight: a bell that ends.
            let bell = (1.0 - offset * offset * narrowness[index]).max(0.0);
            let weight = weight * bell * bell;
            weights[index] += weight;
            offsets[index] += weight * offset;
        }
    }
}

#[cfg(test)]
mod tests {
    use effigy_capture::{Intrinsics, SensorModel};

    use super::*;
    use crate::mesh::sample::SplitMix;

    const SENSOR: SensorModel = SensorModel::TimeOfFlight { floor_m: 0.0005, slope: 0.001 };
    const SIZE: usize = 64;

    fn smoothed(truth: impl Fn(usize, usize) -> f32, sigma_m: f32) -> (f32, f32) {
        let camera = Intrinsics { width: 64, height: 64, fx: 500.0, fy: 500.0, cx: 0.0, cy: 0.0 };
        let mut random = SplitMix::new(1);
        let mut noise = || (0..12).map(|_| random.unit_f64() as f32).sum::<f32>() - 6.0;
        let truth: Vec<f32> = (0..SIZE * SIZE)
            .map(|p| truth(p % SIZE, p / SIZE))
            .collect();
        let metres: Vec<f32> = truth
            .iter()
            .map(|depth| depth + sigma_m * noise())
            .collect();
        let mut depth = DepthMap { width: SIZE, height: SIZE, metres: metres.clone() };
        let whole = Region::whole(SIZE, SIZE);
        let tolerance = Tolerance::new(SENSOR, &camera);
        let mut filter = Bilateral::new(&BilateralConfig::default());
        filter.smooth(&mut depth, &whole, &vec![true; SIZE * SIZE], &tolerance);
        let rms = |map: &[f32]| {
            // The rim has neighbours on one side only, and its slopes are rougher.
            let inner = 6..SIZE - 6;
            let squares = (0..SIZE * SIZE)
                .filter(|p| inner.contains(&(p % SIZE)) && inner.contains(&(p / SIZE)))
                .map(|p| (map[p] - truth[p]) * (map[p] - truth[p]));
            (squares.sum::<f32>() / (inner.len() * inner.len()) as f32).sqrt()
        };
        (rms(&metres), rms(&depth.metres))
    }

    #[test]
    fn white_noise_on_a_slanted_surface_falls_to_less_than_a_third() {
        // Sixty degrees at 2 m: 7 mm a pixel, against noise of 2 mm.
        let (before, after) = smoothed(|x, _| 2.0 + 0.007 * x as f32, 0.002);
        assert!((before - 0.002).abs() < 2e-4);
        assert!(after < before / 3.0, "{after} of {before}");
    }

    #[test]
    fn a_step_stays_a_step() {
        let (before, after) = smoothed(|x, _| if x < 31 { 1.5 } else { 1.55 }, 0.0015);
        assert!(after < before / 3.0, "{after} of {before}");
    }

    #[test]
    fn a_surface_without_noise_is_left_alone() {
        let (_, after) = smoothed(|x, y| 1.8 + 0.003 * x as f32 - 0.002 * y as f32, 0.0);
        assert!(after < 2e-6, "{after}");
    }

    #[test]
    fn pixels_that_are_not_chosen_or_not_measured_stay_as_they_are() {
        let camera = Intrinsics { width: 64, height: 64, fx: 500.0, fy: 500.0, cx: 0.0, cy: 0.0 };
        let mut metres: Vec<f32> = (0..SIZE * SIZE)
            .map(|p| 1.5 + (p % 7) as f32 * 1e-3)
            .collect();
        metres[20 * SIZE + 20] = f32::NAN;
        let mut depth = DepthMap { width: SIZE, height: SIZE, metres: metres.clone() };
        let region = Region { columns: 1..40, rows: 3..33 };
        let mut chosen = vec![false; SIZE * SIZE];
        chosen[20 * SIZE + 19..20 * SIZE + 25].fill(true);
        let tolerance = Tolerance::new(SENSOR, &camera);
        let mut filter = Bilateral::new(&BilateralConfig::default());
        filter.smooth(&mut depth, &region, &chosen, &tolerance);
        for pixel in 0..SIZE * SIZE {
            let changed = depth.metres[pixel].to_bits() != metres[pixel].to_bits();
            let smoothed = chosen[pixel] && !metres[pixel].is_nan();
            assert!(changed == smoothed, "pixel {pixel}");
        }
    }
}
