//! The depth image at half its size: enough to tell people from rooms, at a quarter of the cost.

use glam::Vec3;
use rayon::prelude::*;

use super::super::tolerance::Tolerance;
use crate::maps::{DepthMap, Rays};

/// Pixels along a side of a cell.
pub(super) const CELL_PX: usize = 2;

/// Pixels of a surface that falls away by this, in metres a metre, beside the noise, are one surface.
const FRONT_SLOPE: f32 = 2.0;

/// One point for each cell; NaN where nothing was measured.
#[derive(Clone, Debug)]
pub(super) struct Coarse {
    pub(super) width: usize,
    pub(super) height: usize,
    pub(super) points: Vec<Vec3>,
    rays: Vec<Vec3>,
}

impl Coarse {
    pub(super) fn new(rays: &Rays) -> Self {
        let (width, height) = (rays.width / CELL_PX, rays.height / CELL_PX);
        let center = |cell: usize| {
            let corner = cell / width * CELL_PX * rays.width + cell % width * CELL_PX;
            let opposite = corner + rays.width + 1;
            let middle = rays.on_unit_plane[corner].midpoint(rays.on_unit_plane[opposite]);
            // Where the lens folds no pixel has a ray, and whatever was measured there has no place.
            if middle.is_finite() {
                middle.extend(1.0)
            } else {
                Vec3::NAN
            }
        };
        Self {
            width,
            height,
            points: vec![Vec3::NAN; width * height],
            rays: (0..width * height).map(center).collect(),
        }
    }

    /// Each cell takes the mean of its pixels near the nearest one: at an edge the front surface.
    pub(super) fn update(&mut self, depth: &DepthMap, tolerance: &Tolerance) {
        let rows = self
            .points
            .par_chunks_mut(self.width.max(1))
            .zip(self.rays.par_chunks(self.width.max(1)));
        rows.enumerate()
            .with_min_len(32)
            .for_each(|(y, (points, rays))| {
                let above = &depth.metres[CELL_PX * y * depth.width..][..depth.width];
                let below = &depth.metres[(CELL_PX * y + 1) * depth.width..][..depth.width];
                let pairs = || above.chunks_exact(CELL_PX).zip(below.chunks_exact(CELL_PX));
                // Most cells see one surface, even if nothing is allowed for noise: first all of them as if they
                // did, several at a time.
                let alike = FRONT_SLOPE * tolerance.pixel_size_m(1.0);
                for ((point, ray), (above, below)) in points.iter_mut().zip(rays).zip(pairs()) {
                    *point = *ray * alike_depth([above[0], above[1], below[0], below[1]], alike);
                }
                for ((point, ray), (above, below)) in points.iter_mut().zip(rays).zip(pairs()) {
                    if point.z.is_nan() {
                        *point =
                            *ray * front_depth([above[0], above[1], below[0], below[1]], tolerance);
                    }
                }
            });
    }

    /// The metres a cell is wide at its depth.
    pub(super) fn cell_size_m(&self, cell: usize, tolerance: &Tolerance) -> f32 {
        CELL_PX as f32 * tolerance.pixel_size_m(self.points[cell].z)
    }
}

/// The mean of four pixels that differ by less than this share of their depth; NaN if they do not, or one is missing.
#[inline]
fn alike_depth([a, b, c, d]: [f32; 4], share: f32) -> f32 {
    // Written without regard to NaN, which the mean brings back in.
    let larger = |a: f32, b: f32| if a > b { a } else { b };
    let smaller = |a: f32, b: f32| if a < b { a } else { b };
    let nearest = smaller(smaller(a, b), smaller(c, d));
    let spread = larger(larger(a, b), larger(c, d)) - nearest;
    let mean = 0.25 * (a + b + c + d);
    if spread < share * nearest {
        mean
    } else {
        f32::NAN
    }
}

/// The mean of the pixels near the nearest one.
#[inline]
fn front_depth(pixels: [f32; 4], tolerance: &Tolerance) -> f32 {
    // `min` prefers a number to NaN.
    let nearest = pixels[0].min(pixels[1]).min(pixels[2].min(pixels[3]));
    if nearest.is_nan() {
        return f32::NAN;
    }
    let limit_m = nearest + tolerance.step_m(nearest, 1.0, FRONT_SLOPE, 3.0);
    let (mut sum, mut count) = (0.0, 0.0);
    for depth in pixels {
        if depth <= limit_m {
            sum += depth;
            count += 1.0;
        }
    }
    sum / count
}
