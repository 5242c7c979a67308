//! Adds a depth map to a volume.

use effigy_capture::{CameraModel, Distortion, Intrinsics};
use glam::{IVec3, Mat3, Vec3, ivec3};
use rayon::prelude::*;

use super::{
    DepthView, TsdfConfig, TsdfVolume,
    block::{BLOCK_SIDE, Block, VOXELS},
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
        self.touch_blocks(view, &weight);
        let projection = Projection::new(view, &self.config);
        self.blocks
            .par_iter_mut()
            .filter(|block| block.in_view)
            .for_each(|block| projection.integrate(block, &weight));
    }

    /// Makes the blocks within the truncation of a measured point, and marks them.
    fn touch_blocks(&mut self, view: &DepthView<'_>, weight: &(impl Fn(usize) -> f32 + Sync)) {
        for block in &mut self.blocks {
            block.in_view = false;
        }
        let width = view.points.width;
        let near_rows: Vec<Vec<IVec3>> = (0..view.points.height)
            .into_par_iter()
            .with_min_len(16)
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
    let band_m = config.truncation_voxels * config.voxel_size_m;
    let blocks_per_m = 1.0 / (BLOCK_SIDE as f32 * config.voxel_size_m);
    let steps = (2.0 * band_m * blocks_per_m / 0.5).ceil() as usize;
    let mut blocks: Vec<IVec3> = Vec::new();
    for pixel in pixels {
        let point = view.points.points[pixel];
        let weight = weight(pixel);
        if point.z.is_nan() || weight.is_nan() || weight <= 0.0 {
            continue;
        }
        let along = point.normalize_or_zero();
        for step in 0..=steps {
            let offset_m = band_m * (2.0 * step as f32 / steps as f32 - 1.0);
            let sample = view.volume_from_camera * (point + offset_m * along);
            let block = floor(sample * blocks_per_m);
            if !blocks[blocks.len().saturating_sub(8)..].contains(&block) {
                blocks.push(block);
            }
        }
    }
    blocks
}

/// Rounded down; the library's own is a call for each component on processors without the instruction.
fn floor(at: Vec3) -> IVec3 {
    let toward_zero = at.as_ivec3();
    let above = at.cmplt(toward_zero.as_vec3());
    toward_zero - ivec3(above.x.into(), above.y.into(), above.z.into())
}

/// A view, as a block's voxels need it.
struct Projection<'a> {
    view: &'a DepthView<'a>,
    config: &'a TsdfConfig,
    /// In camera space, the volume's origin and one voxel along each axis.
    origin: Vec3,
    axes: Mat3,
    band_m: f32,
}

impl<'a> Projection<'a> {
    fn new(view: &'a DepthView<'a>, config: &'a TsdfConfig) -> Self {
        let camera_from_volume = view.volume_from_camera.inverse();
        Self {
            view,
            config,
            origin: camera_from_volume.translation,
            axes: camera_from_volume.rotation_matrix() * config.voxel_size_m,
            band_m: config.truncation_voxels * config.voxel_size_m,
        }
    }

    fn integrate(&self, block: &mut Block, weight: &(impl Fn(usize) -> f32 + Sync)) {
        let corner = self.origin + self.axes * (block.at * BLOCK_SIDE as i32).as_vec3();
        let rows: &mut [[_; BLOCK_SIDE]] = block.voxels.as_chunks_mut().0;
        debug_assert_eq!(rows.len() * BLOCK_SIDE, VOXELS);
        for (number, row) in rows.iter_mut().enumerate() {
            let (y, z) = ((number % BLOCK_SIDE) as f32, (number / BLOCK_SIDE) as f32);
            let start = corner + self.axes.y_axis * y + self.axes.z_axis * z;
            let places = Places::along(start, self.axes.x_axis);
            let pixels = places.pixels(self.view.camera);
            for (x, (voxel, &pixel)) in row.iter_mut().zip(&pixels).enumerate() {
                if pixel == NO_PIXEL {
                    continue;
                }
                let pixel = pixel as usize;
                let Some(distance_m) = self.distance_m(places.at(x), pixel) else {
                    continue;
                };
                let weight = weight(pixel);
                // Behind the surface by more than the band nothing is known.
                if distance_m < -self.band_m || weight.is_nan() || weight <= 0.0 {
                    continue;
                }
                let total = voxel.weight + weight;
                let clamped_m = distance_m.min(self.band_m);
                voxel.distance_m += (clamped_m - voxel.distance_m) * (weight / total);
                voxel.weight = total.min(self.config.max_weight);
            }
        }
    }

    /// How far in front of the surface at a pixel a place is.
    #[inline]
    fn distance_m(&self, place: Vec3, pixel: usize) -> Option<f32> {
        let surface = self.view.points.points[pixel];
        if surface.z.is_nan() {
            return None;
        }
        let normal = self
            .view
            .normals
            .map_or(Vec3::NAN, |normals| normals.normals[pixel]);
        if normal.x.is_nan() {
            return Some((surface.z - place.z) * place.length() / place.z);
        }
        Some(normal.dot(place - surface))
    }
}

/// Not in the picture.
const NO_PIXEL: u32 = u32::MAX;

/// A row of voxels in camera space, axis by axis: so the compiler handles several at once.
struct Places {
    x: [f32; BLOCK_SIDE],
    y: [f32; BLOCK_SIDE],
    z: [f32; BLOCK_SIDE],
}

impl Places {
    #[inline]
    fn along(start: Vec3, step: Vec3) -> Self {
        let axis = |start: f32, step: f32| std::array::from_fn(|i| start + step * i as f32);
        Self { x: axis(start.x, step.x), y: axis(start.y, step.y), z: axis(start.z, step.z) }
    }

    #[inline]
    fn at(&self, i: usize) -> Vec3 {
        Vec3::new(self.x[i], self.y[i], self.z[i])
    }

    /// The numbers of the pixels they fall on.
    #[inline]
    fn pixels(&self, camera: &CameraModel) -> [u32; BLOCK_SIDE] {
        let Intrinsics { width, height, fx, fy, cx, cy } = camera.intrinsics;
        let (mut x, mut y) = ([0.0; BLOCK_SIDE], [0.0; BLOCK_SIDE]);
        if camera.distortion == Distortion::None {
            for i in 0..BLOCK_SIDE {
                let by_depth = 1.0 / self.z[i];
                x[i] = fx * self.x[i] * by_depth + (cx + 0.5);
                y[i] = fy * self.y[i] * by_depth + (cy + 0.5);
            }
        } else {
            for i in 0..BLOCK_SIDE {
                [x[i], y[i]] = (camera.project(self.at(i)) + 0.5).to_array();
            }
        }
        let (right, bottom) = (width as f32, height as f32);
        std::array::from_fn(|i| {
            // Truncation rounds down what is not negative.
            let inside =
                self.z[i] > 0.0 && x[i] >= 0.0 && y[i] >= 0.0 && x[i] < right && y[i] < bottom;
            if inside {
                (y[i] as i32 as u32) * width + (x[i] as i32 as u32)
            } else {
                NO_PIXEL
            }
        })
    }
}
