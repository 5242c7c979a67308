//! Loss and parameter gradients on a device: two sweeps of shaders, the loss between them on the processor.
//!
//! The twin of [`FieldGradients`](crate::sdf::batch::FieldGradients). A step takes fields and points up, each point's
//! value and gradient down, the loss's derivatives by them up, and gradients by the parameters down: 5 MB in all at the
//! live size, of which the fields are 3, with their weights once more turned.

use std::sync::Arc;

use glam::Vec3;
use rayon::prelude::*;

use super::{
    buffers::{self, buffer},
    device::Gpu,
    error::GpuError,
    kernels::{self, LAYER, SINE, Tile, at_most, bind_group_layout, pipeline},
    layout::{self, BatchBlock},
};
use crate::sdf::{
    SirenConfig,
    batch::FieldFrame,
    loss::{LossConfig, LossTerms, Scale, point_loss},
};

const TAPE: &str = include_str!("tape.wgsl");
const SWEEPS: &str = include_str!("sweeps.wgsl");
const SUMS: &str = include_str!("sums.wgsl");

/// Numbers of a point: three coordinates and a one, gradient and value, and the loss's derivatives by these.
const OF_A_POINT: usize = 4;
const A_POINT_BYTES: u64 = size_of::<[f32; OF_A_POINT]>() as u64;
/// What a unit of a sine layer leaves on the tape: `KINDS` in `tape.wgsl`.
const KINDS: usize = 5;
/// Rows and columns of a weight that a workgroup of `hidden_weights` takes, four by four an invocation.
const BLOCK: u32 = 32;
const SIDE: u32 = BLOCK / 4;
/// Units of which such a workgroup keeps a tile: rows and columns twice.
const FACTORS: u32 = 4 * BLOCK;
/// What the shaders bind beside their uniform.
const STORAGE_BUFFERS: u32 = 3;
/// Where all frames' tapes take more than that, frames are taken in turn.
const MOST_TAPE_BYTES: usize = 256 << 20;

/// The compiled kernels for fields of one width.
pub(super) struct LearnKernels {
    pub(super) hidden: usize,
    pub(super) tile: Tile,
    layout: wgpu::BindGroupLayout,
    forward: wgpu::ComputePipeline,
    backward: wgpu::ComputePipeline,
    hidden_weights: wgpu::ComputePipeline,
    other_parameters: wgpu::ComputePipeline,
}

/// Loss and gradients of frames with a field each, as the processor's
/// [`FieldGradients`](crate::sdf::batch::FieldGradients) gives them.
pub struct GpuGradients {
    gpu: Arc<Gpu>,
    config: SirenConfig,
    pub(super) kernels: Arc<LearnKernels>,
    buffers: Option<Buffers>,
    pub(super) most_tape_bytes: usize,
    /// Fields as they go up, [frames].
    packed: Vec<Vec<f32>>,
    /// Points as they go up, then the loss's derivatives at each.
    of_points: Vec<[f32; OF_A_POINT]>,
    /// [frames][parameters]
    gradients: Vec<Vec<f32>>,
}

/// Frames that are taken together, and tiles of each.
#[derive(Clone, Copy, PartialEq, Eq)]
struct Size {
    frames: usize,
    tiles: usize,
    tile_points: usize,
}

impl Size {
    /// Of all frames, tiles filled.
    fn points(self) -> usize {
        self.frames * self.points_a_frame()
    }

    fn points_a_frame(self) -> usize {
        self.tiles * self.tile_points
    }
}

struct Buffers {
    size: Size,
    block: BatchBlock,
    field: wgpu::Buffer,
    found: wgpu::Buffer,
    /// What was found where the processor can read it: points, then gradients.
    points: wgpu::Buffer,
    gradients: wgpu::Buffer,
    bindings: wgpu::BindGroup,
}

impl GpuGradients {
    /// Refuses fields that the kernels do not know, and devices that are too small.
    pub fn new(gpu: &Arc<Gpu>, config: SirenConfig) -> Result<Self, GpuError> {
        kernels::can_evaluate(config)?;
        gpu.check()?;
        Ok(Self {
            kernels: gpu.learn_kernels(config.hidden)?,
            gpu: Arc::clone(gpu),
            config,
            buffers: None,
            most_tape_bytes: MOST_TAPE_BYTES,
            packed: Vec::new(),
            of_points: Vec::new(),
            gradients: Vec::new(),
        })
    }

    pub fn gpu(&self) -> &Gpu {
        &self.gpu
    }

    /// The loss over all frames; leaves each frame's gradient in [`Self::frame`]. After an error this is of no use any
    /// more, nor is its device unless it was too small.
    pub fn compute(
        &mut self,
        frames: &[FieldFrame<'_>],
        loss: &LossConfig,
    ) -> Result<LossTerms, GpuError> {
        let computed = self.computed(frames, loss);
        computed.inspect_err(|error| {
            if !matches!(error, GpuError::Limit { .. }) {
                self.gpu.remember(error);
            }
        })
    }

    /// The loss's gradient by a frame's parameters, after [`Self::compute`].
    pub fn frame(&self, frame: usize) -> &[f32] {
        &self.gradients[frame]
    }

    fn computed(
        &mut self,
        frames: &[FieldFrame<'_>],
        loss: &LossConfig,
    ) -> Result<LossTerms, GpuError> {
        let scale = Scale::of(frames.iter().flat_map(|frame| frame.known));
        self.gradients.resize_with(frames.len(), Vec::new);
        let size = self.size_for(frames)?;
        let buffers = match self.buffers.take() {
            Some(buffers) if buffers.size == size => buffers,
            _ => Buffers::new(&self.gpu, &self.kernels.layout, self.config, size)?,
        };
        let mut terms = LossTerms::default();
        for (number, frames) in frames.chunks(size.frames).enumerate() {
            terms +=
                self.compute_together(&buffers, number * size.frames, frames, (loss, scale))?;
        }
        self.buffers = Some(buffers);
        Ok(terms)
    }

    /// As many frames at a time as their tapes leave room for.
    fn size_for(&self, frames: &[FieldFrame<'_>]) -> Result<Size, GpuError> {
        let tile_points = self.kernels.tile.points() as usize;
        let most_points = frames.iter().map(|frame| frame.points.len()).max();
        let tiles = most_points.unwrap_or(0).div_ceil(tile_points).max(1);
        let one = Size { frames: 1, tiles, tile_points };
        let tape_bytes = tape_bytes(self.config, one) as u64;
        let allowed = buffers::most_bytes(&self.gpu);
        at_most(&self.gpu, "bytes in a buffer", tape_bytes, allowed)?;
        let groups = self
            .gpu
            .device
            .limits()
            .max_compute_workgroups_per_dimension;
        at_most(&self.gpu, "workgroups", tiles as u64, u64::from(groups))?;
        let together = (allowed.min(self.most_tape_bytes as u64) / tape_bytes).max(1) as usize;
        Ok(Size { frames: together.min(frames.len()).max(1), ..one })
    }

    fn compute_together(
        &mut self,
        buffers: &Buffers,
        first: usize,
        frames: &[FieldFrame<'_>],
        (loss, scale): (&LossConfig, Scale),
    ) -> Result<LossTerms, GpuError> {
        self.upload(buffers, frames);
        let found = self.sweep_forward(buffers, frames.len())?;
        let a_frame = buffers.size.points_a_frame();
        self.of_points.fill([0.0; OF_A_POINT]);
        let terms: Vec<(LossTerms, f32)> = frames
            .par_iter()
            .zip(found.par_chunks(a_frame))
            .zip(self.of_points.par_chunks_mut(a_frame))
            .map(|((frame, found), bars)| frame_loss(loss, scale, frame, found, bars))
            .collect();
        let gradients = &mut self.gradients[first..][..frames.len()];
        let device = (&*self.gpu, &*self.kernels);
        sweep_backward(device, buffers, &self.of_points, gradients)?;
        let mut sum = LossTerms::default();
        for ((terms, value_bars), gradient) in terms.into_iter().zip(gradients) {
            sum += terms;
            // The last bias is added to every value.
            if let Some(last) = gradient.last_mut() {
                *last = value_bars;
            }
        }
        Ok(sum)
    }

    fn upload(&mut self, buffers: &Buffers, frames: &[FieldFrame<'_>]) {
        let (size, config) = (buffers.size, self.config);
        self.packed.resize_with(size.frames, Vec::new);
        self.of_points.clear();
        self.of_points.resize(size.points(), [0.0, 0.0, 0.0, 1.0]);
        let places = self.of_points.par_chunks_mut(size.points_a_frame());
        frames
            .par_iter()
            .zip(self.packed.par_iter_mut().zip(places))
            .for_each(|(frame, (packed, places))| {
                packed.clear();
                layout::pack_for_learning(config, frame.parameters, packed);
                for (place, point) in places.iter_mut().zip(frame.points) {
                    *place = point.extend(1.0).to_array();
                }
            });
        let queue = &self.gpu.queue;
        let field_bytes = u64::from(buffers.block.field_len) * A_POINT_BYTES;
        for (number, packed) in (0..).zip(&self.packed[..frames.len()]) {
            let at = number * field_bytes;
            queue.write_buffer(&buffers.field, at, bytemuck::cast_slice(packed));
        }
        let points_at = u64::from(buffers.block.points_at) * A_POINT_BYTES;
        queue.write_buffer(
            &buffers.field,
            points_at,
            bytemuck::cast_slice(&self.of_points),
        );
    }

    /// Each point's gradient and value.
    fn sweep_forward(
        &self,
        buffers: &Buffers,
        frames: usize,
    ) -> Result<Vec<[f32; OF_A_POINT]>, GpuError> {
        let mut encoder = encoder(&self.gpu);
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
        pass.set_bind_group(0, &buffers.bindings, &[]);
        pass.set_pipeline(&self.kernels.forward);
        pass.dispatch_workgroups(buffers.size.tiles as u32, frames as u32, 1);
        drop(pass);
        let Buffers { found, points, .. } = buffers;
        encoder.copy_buffer_to_buffer(found, 0, points, 0, points.size());
        let submission = self.gpu.queue.submit([encoder.finish()]);
        buffers::read_back(&self.gpu, points, submission, bytemuck::pod_collect_to_vec)
    }
}

/// A frame's loss, its derivatives at each point, and the sum of those by the value.
fn frame_loss(
    loss: &LossConfig,
    scale: Scale,
    frame: &FieldFrame<'_>,
    found: &[[f32; OF_A_POINT]],
    bars: &mut [[f32; OF_A_POINT]],
) -> (LossTerms, f32) {
    let mut sum = LossTerms::default();
    let mut value_bars = 0.0;
    for ((&[x, y, z, value], known), bars) in found.iter().zip(frame.known).zip(bars) {
        let gradient = Vec3::new(x, y, z);
        let (terms, value_bar, gradient_bar) = point_loss(loss, scale, known, value, gradient);
        sum += terms;
        value_bars += value_bar;
        *bars = gradient_bar.extend(value_bar).to_array();
    }
    (sum, value_bars)
}

fn sweep_backward(
    (gpu, kernels): (&Gpu, &LearnKernels),
    buffers: &Buffers,
    bars: &[[f32; OF_A_POINT]],
    gradients: &mut [Vec<f32>],
) -> Result<(), GpuError> {
    let Buffers { size, found, gradients: readable, block, .. } = buffers;
    let bars_at = u64::from(block.bars_at) * A_POINT_BYTES;
    gpu.queue
        .write_buffer(&buffers.field, bars_at, bytemuck::cast_slice(bars));
    let mut encoder = encoder(gpu);
    let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
    pass.set_bind_group(0, &buffers.bindings, &[]);
    let frames = gradients.len() as u32;
    pass.set_pipeline(&kernels.backward);
    pass.dispatch_workgroups(size.tiles as u32, frames, 1);
    let hidden_layers = block.sines - 1;
    if hidden_layers > 0 {
        let blocks = (kernels.hidden as u32).div_ceil(BLOCK);
        pass.set_pipeline(&kernels.hidden_weights);
        pass.dispatch_workgroups(blocks * blocks, hidden_layers, frames);
    }
    pass.set_pipeline(&kernels.other_parameters);
    pass.dispatch_workgroups(block.sines + 1, frames, 1);
    drop(pass);
    let points_bytes = size.points() as u64 * A_POINT_BYTES;
    encoder.copy_buffer_to_buffer(found, points_bytes, readable, 0, readable.size());
    let submission = gpu.queue.submit([encoder.finish()]);
    let parameters = block.parameters as usize;
    let are_numbers = buffers::read_back(gpu, readable, submission, |bytes| {
        let frames = bytes.chunks_exact(parameters * size_of::<f32>());
        let mut are_numbers = true;
        for (gradient, bytes) in gradients.iter_mut().zip(frames) {
            gradient.resize(parameters, 0.0);
            bytemuck::cast_slice_mut(gradient).copy_from_slice(bytes);
            // The last bias is the processor's.
            are_numbers &= gradient[..parameters - 1].iter().all(|x| x.is_finite());
        }
        are_numbers
    })?;
    if are_numbers {
        Ok(())
    } else {
        // The loss, from the sweep forward, may look well.
        Err(gpu.failed(&"a gradient is no number"))
    }
}

fn encoder(gpu: &Gpu) -> wgpu::CommandEncoder {
    let descriptor = wgpu::CommandEncoderDescriptor { label: Some("learn") };
    gpu.device.create_command_encoder(&descriptor)
}

impl LearnKernels {
    pub(super) fn new(gpu: &Gpu, hidden: usize) -> Result<Self, GpuError> {
        let width = hidden as u32;
        let needed = |tile| workgroup_bytes(tile, width);
        let invocations = width.max(SIDE * SIDE);
        let tile = kernels::fitting_tile(gpu, (invocations, STORAGE_BUFFERS), needed)?;
        Self::with_tile(gpu, hidden, tile)
    }

    pub(super) fn with_tile(gpu: &Gpu, hidden: usize, tile: Tile) -> Result<Self, GpuError> {
        let layout = bind_group_layout(&gpu.device, "learn", &[false, true, true]);
        let head = format!(
            "const HIDDEN = {hidden}u;\nconst BLOCK = {BLOCK}u;\nconst SIDE = {SIDE}u;\nconst FACTORS = {FACTORS}u;\n{}{TAPE}{SINE}{LAYER}",
            tile.source()
        );
        let made = |name, of| pipeline(&gpu.device, &layout, (name, &format!("{head}{of}")));
        let kernels = Self {
            hidden,
            tile,
            forward: made("forward", SWEEPS),
            backward: made("backward", SWEEPS),
            hidden_weights: made("hidden_weights", SUMS),
            other_parameters: made("other_parameters", SUMS),
            layout,
        };
        gpu.check()?;
        Ok(kernels)
    }
}

/// What the kernels keep in a workgroup: activations, points and parts, or factors.
fn workgroup_bytes(tile: Tile, hidden: u32) -> u32 {
    let points = tile.points();
    let of_sweeps = hidden * points + 4 * points + 4 * hidden;
    4 * of_sweeps.max(FACTORS * points)
}

fn tape_bytes(config: SirenConfig, size: Size) -> usize {
    let numbers = size.points() * (config.layers - 1) * KINDS * config.hidden;
    numbers * size_of::<f32>()
}

fn batch_block(config: SirenConfig, size: Size) -> BatchBlock {
    let field_len = layout::packed_for_learning_len(config) / 4;
    let points_at = field_len * size.frames;
    BatchBlock {
        tiles: size.tiles as u32,
        sines: (config.layers - 1) as u32,
        field_len: field_len as u32,
        points_at: points_at as u32,
        bars_at: (points_at + size.points()) as u32,
        parameters: config.parameter_count() as u32,
        gradients_at: (OF_A_POINT * size.points()) as u32,
        unused: 0,
    }
}

impl Buffers {
    fn new(
        gpu: &Gpu,
        layout: &wgpu::BindGroupLayout,
        config: SirenConfig,
        size: Size,
    ) -> Result<Self, GpuError> {
        use wgpu::BufferUsages as Usage;
        let number = size_of::<f32>();
        let block = batch_block(config, size);
        let points_bytes = size.points() * OF_A_POINT * number;
        let gradients_bytes = size.frames * config.parameter_count() * number;
        let field_bytes = (block.bars_at as usize + size.points()) * 4 * number;
        let found_bytes = points_bytes + gradients_bytes;
        for bytes in [field_bytes, found_bytes] {
            at_most(
                gpu,
                "bytes in a buffer",
                bytes as u64,
                buffers::most_bytes(gpu),
            )?;
        }
        let made = |label, bytes, usage| buffer(&gpu.device, label, bytes, usage);
        let batch = made(
            "batch",
            size_of::<BatchBlock>(),
            Usage::UNIFORM | Usage::COPY_DST,
        );
        let field = made(
            "fields and points",
            field_bytes,
            Usage::STORAGE | Usage::COPY_DST,
        );
        let tape = made("tape", tape_bytes(config, size), Usage::STORAGE);
        let found = made("found", found_bytes, Usage::STORAGE | Usage::COPY_SRC);
        let readable = Usage::MAP_READ | Usage::COPY_DST;
        let points = made("points, readable", points_bytes, readable);
        let gradients = made("gradients, readable", gradients_bytes, readable);
        // What could not be made must not be written to.
        gpu.check()?;
        gpu.queue
            .write_buffer(&batch, 0, bytemuck::bytes_of(&block));
        let bindings = buffers::bound(
            &gpu.device,
            "learn",
            layout,
            &[&batch, &field, &tape, &found],
        );
        Ok(Self { size, block, field, found, points, gradients, bindings })
    }
}
