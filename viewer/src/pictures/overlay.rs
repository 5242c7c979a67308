//! The fitted body over the depth it was fitted to.

use effigy_capture::{Intrinsics, Rigid3};
use effigy_fusion::CleanFrame;

use super::{
    Framing, MeshView, Picture, PictureCamera,
    depth::{outline, relief_picture},
    palette::{self, mix, srgb_from_linear},
    shade::LitMesh,
};

/// How much of the body is seen, and of the depth behind it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OverlayStyle {
    pub color: [u8; 3],
    /// 0 = the outline only, 1 = the depth is hidden.
    pub opacity: f32,
}

impl Default for OverlayStyle {
    fn default() -> Self {
        Self { color: palette::BODY, opacity: 0.6 }
    }
}

/// Draws a clean frame and the translucent body with its outline, as the depth camera sees them.
/// The body is in world space.
pub fn body_over_depth(
    clean: &CleanFrame,
    body: MeshView<'_>,
    sensor: (&Intrinsics, Rigid3),
    framing: &Framing,
    style: OverlayStyle,
) -> Picture {
    let mut picture = relief_picture(clean, framing);
    let (intrinsics, world_from_camera) = sensor;
    let camera = PictureCamera::of_sensor(intrinsics, world_from_camera, framing);
    let lit = LitMesh::new(body, &camera, style.color);
    for (pixel, under) in picture.pixels_mut().enumerate() {
        if let Some(light) = lit.light(pixel) {
            let over = light.to_array().map(srgb_from_linear);
            under.0 = mix(under.0, over, style.opacity);
        }
    }
    let (width, height) = (i64::from(framing.width), i64::from(framing.height));
    let inside = |x: i64, y: i64| {
        (0..width).contains(&x) && (0..height).contains(&y) && lit.covers((y * width + x) as usize)
    };
    outline(&mut picture, inside, mix(style.color, [255; 3], 0.35));
    picture
}
