//! Adds a depth map to a volume.

use effigy_capture::Intrinsics;
use glam::{IVec3, Vec2, Vec3, vec2};
use rayon::prelude::*;

use super::{
    DepthView, TsdfConfig, TsdfVolume,
    block::{BLOCK_SIDE, Block, block_of},
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
            [view.depth.width, view.depth.height],
            [width as usize, height as usize]
        );
        self.touch_blocks(view, &weight);
        let config = &self.config;
        self.blocks
            .par_iter_mut()
            .filter(|block| block.in_view)
            .for_each(|block| integrate_block(block, view, config, &weight));
    }

    /// Makes the blocks within the truncation of a measured point, and marks them.
    fn touch_blocks(&mut self, view: &DepthView<'_>, weight: &(impl Fn(usize) -> f32 + Sync)) {
        for block in &mut self.blocks {
            block.in_view = false;
        }
        let width = view.depth.width;
        let near_rows: Vec<Vec<IVec3>> = (0..view.depth.height)
            .into_par_iter()
            .map(|y| blocks_along_row(view, y * width..(y + 1) * width, &self.config, weight))
            .collect();
        for at in near_rows.into_iter().flatten() {
            let next = self.blocks.len() as u32;
            let index = *self.index_of.entry(at).or_insert(next);
            if index == next {
                self.blocks.push(Block::new(at));
            }
            self.blocks[index as usize].in_view = true;
        }
    }
}

/// The blocks near the points of one row, most repetitions left out.
fn blocks_along_row(
    view: &DepthView<'_>,
    pixels: std::ops::Range<usize>,
    config: &TsdfConfig,
    weight: &(impl Fn(usize) -> f32 + Sync),
) -> Vec<IVec3> {
    let width = view.depth.width;
    let band_m = config.truncation_voxels * config.voxel_size_m;
    let block_m = BLOCK_SIDE as f32 * config.voxel_size_m;
    let steps = (2.0 * band_m / (0.5 * block_m)).ceil() as usize;
    let mut blocks: Vec<IVec3> = Vec::new();
    for pixel in pixels {
        let depth_m = view.depth.metres[pixel];
        if depth_m.is_nan() || weight(pixel) <= 0.0 {
            continue;
        }
        let at = vec2((pixel % width) as f32, (pixel / width) as f32);
        let point = view.camera.unproject(at, depth_m);
        let along = point.normalize_or_zero();
        for step in 0..=steps {
            let offset_m = band_m * (2.0 * step as f32 / steps as f32 - 1.0);
            let sample = view.volume_from_camera * (point + offset_m * along);
            let block = block_of((sample / config.voxel_size_m).floor().as_ivec3());
            if !blocks[blocks.len().saturating_sub(8)..].contains(&block) {
                blocks.push(block);
            }
        }
    }
    blocks
}

fn integrate_block(
    block: &mut Block,
    view: &DepthView<'_>,
    config: &TsdfConfig,
    weight: &(impl Fn(usize) -> f32 + Sync),
) {
    let camera_from_volume = view.volume_from_camera.inverse();
    let rotation = camera_from_volume.rotation_matrix();
    let band_m = config.truncation_voxels * config.voxel_size_m;
    for index in 0..block.voxels.len() {
        let point = block.grid_point(index).as_vec3() * config.voxel_size_m;
        let point = rotation * point + camera_from_volume.translation;
        let Some(pixel) = pixel_of(point, view) else {
            continue;
        };
        let Some(distance_m) = distance_m(point, pixel, view) else {
            continue;
        };
        let weight = weight(pixel);
        // Behind the surface by more than the band nothing is known.
        if distance_m < -band_m || weight.is_nan() || weight <= 0.0 {
            continue;
        }
        let voxel = &mut block.voxels[index];
        let total = voxel.weight + weight;
        let clamped_m = distance_m.min(band_m);
        voxel.distance_m += (clamped_m - voxel.distance_m) * (weight / total);
        voxel.weight = total.min(config.max_weight);
    }
}

fn pixel_of(point: Vec3, view: &DepthView<'_>) -> Option<usize> {
    if point.z <= 0.0 {
        return None;
    }
    let Vec2 { x, y } = view.camera.project(point).round();
    let (width, height) = (view.depth.width as f32, view.depth.height as f32);
    let inside = x >= 0.0 && y >= 0.0 && x < width && y < height;
    inside.then(|| y as usize * view.depth.width + x as usize)
}

/// How far in front of the surface at a pixel a point is.
fn distance_m(point: Vec3, pixel: usize, view: &DepthView<'_>) -> Option<f32> {
    let depth_m = view.depth.metres[pixel];
    if depth_m.is_nan() {
        return None;
    }
    let normal = view
        .normals
        .map_or(Vec3::NAN, |normals| normals.normals[pixel]);
    if normal.is_nan() {
        return Some((depth_m - point.z) * point.length() / point.z);
    }
    let width = view.depth.width;
    let surface = view.camera.unproject(
        vec2((pixel % width) as f32, (pixel / width) as f32),
        depth_m,
    );
    Some(normal.dot(point - surface))
}
