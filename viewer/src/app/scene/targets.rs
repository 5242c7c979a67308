//! The textures that the scene is drawn into.

use eframe::wgpu;

/// What egui expects of a texture it shows: sRGB-encoded bytes, taken as they are.
pub(super) const COLOR_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba8Unorm;
pub(super) const DEPTH_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Depth32Float;
/// Four is what every adapter offers.
pub(super) const SAMPLES: u32 = 4;

/// One size's textures.
pub(super) struct Targets {
    pub(super) size: [u32; 2],
    pub(super) color_view: wgpu::TextureView,
    pub(super) samples_view: wgpu::TextureView,
    pub(super) depth_view: wgpu::TextureView,
}

impl Targets {
    pub(super) fn new(device: &wgpu::Device, size: [u32; 2]) -> Self {
        let color = texture(device, "scene colour", COLOR_FORMAT, (size, 1));
        let samples = texture(device, "scene samples", COLOR_FORMAT, (size, SAMPLES));
        let depth = texture(device, "scene depth", DEPTH_FORMAT, (size, SAMPLES));
        let view =
            |texture: &wgpu::Texture| texture.create_view(&wgpu::TextureViewDescriptor::default());
        Self {
            size,
            color_view: view(&color),
            samples_view: view(&samples),
            depth_view: view(&depth),
        }
    }
}

fn texture(
    device: &wgpu::Device,
    label: &str,
    format: wgpu::TextureFormat,
    ([width, height], sample_count): ([u32; 2], u32),
) -> wgpu::Texture {
    let shown = if sample_count == 1 {
        wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_SRC
    } else {
        wgpu::TextureUsages::empty()
    };
    device.create_texture(&wgpu::TextureDescriptor {
        label: Some(label),
        size: wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count,
        dimension: wgpu::TextureDimension::D2,
        format,
        usage: wgpu::TextureUsages::RENDER_ATTACHMENT | shown,
        view_formats: &[],
    })
}
