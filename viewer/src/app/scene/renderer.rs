//! Draws one mesh and the floor with the graphics adapter.

use std::sync::Arc;

use bytemuck::{Pod, Zeroable};
use eframe::wgpu;
use glam::{Mat4, Vec3, Vec4, vec4};

use super::targets::{COLOR_FORMAT, DEPTH_FORMAT, SAMPLES, Targets};
use crate::pictures::{
    MeshView, PictureCamera,
    palette::{self, linear_from_srgb},
    shade::{FILL, GROUND, KEY, RIM, SKY, WRAP},
};

const NEAR_M: f32 = 0.05;
const FAR_M: f32 = 60.0;
const FLOOR_HALF_WIDTH_M: f32 = 5.0;

/// What of a view is not in its mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct SceneStyle {
    pub(super) albedo: [u8; 3],
    pub(super) floor: bool,
    /// 0 without anybody to cast one, 1 for a full shadow.
    pub(super) shadow: f32,
    /// Where the person stands; only x and z count.
    pub(super) stand: Vec3,
}

/// `Scene` in `scene.wgsl`, field by field.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct SceneUniform {
    clip_from_world: Mat4,
    camera_from_world: Mat4,
    camera_in_world: Vec4,
    albedo: Vec4,
    key_towards: Vec4,
    key_strength: Vec4,
    fill_towards: Vec4,
    fill_strength: Vec4,
    ground: Vec4,
    sky: Vec4,
    amounts: Vec4,
    stand: Vec4,
    line: Vec4,
    background: Vec4,
}

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct MeshVertex {
    position: Vec3,
    normal: Vec3,
    /// Alpha 0: the vertex has no colour of its own.
    color: [u8; 4],
}

pub(super) struct SceneRenderer {
    mesh_pipeline: wgpu::RenderPipeline,
    floor_pipeline: wgpu::RenderPipeline,
    uniform: wgpu::Buffer,
    bindings: wgpu::BindGroup,
    vertices: Option<wgpu::Buffer>,
    indices: Option<(Arc<Vec<[u32; 3]>>, wgpu::Buffer)>,
    staged: Vec<MeshVertex>,
}

impl SceneRenderer {
    pub(super) fn new(device: &wgpu::Device) -> Self {
        let shader = device.create_shader_module(wgpu::include_wgsl!("scene.wgsl"));
        let uniform = device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("scene"),
            size: size_of::<SceneUniform>() as u64,
            usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        let layout = bind_group_layout(device);
        let bindings = device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("scene"),
            layout: &layout,
            entries: &[wgpu::BindGroupEntry { binding: 0, resource: uniform.as_entire_binding() }],
        });
        Self {
            mesh_pipeline: mesh_pipeline(device, &layout, &shader),
            floor_pipeline: floor_pipeline(device, &layout, &shader),
            uniform,
            bindings,
            vertices: None,
            indices: None,
            staged: Vec::new(),
        }
    }

    /// Brings a mesh to the adapter; triangles only if they are not those already there.
    pub(super) fn upload(
        &mut self,
        device: &wgpu::Device,
        queue: &wgpu::Queue,
        mesh: MeshView<'_>,
        triangles: &Arc<Vec<[u32; 3]>>,
    ) {
        self.stage(mesh);
        let bytes: &[u8] = bytemuck::cast_slice(&self.staged);
        let fits = self
            .vertices
            .as_ref()
            .is_some_and(|b| b.size() == bytes.len() as u64);
        if !fits {
            let usage = wgpu::BufferUsages::VERTEX;
            self.vertices = Some(buffer(device, "vertices", bytes.len(), usage));
        }
        if let Some(vertices) = &self.vertices {
            queue.write_buffer(vertices, 0, bytes);
        }
        let same = self
            .indices
            .as_ref()
            .is_some_and(|(old, _)| Arc::ptr_eq(old, triangles));
        if !same {
            let bytes: &[u8] = bytemuck::cast_slice(triangles);
            let indices = buffer(device, "triangles", bytes.len(), wgpu::BufferUsages::INDEX);
            queue.write_buffer(&indices, 0, bytes);
            self.indices = Some((Arc::clone(triangles), indices));
        }
    }

    /// Draws what was uploaded last into the targets.
    pub(super) fn draw(
        &self,
        device: &wgpu::Device,
        queue: &wgpu::Queue,
        targets: &Targets,
        (camera, style): (&PictureCamera, SceneStyle),
    ) {
        queue.write_buffer(
            &self.uniform,
            0,
            bytemuck::bytes_of(&uniform(camera, style)),
        );
        let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        {
            let mut pass = begin(&mut encoder, targets);
            pass.set_bind_group(0, &self.bindings, &[]);
            if style.floor {
                pass.set_pipeline(&self.floor_pipeline);
                pass.draw(0..4, 0..1);
            }
            if let (Some(vertices), Some((triangles, indices))) = (&self.vertices, &self.indices) {
                pass.set_pipeline(&self.mesh_pipeline);
                pass.set_vertex_buffer(0, vertices.slice(..));
                pass.set_index_buffer(indices.slice(..), wgpu::IndexFormat::Uint32);
                pass.draw_indexed(0..3 * triangles.len() as u32, 0, 0..1);
            }
        }
        queue.submit([encoder.finish()]);
    }

    fn stage(&mut self, mesh: MeshView<'_>) {
        let normals = mesh.normals_or_computed();
        let color = |i: usize| {
            mesh.colors
                .get(i)
                .map_or([0; 4], |&[r, g, b]| [r, g, b, 255])
        };
        self.staged.clear();
        self.staged.extend(
            mesh.vertices
                .iter()
                .zip(normals)
                .enumerate()
                .map(|(i, (&position, normal))| MeshVertex { position, normal, color: color(i) }),
        );
    }
}

/// Camera space to clip space: x right, y up, depth 0 at the near plane and 1 at the far one.
fn clip_from_camera(camera: &PictureCamera) -> Mat4 {
    let i = camera.intrinsics;
    let (width, height) = (i.width as f32, i.height as f32);
    let range = FAR_M / (FAR_M - NEAR_M);
    Mat4::from_cols(
        vec4(2.0 * i.fx / width, 0.0, 0.0, 0.0),
        vec4(0.0, -2.0 * i.fy / height, 0.0, 0.0),
        // Pixel centres are at integers, so the image begins half a pixel before 0.
        vec4(
            2.0 * (i.cx + 0.5) / width - 1.0,
            1.0 - 2.0 * (i.cy + 0.5) / height,
            range,
            1.0,
        ),
        vec4(0.0, 0.0, -range * NEAR_M, 0.0),
    )
}

fn uniform(camera: &PictureCamera, style: SceneStyle) -> SceneUniform {
    let camera_from_world = camera.camera_from_world;
    let rotation = Mat4::from_quat(camera_from_world.rotation);
    let rigid = Mat4::from_translation(camera_from_world.translation) * rotation;
    let linear = |color: [u8; 3]| Vec3::from(color.map(linear_from_srgb)).extend(1.0);
    let encoded = |color: [u8; 3]| (Vec3::from(color.map(f32::from)) / 255.0).extend(1.0);
    SceneUniform {
        clip_from_world: clip_from_camera(camera) * rigid,
        camera_from_world: rotation,
        camera_in_world: camera_from_world.inverse().translation.extend(1.0),
        albedo: linear(style.albedo),
        key_towards: KEY.towards.extend(0.0),
        key_strength: KEY.strength.extend(0.0),
        fill_towards: FILL.towards.extend(0.0),
        fill_strength: FILL.strength.extend(0.0),
        ground: GROUND.extend(0.0),
        sky: SKY.extend(0.0),
        amounts: vec4(RIM, WRAP, FLOOR_HALF_WIDTH_M, style.shadow),
        stand: style.stand.extend(0.0),
        line: encoded(palette::LINE),
        background: encoded(palette::PANEL),
    }
}

fn begin<'e>(encoder: &'e mut wgpu::CommandEncoder, targets: &Targets) -> wgpu::RenderPass<'e> {
    let [r, g, b] = palette::PANEL.map(|c| f64::from(c) / 255.0);
    encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
        label: Some("scene"),
        color_attachments: &[Some(wgpu::RenderPassColorAttachment {
            view: &targets.samples_view,
            depth_slice: None,
            resolve_target: Some(&targets.color_view),
            ops: wgpu::Operations {
                load: wgpu::LoadOp::Clear(wgpu::Color { r, g, b, a: 1.0 }),
                store: wgpu::StoreOp::Discard,
            },
        })],
        depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
            view: &targets.depth_view,
            depth_ops: Some(wgpu::Operations {
                load: wgpu::LoadOp::Clear(1.0),
                store: wgpu::StoreOp::Discard,
            }),
            stencil_ops: None,
        }),
        ..wgpu::RenderPassDescriptor::default()
    })
}

fn bind_group_layout(device: &wgpu::Device) -> wgpu::BindGroupLayout {
    device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
        label: Some("scene"),
        entries: &[wgpu::BindGroupLayoutEntry {
            binding: 0,
            visibility: wgpu::ShaderStages::VERTEX_FRAGMENT,
            ty: wgpu::BindingType::Buffer {
                ty: wgpu::BufferBindingType::Uniform,
                has_dynamic_offset: false,
                min_binding_size: None,
            },
            count: None,
        }],
    })
}

fn mesh_pipeline(
    device: &wgpu::Device,
    layout: &wgpu::BindGroupLayout,
    shader: &wgpu::ShaderModule,
) -> wgpu::RenderPipeline {
    let attributes = wgpu::vertex_attr_array![0 => Float32x3, 1 => Float32x3, 2 => Unorm8x4];
    let buffers = [Some(wgpu::VertexBufferLayout {
        array_stride: size_of::<MeshVertex>() as u64,
        step_mode: wgpu::VertexStepMode::Vertex,
        attributes: &attributes,
    })];
    let entries = ["mesh_vertex", "mesh_fragment"];
    let topology = wgpu::PrimitiveTopology::TriangleList;
    pipeline(device, layout, shader, (entries, &buffers, topology))
}

fn floor_pipeline(
    device: &wgpu::Device,
    layout: &wgpu::BindGroupLayout,
    shader: &wgpu::ShaderModule,
) -> wgpu::RenderPipeline {
    let entries = ["floor_vertex", "floor_fragment"];
    pipeline(
        device,
        layout,
        shader,
        (entries, &[], wgpu::PrimitiveTopology::TriangleStrip),
    )
}

fn pipeline(
    device: &wgpu::Device,
    layout: &wgpu::BindGroupLayout,
    shader: &wgpu::ShaderModule,
    (entries, buffers, topology): (
        [&str; 2],
        &[Option<wgpu::VertexBufferLayout<'_>>],
        wgpu::PrimitiveTopology,
    ),
) -> wgpu::RenderPipeline {
    let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label: Some("scene"),
        bind_group_layouts: &[Some(layout)],
        immediate_size: 0,
    });
    device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: Some(entries[0]),
        layout: Some(&layout),
        vertex: wgpu::VertexState {
            module: shader,
            entry_point: Some(entries[0]),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            buffers,
        },
        primitive: wgpu::PrimitiveState { topology, ..wgpu::PrimitiveState::default() },
        depth_stencil: Some(wgpu::DepthStencilState {
            format: DEPTH_FORMAT,
            depth_write_enabled: Some(true),
            depth_compare: Some(wgpu::CompareFunction::Less),
            stencil: wgpu::StencilState::default(),
            bias: wgpu::DepthBiasState::default(),
        }),
        multisample: wgpu::MultisampleState { count: SAMPLES, ..wgpu::MultisampleState::default() },
        fragment: Some(wgpu::FragmentState {
            module: shader,
            entry_point: Some(entries[1]),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            targets: &[Some(COLOR_FORMAT.into())],
        }),
        multiview_mask: None,
        cache: None,
    })
}

fn buffer(
    device: &wgpu::Device,
    label: &str,
    bytes: usize,
    usage: wgpu::BufferUsages,
) -> wgpu::Buffer {
    device.create_buffer(&wgpu::BufferDescriptor {
        label: Some(label),
        size: bytes as u64,
        usage: usage | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    })
}

#[cfg(test)]
mod tests {
    use effigy_fusion::mesh::primitives::sphere;
    use eframe::egui_wgpu::wgpu::PollType;

    use super::*;
    use crate::pictures::{Clay, Picture, render_mesh};

    const SIZE: [u32; 2] = [192, 160];

    /// Any adapter there is, a software one included; none at all is no failure.
    fn device() -> Option<(wgpu::Device, wgpu::Queue)> {
        let instance =
            wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle_from_env());
        let request = wgpu::RequestAdapterOptions::default();
        let adapter = pollster::block_on(instance.request_adapter(&request)).ok()?;
        let limits = wgpu::Limits::downlevel_webgl2_defaults().using_resolution(adapter.limits());
        let descriptor =
            wgpu::DeviceDescriptor { required_limits: limits, ..wgpu::DeviceDescriptor::default() };
        pollster::block_on(adapter.request_device(&descriptor)).ok()
    }

    fn read(device: &wgpu::Device, queue: &wgpu::Queue, texture: &wgpu::Texture) -> Picture {
        let bytes_per_row = SIZE[0] * 4;
        let bytes = (bytes_per_row * SIZE[1]) as usize;
        let usage = wgpu::BufferUsages::MAP_READ;
        let copy = buffer(device, "copy", bytes, usage);
        let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        let layout = wgpu::TexelCopyBufferLayout {
            offset: 0,
            bytes_per_row: Some(bytes_per_row),
            rows_per_image: None,
        };
        encoder.copy_texture_to_buffer(
            texture.as_image_copy(),
            wgpu::TexelCopyBufferInfo { buffer: &copy, layout },
            texture.size(),
        );
        queue.submit([encoder.finish()]);
        copy.slice(..)
            .map_async(wgpu::MapMode::Read, |mapped| mapped.expect("mappable"));
        device
            .poll(PollType::wait_indefinitely())
            .expect("the copy ends");
        let pixels = copy
            .slice(..)
            .get_mapped_range()
            .expect("mapped above")
            .to_vec();
        Picture::from_fn(SIZE[0], SIZE[1], |x, y| {
            let at = ((y * SIZE[0] + x) * 4) as usize;
            image::Rgb([pixels[at], pixels[at + 1], pixels[at + 2]])
        })
    }

    #[test]
    fn the_adapters_picture_is_the_processors_picture() {
        let Some((device, queue)) = device() else {
            println!("skipped: no graphics adapter, not even a software one");
            return;
        };
        let mut mesh = sphere(vec4(0.2, 1.0, -0.1, 0.0).truncate(), 0.4, 4);
        mesh.compute_normals();
        let camera = PictureCamera::orbit(Vec3::Y, 3.0, [0.6, 0.3], SIZE);
        let style =
            SceneStyle { albedo: palette::CLAY, floor: false, shadow: 0.0, stand: Vec3::ZERO };
        let targets = Targets::new(&device, SIZE);
        let mut renderer = SceneRenderer::new(&device);
        let triangles = Arc::new(mesh.triangles.clone());
        renderer.upload(&device, &queue, MeshView::from(&mesh), &triangles);
        renderer.draw(&device, &queue, &targets, (&camera, style));
        let drawn = read(&device, &queue, targets.color_view.texture());
        let twin = render_mesh(MeshView::from(&mesh), &camera, Clay::default());
        let difference = |a: &image::Rgb<u8>, b: &image::Rgb<u8>| {
            a.0.iter()
                .zip(b.0)
                .map(|(a, b)| a.abs_diff(b))
                .max()
                .unwrap_or(0)
        };
        let off = drawn
            .pixels()
            .zip(twin.pixels())
            .filter(|(a, b)| difference(a, b) > 3)
            .count();
        // Edge pixels differ: four samples lie elsewhere, and are averaged before encoding.
        let edge_px = 2.0 * std::f32::consts::PI * camera.intrinsics.fx * 0.4 / 3.0;
        assert!((off as f32) < 1.5 * edge_px, "{off} of {edge_px}");
        assert_eq!(drawn.get_pixel(0, 0), twin.get_pixel(0, 0));
    }
}
