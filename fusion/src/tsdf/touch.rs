//! Which blocks a view reaches.
#![expect(
    clippy::inline_always,
    reason = "compiled anew for each vector unit, inside `simd::run`"
)]

use std::ops::Range;

use glam::{IVec3, Mat3, Vec3};
use rayon::prelude::*;

use super::{
    DepthView, TsdfConfig, TsdfVolume,
    block::{BLOCK_SIDE, Block},
};
use crate::{
    maps::Region,
    simd::{self, nearest_whole},
};

/// Pixels at once: a register of AVX-512.
const LANES: usize = 16;
/// Rows of pixels whose blocks are gathered by one task.
const ROWS_A_TASK: usize = 16;

impl TsdfVolume {
    /// Makes the blocks within the truncation of a measured point, and marks them; returns the pixels that count.
    pub(super) fn touch_blocks(
        &mut self,
        view: &DepthView<'_>,
        weight: &(impl Fn(usize) -> f32 + Sync),
    ) -> Region {
        for block in &mut self.blocks {
            block.in_view = false;
        }
        let (width, height) = (view.points.width, view.points.height);
        let reach = Reach::new(view, &self.config);
        let tasks: Vec<_> = (0..height.div_ceil(ROWS_A_TASK))
            .into_par_iter()
            .map(|task| {
                let rows = task * ROWS_A_TASK..((task + 1) * ROWS_A_TASK).min(height);
                reach.along_rows(view, rows, weight)
            })
            .collect();
        let mut pixels = Region { columns: width..0, rows: height..0 };
        for Touched { blocks, pixels: more } in tasks {
            pixels.columns = pixels.columns.start.min(more.columns.start)
                ..pixels.columns.end.max(more.columns.end);
            pixels.rows =
                pixels.rows.start.min(more.rows.start)..pixels.rows.end.max(more.rows.end);
            for at in blocks {
                let next = self.blocks.len() as u32;
                let index = *self.index_of.entry(at).or_insert(next);
                if index == next {
                    self.blocks.push(Block::new(at));
                }
                self.blocks[index as usize].in_view = true;
            }
        }
        pixels
    }
}

/// Where along a ray it is looked which blocks are there: before the point, at it, and behind it, near enough to each
/// other that none that the band meets is passed over.
struct Reach {
    /// Turns and scales from metres before the camera to blocks.
    blocks_from_camera: Mat3,
    origin: Vec3,
    offsets_m: Vec<f32>,
}

/// Blocks, each once, and the pixels that reach them.
struct Touched {
    blocks: Vec<IVec3>,
    pixels: Region,
}

impl Reach {
    fn new(view: &DepthView<'_>, config: &TsdfConfig) -> Self {
        let band_m = config.truncation_voxels * config.voxel_size_m;
        let blocks_per_m = 1.0 / (BLOCK_SIDE as f32 * config.voxel_size_m);
        let steps = (2.0 * band_m * blocks_per_m / 0.5).ceil().max(1.0);
        let offset_m = |step: usize| band_m * (2.0 * step as f32 / steps - 1.0);
        Self {
            blocks_from_camera: view.volume_from_camera.rotation_matrix() * blocks_per_m,
            origin: view.volume_from_camera.translation * blocks_per_m,
            offsets_m: (0..=steps as usize).map(offset_m).collect(),
        }
    }

    fn along_rows(
        &self,
        view: &DepthView<'_>,
        rows: Range<usize>,
        weight: &(impl Fn(usize) -> f32 + Sync),
    ) -> Touched {
        let width = view.points.width;
        let mut columns = width..0;
        let mut touched_rows = view.points.height..0;
        let mut blocks: Vec<IVec3> = Vec::new();
        // What the pixel before reached: mostly the same.
        let mut before = vec![[i32::MAX; 3]; self.offsets_m.len()];
        let mut noted = Noted::default();
        let mut reached = vec![[[0; LANES]; 3]; self.offsets_m.len()];
        for y in rows {
            let row = &view.points.points[y * width..][..width];
            for (first, points) in (0..).step_by(LANES).zip(row.chunks(LANES)) {
                let start = y * width + first;
                let mut has_say = [false; LANES];
                for (i, (point, has_say)) in points.iter().zip(&mut has_say).enumerate() {
                    *has_say = !point.z.is_nan() && counts(weight(start + i));
                }
                if !has_say.contains(&true) {
                    continue;
                }
                touched_rows = touched_rows.start.min(y)..y + 1;
                simd::run(
                    #[inline(always)]
                    || self.reach(points, &mut reached),
                );
                for i in (0..LANES).filter(|&i| has_say[i]) {
                    let x = first + i;
                    columns = columns.start.min(x)..columns.end.max(x + 1);
                    for (step, before) in reached.iter().zip(&mut before) {
                        let block = [step[0][i], step[1][i], step[2][i]];
                        let is_other = block != *before;
                        *before = block;
                        if is_other && noted.is_new(block) {
                            blocks.push(IVec3::from_array(block));
                        }
                    }
                }
            }
        }
        blocks.sort_unstable_by_key(IVec3::to_array);
        blocks.dedup();
        Touched { blocks, pixels: Region { columns, rows: touched_rows } }
    }

    /// The blocks that several points' bands are in, axis by axis.
    #[inline(always)]
    fn reach(&self, points: &[Vec3], reached: &mut [[[i32; LANES]; 3]]) {
        let mut place = [[0.0; LANES]; 3];
        for (i, point) in points.iter().enumerate() {
            for axis in 0..3 {
                place[axis][i] = point[axis];
            }
        }
        let [x, y, z] = &place;
        let mut per_length = [0.0; LANES];
        for i in 0..LANES {
            let length = (x[i] * x[i] + y[i] * y[i] + z[i] * z[i]).sqrt();
            // A point in the camera itself has no ray.
            per_length[i] = if length > 0.0 { 1.0 / length } else { 0.0 };
        }
        for axis in 0..3 {
            let turn = self.blocks_from_camera.row(axis);
            for (step, offset_m) in reached.iter_mut().zip(&self.offsets_m) {
                for i in 0..LANES {
                    let turned = turn.x * x[i] + turn.y * y[i] + turn.z * z[i];
                    let along = turned * per_length[i];
                    step[axis][i] = floor_whole(turned + self.origin[axis] + along * offset_m);
                }
            }
        }
    }
}

/// Which blocks came up lately: a direct-mapped cache, in which blocks that are a whole number of its sides apart share a
/// place. It may call a block new a second time, never one old that is new.
struct Noted([[i32; 3]; Self::SIDE.pow(3)]);

impl Noted {
    /// In blocks: a person's rows of pixels reach fewer along most axes.
    const SIDE: usize = 8;

    fn is_new(&mut self, block: [i32; 3]) -> bool {
        let [x, y, z] = block.map(|x| x as usize % Self::SIDE);
        let last = &mut self.0[(z * Self::SIDE + y) * Self::SIDE + x];
        let is_new = *last != block;
        *last = block;
        is_new
    }
}

impl Default for Noted {
    fn default() -> Self {
        Self([[i32::MAX; 3]; Self::SIDE.pow(3)])
    }
}

/// Whether a pixel of this weight has a say.
pub(super) fn counts(weight: f32) -> bool {
    weight > 0.0
}

/// Rounded down; a whole number may become the one below.
#[inline(always)]
fn floor_whole(value: f32) -> i32 {
    nearest_whole(value - 0.5)
}
