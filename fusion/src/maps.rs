//! Per-pixel geometry in the depth camera's space, row-major; NaN means "no measurement".

use std::ops::Range;

use effigy_capture::{CameraModel, DepthImage};
use glam::{Vec2, Vec3};
use rayon::prelude::*;

use crate::simd;

/// Depth along the optical axis, in metres.
#[derive(Clone, Debug, PartialEq)]
pub struct DepthMap {
    pub width: usize,
    pub height: usize,
    pub metres: Vec<f32>,
}

/// The point seen by each pixel, in metres.
#[derive(Clone, Debug, PartialEq)]
pub struct VertexMap {
    pub width: usize,
    pub height: usize,
    pub points: Vec<Vec3>,
}

/// The unit normal at each pixel, towards the camera.
#[derive(Clone, Debug, PartialEq)]
pub struct NormalMap {
    pub width: usize,
    pub height: usize,
    pub normals: Vec<Vec3>,
}

/// Where each pixel's ray meets the plane z = 1: computed once a camera, so that a lens costs nothing later.
#[derive(Clone, Debug)]
pub struct Rays {
    pub width: usize,
    pub height: usize,
    pub on_unit_plane: Vec<Vec2>,
}

/// A rectangle of pixels.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Region {
    pub columns: Range<usize>,
    pub rows: Range<usize>,
}

impl Region {
    pub fn whole(width: usize, height: usize) -> Self {
        Self { columns: 0..width, rows: 0..height }
    }

    pub fn is_empty(&self) -> bool {
        self.columns.is_empty() || self.rows.is_empty()
    }

    /// Grown by a border, within an image of that size.
    pub fn grown(&self, border: usize, width: usize, height: usize) -> Self {
        let grow = |range: &Range<usize>, size: usize| {
            range.start.saturating_sub(border)..(range.end + border).min(size)
        };
        Self { columns: grow(&self.columns, width), rows: grow(&self.rows, height) }
    }
}

impl Rays {
    pub fn new(camera: &CameraModel) -> Self {
        Self {
            width: camera.intrinsics.width as usize,
            height: camera.intrinsics.height as usize,
            on_unit_plane: camera.rays(),
        }
    }

    /// The ray through a place in the picture, from `[0, 0]` at its top left to `[1, 1]`.
    pub(crate) fn at(&self, [x, y]: [f32; 2]) -> Vec2 {
        let pixel =
            |share: f32, size: usize| ((share * size as f32) as usize).min(size.saturating_sub(1));
        self.on_unit_plane[pixel(y, self.height) * self.width + pixel(x, self.width)]
    }

    pub fn point(&self, pixel: usize, depth_m: f32) -> Vec3 {
        self.on_unit_plane[pixel].extend(1.0) * depth_m
    }
}

impl DepthMap {
    /// Raw depth in metres; NaN where there is none, or where it lies outside `range_m`.
    pub fn in_metres(image: &DepthImage, metres_per_unit: f32, range_m: [f32; 2]) -> Self {
        Self::in_metres_into(Vec::new(), image, metres_per_unit, range_m)
    }

    /// As [`Self::in_metres`], in memory that may have served before.
    #[expect(
        clippy::needless_bitwise_bool,
        reason = "without shortcuts several pixels are converted at a time"
    )]
    pub(crate) fn in_metres_into(
        mut metres: Vec<f32>,
        image: &DepthImage,
        metres_per_unit: f32,
        range_m: [f32; 2],
    ) -> Self {
        let convert = |&raw: &u16| {
            let depth_m = f32::from(raw) * metres_per_unit;
            let usable = (raw != 0) & (depth_m >= range_m[0]) & (depth_m <= range_m[1]);
            if usable { depth_m } else { f32::NAN }
        };
        metres.clear();
        simd::run(
            #[inline(always)]
            || metres.extend(image.pixels().iter().map(convert)),
        );
        Self { width: image.width() as usize, height: image.height() as usize, metres }
    }

    /// A map without any measurement.
    pub fn empty(width: usize, height: usize) -> Self {
        Self { width, height, metres: vec![f32::NAN; width * height] }
    }

    pub fn valid_count(&self) -> usize {
        self.metres.iter().filter(|depth| depth.is_finite()).count()
    }
}

impl VertexMap {
    /// The point at each pixel's depth along its ray.
    ///
    /// # Panics
    /// If depth and rays differ in size.
    pub fn unproject(depth: &DepthMap, rays: &Rays) -> Self {
        assert_eq!(
            (depth.width, depth.height),
            (rays.width, rays.height),
            "one ray a pixel"
        );
        let points = depth
            .metres
            .par_iter()
            .with_min_len(1 << 14)
            .zip(&rays.on_unit_plane)
            .map(|(&depth_m, ray)| ray.extend(1.0) * depth_m)
            .collect();
        Self { width: depth.width, height: depth.height, points }
    }

    pub fn empty(width: usize, height: usize) -> Self {
        Self { width, height, points: vec![Vec3::NAN; width * height] }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn zero_and_far_pixels_have_no_depth() {
        let image = DepthImage::new(4, 1, vec![0, 100, 1500, 9000]).unwrap();
        let map = DepthMap::in_metres(&image, 0.001, [0.3, 5.0]);
        assert_eq!(map.valid_count(), 1);
        assert!((map.metres[2] - 1.5).abs() < 1e-6);
    }
}
