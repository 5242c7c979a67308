//! The colour camera beside the depth camera: its own place, focal length and lens.

use effigy_capture::{CameraModel, CaptureError, ColorImage, Intrinsics, Rigid3};
use glam::Vec2;

use super::Renderer;
use crate::scenario::Room;

/// Draws through a pinhole that sees a little more, then looks up each pixel of the lens there.
pub struct ColorCamera {
    renderer: Renderer,
    size: [u32; 2],
    /// Where in the pinhole's image each pixel looks; outside of it for rays the lens does not have.
    pinhole_pixels: Vec<u32>,
}

/// The pinhole sees this much more on each side than the lens: room for its distortion.
const MARGIN: f32 = 0.12;
const NO_PIXEL: u32 = u32::MAX;

impl ColorCamera {
    pub fn new(camera: &CameraModel, world_from_color: Rigid3, room: Room) -> Self {
        let Intrinsics { width, height, fx, fy, .. } = camera.intrinsics;
        let widened = |size: u32| (size as f32 * (1.0 + 2.0 * MARGIN)).round() as u32;
        let (wide, high) = (widened(width), widened(height));
        let pinhole = Intrinsics {
            width: wide,
            height: high,
            fx,
            fy,
            cx: (wide - 1) as f32 * 0.5,
            cy: (high - 1) as f32 * 0.5,
        };
        let pinhole_pixels = camera
            .rays()
            .into_iter()
            .map(|ray| pinhole_pixel(&pinhole, ray))
            .collect();
        Self {
            renderer: Renderer::new(pinhole, world_from_color, room),
            size: [width, height],
            pinhole_pixels,
        }
    }

    /// As [`Renderer::two_sided`].
    pub fn two_sided(mut self) -> Self {
        self.renderer = self.renderer.two_sided();
        self
    }

    /// Draws what the pinhole behind the lens sees.
    pub fn renderer(&mut self) -> &mut Renderer {
        &mut self.renderer
    }

    /// The camera's picture, from the shaded colours of what [`Self::renderer`] drew.
    pub fn through_lens(&self, shaded: &[[u8; 3]]) -> Result<ColorImage, CaptureError> {
        let pixels = self
            .pinhole_pixels
            .iter()
            .map(|&at| shaded.get(at as usize).copied().unwrap_or_default())
            .collect();
        let [width, height] = self.size;
        ColorImage::new(width, height, pixels)
    }
}

fn pinhole_pixel(pinhole: &Intrinsics, ray: Vec2) -> u32 {
    if !ray.is_finite() {
        return NO_PIXEL;
    }
    let (x, y) = (
        (ray.x * pinhole.fx + pinhole.cx).round(),
        (ray.y * pinhole.fy + pinhole.cy).round(),
    );
    let inside = x >= 0.0 && y >= 0.0 && x < pinhole.width as f32 && y < pinhole.height as f32;
    if inside {
        y as u32 * pinhole.width + x as u32
    } else {
        NO_PIXEL
    }
}
