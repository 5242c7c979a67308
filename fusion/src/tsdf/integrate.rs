//! Adds a depth map to a volume.
#![expect(
    clippy::inline_always,
    reason = "compiled anew for each vector unit, inside `simd::run`"
)]

use effigy_capture::{CameraModel, Distortion, Intrinsics};
use glam::{Mat3, Vec3};
use rayon::prelude::*;

use super::{
    DepthView, TsdfConfig, TsdfVolume,
    block::{BLOCK_SIDE, Block, LAYER, VoxelLayer},
    seen::Seen,
};
use crate::{
    maps::Region,
    simd::{self, nearest_whole},
};

impl TsdfVolume {
    /// Averages a view in. `weight` says how much a pixel counts, by its number: one over its variance,
    /// say; a pixel of weight 0 is left out.
    ///
    /// Blocks are shared among threads; the result does not depend on how many there are.
    ///
    /// # Panics
    /// If the maps and the camera differ in size.
    pub fn integrate(&mut self, view: &DepthView<'_>, weight: impl Fn(usize) -> f32 + Sync) {
        let Intrinsics { width, height, .. } = view.camera.intrinsics;
        assert_eq!(
            [view.points.width, view.points.height],
            [width as usize, height as usize]
        );
        if let Some(normals) = view.normals {
            assert_eq!(normals.normals.len(), view.points.points.len());
        }
        let region = self.touch_blocks(view, &weight);
        if region.is_empty() {
            return;
        }
        self.seen.look(view, &region, &weight);
        let projection = Projection::new(view, &self.config, (&self.seen, &region));
        self.blocks
            .par_iter_mut()
            .filter(|block| block.in_view)
            .for_each(|block| {
                simd::run(
                    #[inline(always)]
                    || projection.integrate(block),
                );
            });
    }
}

/// A view, as a block's voxels need it.
struct Projection<'a> {
    config: &'a TsdfConfig,
    camera: &'a CameraModel,
    seen: &'a Seen,
    /// Where what is seen begins in the picture, in pixels, and how many rows it has.
    corner: [f32; 2],
    rows: u32,
    /// In camera space, the volume's origin and one voxel along each axis.
    origin: Vec3,
    axes: Mat3,
    /// Where a layer's voxels are from its first, axis by axis.
    in_layer: [Lanes; 3],
    band_m: f32,
}

type Lanes = [f32; LAYER];

impl<'a> Projection<'a> {
    fn new(
        view: &'a DepthView<'a>,
        config: &'a TsdfConfig,
        (seen, region): (&'a Seen, &Region),
    ) -> Self {
        let camera_from_volume = view.volume_from_camera.inverse();
        let axes = camera_from_volume.rotation_matrix() * config.voxel_size_m;
        let in_layer = [0, 1, 2].map(|axis| {
            std::array::from_fn(|i| {
                let (x, y) = ((i % BLOCK_SIDE) as f32, (i / BLOCK_SIDE) as f32);
                axes.x_axis[axis] * x + axes.y_axis[axis] * y
            })
        });
        Self {
            config,
            camera: view.camera,
            seen,
            corner: [region.columns.start as f32, region.rows.start as f32],
            rows: region.rows.len() as u32,
            origin: camera_from_volume.translation,
            axes,
            in_layer,
            band_m: config.truncation_voxels * config.voxel_size_m,
        }
    }

    #[inline(always)]
    fn integrate(&self, block: &mut Block) {
        let corner = self.origin + self.axes * (block.at * BLOCK_SIDE as i32).as_vec3();
        for (z, layer) in block.layers.iter_mut().enumerate() {
            self.integrate_layer(layer, corner + self.axes.z_axis * z as f32);
        }
    }

    /// Step by step over the whole layer: each step is a loop that the compiler does several voxels of at a time.
    #[inline(always)]
    fn integrate_layer(&self, layer: &mut VoxelLayer, corner: Vec3) {
        let [mut x, mut y, mut z] = self.in_layer;
        for i in 0..LAYER {
            x[i] += corner.x;
            y[i] += corner.y;
            z[i] += corner.z;
        }
        let pixels = self.pixels(&[x, y, z]);
        let mut planes = [[0.0; 4]; LAYER];
        let mut weight = [0.0; LAYER];
        let seen = &self.seen.planes[..];
        let seen_weights = &self.seen.weights[..seen.len()];
        for i in 0..LAYER {
            let pixel = pixels[i] as usize;
            planes[i] = seen[pixel].to_array();
            weight[i] = seen_weights[pixel];
        }
        let mut distance_m = [0.0; LAYER];
        for i in 0..LAYER {
            let [a, b, c, offset_m] = planes[i];
            distance_m[i] = a * x[i] + b * y[i] + c * z[i] - offset_m;
        }
        for i in 0..LAYER {
            // Behind the surface by more than the band nothing is known.
            let weight = if distance_m[i] >= -self.band_m {
                weight[i]
            } else {
                0.0
            };
            let clamped_m = if distance_m[i] < self.band_m {
                distance_m[i]
            } else {
                self.band_m
            };
            let total = layer.weight[i] + weight;
            // Of nothing at all stays nothing.
            let share = weight / if total > 0.0 { total } else { 1.0 };
            layer.distance_m[i] += (clamped_m - layer.distance_m[i]) * share;
            layer.weight[i] = if total < self.config.max_weight {
                total
            } else {
                self.config.max_weight
            };
        }
    }

    /// The numbers of the pixels that places fall on; of a place that is not seen, that of the last one, which nothing
    /// is seen at.
    #[inline(always)]
    fn pixels(&self, places: &[Lanes; 3]) -> [u32; LAYER] {
        let Intrinsics { fx, fy, cx, cy, .. } = self.camera.intrinsics;
        let ([x, y, z], [left, top]) = (places, self.corner);
        let (mut u, mut v) = ([0.0; LAYER], [0.0; LAYER]);
        if self.camera.distortion == Distortion::None {
            for i in 0..LAYER {
                let by_depth = 1.0 / z[i];
                u[i] = fx * x[i] * by_depth + (cx - left);
                v[i] = fy * y[i] * by_depth + (cy - top);
            }
        } else {
            for i in 0..LAYER {
                let pixel = self.camera.project(Vec3::new(x[i], y[i], z[i]));
                (u[i], v[i]) = (pixel.x - left, pixel.y - top);
            }
        }
        let [columns, rows] = [self.seen.columns as u32, self.rows];
        let nothing = self.seen.nothing();
        let mut pixels = [0; LAYER];
        for i in 0..LAYER {
            // Left of the picture and above it is far right and below as well.
            let (column, row) = (nearest_whole(u[i]) as u32, nearest_whole(v[i]) as u32);
            let inside =
                u32::from(z[i] > 0.0) & u32::from(column < columns) & u32::from(row < rows);
            // Bits instead of a choice, which becomes a branch for each voxel.
            let mask = inside.wrapping_neg();
            let pixel = row.wrapping_mul(columns).wrapping_add(column);
            pixels[i] = (pixel & mask) | (nothing & !mask);
        }
        pixels
    }
}
