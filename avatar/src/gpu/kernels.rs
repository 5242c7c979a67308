//! The compiled kernels for fields of one width.

use super::{device::Gpu, error::GpuError};

const SHARED: &str = include_str!("shared.wgsl");
pub(super) const SINE: &str = include_str!("sine.wgsl");
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

/// How many vertices a workgroup takes to the zero level together.
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

    fn source(self) -> &'static str {
        match self {
            Self::Of16 => include_str!("tile_of_16.wgsl"),
            Self::Of8 => include_str!("tile_of_8.wgsl"),
        }
    }

    /// What `project.wgsl` keeps in a workgroup: activations, points, parts of sums, flags and their count.
    fn workgroup_bytes(self, hidden: u32) -> u32 {
        let points = self.points();
        4 * (hidden * points + 4 * points + hidden + points) + 16
    }

    /// The larger one that fits.
    pub(super) fn for_width(hidden: u32, allowed_bytes: u32) -> Option<Self> {
        let fits = |tile: &Self| tile.workgroup_bytes(hidden) <= allowed_bytes;
        [Self::Of16, Self::Of8].into_iter().find(fits)
    }
}

impl Kernels {
    pub(super) fn new(gpu: &Gpu, hidden: usize) -> Result<Self, GpuError> {
        let limits = gpu.device.limits();
        let width = hidden as u32;
        let invocations = limits
            .max_compute_invocations_per_workgroup
            .min(limits.max_compute_workgroup_size_x);
        let storage_bytes = limits.max_compute_workgroup_storage_size;
        let tile = Tile::for_width(width, storage_bytes);
        for (what, needed, allowed) in [
            (
                "invocations in a workgroup",
                width.max(SKIN_GROUP),
                invocations,
            ),
            (
                "storage buffers for a shader",
                STORAGE_BUFFERS,
                limits.max_storage_buffers_per_shader_stage,
            ),
            (
                "bytes of a workgroup's own memory",
                Tile::Of8.workgroup_bytes(width),
                storage_bytes,
            ),
        ] {
            at_most(gpu, what, u64::from(needed), u64::from(allowed))?;
        }
        let tile = tile.unwrap_or(Tile::Of8);
        let layout = bind_group_layout(&gpu.device);
        let project = format!(
            "const HIDDEN = {hidden}u;\n{SHARED}{SINE}{}{PROJECT}",
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

fn bind_group_layout(device: &wgpu::Device) -> wgpu::BindGroupLayout {
    let read = wgpu::BufferBindingType::Storage { read_only: true };
    let written = wgpu::BufferBindingType::Storage { read_only: false };
    let types = [wgpu::BufferBindingType::Uniform, read, read, written, read];
    let entries: Vec<_> = (0..)
        .zip(types)
        .map(|(binding, ty)| entry(binding, ty))
        .collect();
    device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
        label: Some("drive"),
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
