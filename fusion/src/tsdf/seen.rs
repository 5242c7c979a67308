//! What a view says to the voxels that fall on a pixel: how far they are from its plane.

use glam::{Vec3, Vec4};
use rayon::prelude::*;

use super::{DepthView, touch::counts};
use crate::maps::Region;

/// The planes of the pixels of a region, row-major, and after the last one more that has no say.
#[derive(Clone, Debug, Default)]
pub(super) struct Seen {
    pub(super) columns: usize,
    /// Normal and offset in camera space: a place `p` is `normal . p - offset` metres before the surface.
    pub(super) planes: Vec<Vec4>,
    /// 0 for a pixel that has no say.
    pub(super) weights: Vec<f32>,
}

impl Seen {
    /// The number of the pixel that has no say.
    pub(super) fn nothing(&self) -> u32 {
        self.weights.len() as u32 - 1
    }

    pub(super) fn look(
        &mut self,
        view: &DepthView<'_>,
        region: &Region,
        weight: &(impl Fn(usize) -> f32 + Sync),
    ) {
        let columns = region.columns.len();
        self.columns = columns;
        let count = columns * region.rows.len();
        self.planes.resize(count + 1, Vec4::ZERO);
        self.weights.resize(count + 1, 0.0);
        self.weights[count] = 0.0;
        let rows = self.planes[..count].par_chunks_mut(columns.max(1));
        rows.zip(self.weights[..count].par_chunks_mut(columns.max(1)))
            .enumerate()
            .with_min_len(16)
            .for_each(|(row, (planes, weights))| {
                let first = (region.rows.start + row) * view.points.width + region.columns.start;
                for ((pixel, plane), own) in (first..).zip(planes).zip(weights) {
                    let say = weight(pixel);
                    let found = counts(say).then(|| plane_of(view, pixel)).flatten();
                    (*plane, *own) = found.map(|plane| (plane, say)).unwrap_or_default();
                }
            });
    }
}

/// Of the surface at a pixel. Without a normal distances are measured along the pixel's ray.
#[inline]
fn plane_of(view: &DepthView<'_>, pixel: usize) -> Option<Vec4> {
    let surface = view.points.points[pixel];
    if surface.z.is_nan() {
        return None;
    }
    let normal = view
        .normals
        .map_or(Vec3::NAN, |normals| normals.normals[pixel]);
    if normal.x.is_nan() {
        let per_depth = surface.length() / surface.z;
        return Some(Vec4::new(0.0, 0.0, -per_depth, -surface.length()));
    }
    Some(normal.extend(normal.dot(surface)))
}
