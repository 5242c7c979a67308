//! The compiled kernels for fields of one width.

use super::{device::Gpu, error::GpuError};
use crate::sdf::SirenConfig;

const SHARED: &str = include_str!("shared.wgsl");
pub(super) const SINE: &str = include_str!("sine.wgsl");
pub(super) const LAYER: &str = include_str!("layer.wgsl");
const PROJECT: &str = include_str!("project.wgsl");
const SKIN: &str = include_str!("skin.wgsl");
const NORMALS: &str = include_str!("normals.wgsl");

/// Invocations of a workgroup where a vertex needs one: a number in the shaders.
pub(super) const SKIN_GROUP: u32 = 64;

/// Uniform, then storage: what the shaders bind.
const STORAGE_BUFFERS: u32 = 4;

pub(super) struct Kernels {
    pub(super) hidden: usize,
    pub(super) tile: Tile,
    pub(super) layout: wgpu::BindGroupLayout,
    pub(super) project: wgpu::ComputePipeline,
    pub(super) skin: wgpu::ComputePipeline,
    pub(super) normals: wgpu::ComputePipeline,
}

/// How many points a workgroup takes through the field together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Tile {
    Of16,
    Of8,
}

impl Tile {
    pub(super) fn points(self) -> u32 {
        match self {
            Self::Of16 => 16,
            Self::Of8 => 8,
        }
    }

    pub(super) fn source(self) -> &'static str {
        match self {
            Self::Of16 => include_str!("tile_of_16.wgsl"),
            Self::Of8 => include_str!("tile_of_8.wgsl"),
        }
    }

    /// What `project.wgsl` keeps in a workgroup: activations, points, parts of sums, flags and their count.
    pub(super) fn workgroup_bytes(self, hidden: u32) -> u32 {
        let points = self.points();
        4 * (hidden * points + 4 * points + hidden + points) + 16
    }

    /// The larger one that takes no more than is allowed.
    pub(super) fn that_takes(bytes: impl Fn(Self) -> u32, allowed_bytes: u32) -> Option<Self> {
        [Self::Of16, Self::Of8]
            .into_iter()
            .find(|tile| bytes(*tile) <= allowed_bytes)
    }
}

impl Kernels {
    pub(super) fn new(gpu: &Gpu, hidden: usize) -> Result<Self, GpuError> {
        let width = hidden as u32;
        let needed = |tile: Tile| tile.workgroup_bytes(width);
        let invocations = width.max(SKIN_GROUP);
        let tile = fitting_tile(gpu, (invocations, STORAGE_BUFFERS), needed)?;
        let layout = bind_group_layout(&gpu.device, "drive", &[false, false, true, false]);
        let project = format!(
            "const HIDDEN = {hidden}u;\n{SHARED}{SINE}{}{LAYER}{PROJECT}",
            tile.source()
        );
        let kernels = Self {
            hidden,
            tile,
            project: pipeline(&gpu.device, &layout, ("project", &project)),
            skin: pipeline(&gpu.device, &layout, ("skin", &format!("{SHARED}{SKIN}"))),
            normals: pipeline(
                &gpu.device,
                &layout,
                ("normals", &format!("{SHARED}{NORMALS}")),
            ),
            layout,
        };
        gpu.check()?;
        Ok(kernels)
    }
}

/// The larger tile that leaves the adapter's limits alone; `needed` of a workgroup's own memory.
pub(super) fn fitting_tile(
    gpu: &Gpu,
    (invocations, storage_buffers): (u32, u32),
    needed: impl Fn(Tile) -> u32,
) -> Result<Tile, GpuError> {
    let limits = gpu.device.limits();
    let allowed_invocations = limits
        .max_compute_invocations_per_workgroup
        .min(limits.max_compute_workgroup_size_x);
    let allowed_bytes = limits.max_compute_workgroup_storage_size;
    for (what, needed, allowed) in [
        (
            "invocations in a workgroup",
            invocations,
            allowed_invocations,
        ),
        (
            "storage buffers for a shader",
            storage_buffers,
            limits.max_storage_buffers_per_shader_stage,
        ),
        (
            "bytes of a workgroup's own memory",
            needed(Tile::Of8),
            allowed_bytes,
        ),
    ] {
        at_most(gpu, what, u64::from(needed), u64::from(allowed))?;
    }
    Ok(Tile::that_takes(needed, allowed_bytes).unwrap_or(Tile::Of8))
}

/// Refuses fields of a shape that the kernels do not know.
pub(super) fn can_evaluate(config: SirenConfig) -> Result<(), GpuError> {
    // Each unit adds up the last layer's products of as many others as there are points in a tile.
    if config.layers < 2 || config.hidden == 0 || !config.hidden.is_multiple_of(16) {
        return Err(GpuError::FieldShape { config });
    }
    Ok(())
}

pub(super) fn at_most(
    gpu: &Gpu,
    what: &'static str,
    needed: u64,
    allowed: u64,
) -> Result<(), GpuError> {
    if needed <= allowed {
        return Ok(());
    }
    Err(GpuError::Limit { adapter: gpu.name().to_owned(), what, needed, allowed })
}

/// A uniform, then storage: written to where it says so.
pub(super) fn bind_group_layout(
    device: &wgpu::Device,
    label: &str,
    written: &[bool],
) -> wgpu::BindGroupLayout {
    let storage = written
        .iter()
        .map(|&written| wgpu::BufferBindingType::Storage { read_only: !written });
    let types = std::iter::once(wgpu::BufferBindingType::Uniform).chain(storage);
    let entries: Vec<_> = (0..)
        .zip(types)
        .map(|(binding, ty)| entry(binding, ty))
        .collect();
    device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
        label: Some(label),
        entries: &entries,
    })
}

pub(super) fn entry(binding: u32, ty: wgpu::BufferBindingType) -> wgpu::BindGroupLayoutEntry {
    wgpu::BindGroupLayoutEntry {
        binding,
        visibility: wgpu::ShaderStages::COMPUTE,
        ty: wgpu::BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None },
        count: None,
    }
}

/// `name` is that of the entry point, too.
pub(super) fn pipeline(
    device: &wgpu::Device,
    layout: &wgpu::BindGroupLayout,
    (name, source): (&str, &str),
) -> wgpu::ComputePipeline {
    let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: Some(name),
        source: wgpu::ShaderSource::Wgsl(source.into()),
    });
    let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label: Some(name),
        bind_group_layouts: &[Some(layout)],
        immediate_size: 0,
    });
    device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label: Some(name),
        layout: Some(&layout),
        module: &module,
        entry_point: Some(name),
        compilation_options: wgpu::PipelineCompilationOptions {
            // Everything is written before it is read.
            zero_initialize_workgroup_memory: false,
            ..wgpu::PipelineCompilationOptions::default()
        },
        cache: None,
    })
}
