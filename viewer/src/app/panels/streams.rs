//! What the camera sees, and the body in it.

use std::sync::Arc;

use effigy_capture::{Calibration, Frame, FrameId};
use effigy_fusion::CleanFrame;
use eframe::egui::{
    Align2, Color32, FontId, Image, Rect, Sense, TextureId, Ui, Vec2, load::SizedTexture, pos2,
    vec2,
};

use crate::{
    Snapshot,
    app::{
        settings::{Layer, Settings},
        stream::Stream,
        theme,
    },
    pictures::{
        DepthRange, Framing, MeshView, OverlayStyle, Picture, body_over_depth, clean_picture,
        outline_person, palette, raw_depth_picture,
    },
};

/// No picture has more pixels a side: it would cost time and nobody would see it.
const LARGEST_PX: u32 = 480;

#[derive(Clone, Copy, PartialEq, Eq)]
struct OverlayKey {
    clean: FrameId,
    body: Option<FrameId>,
    outline: bool,
}

/// Keeps the textures of both pictures.
pub(in crate::app) struct StreamsPanel {
    depth: Stream<FrameId>,
    overlay: Stream<OverlayKey>,
}

impl StreamsPanel {
    pub(in crate::app) fn new() -> Self {
        Self { depth: Stream::new("depth"), overlay: Stream::new("body over depth") }
    }

    pub(in crate::app) fn show(&mut self, ui: &mut Ui, snapshot: &Snapshot, settings: &Settings) {
        let gap = ui.spacing().item_spacing.y;
        let size = vec2(ui.available_width(), 0.5 * (ui.available_height() - gap));
        let depth = self.depth_texture(ui, snapshot);
        picture(ui, size, "Depth", depth, settings.mirror);
        let overlay = self.overlay_texture(ui, snapshot, settings);
        picture(ui, size, "Body over depth", overlay, settings.mirror);
    }

    fn depth_texture(&mut self, ui: &Ui, snapshot: &Snapshot) -> Option<(TextureId, Vec2)> {
        let frame = snapshot.frame.as_ref()?;
        let calibration = snapshot.calibration.as_ref()?;
        let draw = || draw_depth(frame, calibration, snapshot.clean.as_deref());
        let texture = self.depth.texture(ui.ctx(), frame.id, draw);
        Some((texture.id(), texture.size_vec2()))
    }

    fn overlay_texture(
        &mut self,
        ui: &Ui,
        snapshot: &Snapshot,
        settings: &Settings,
    ) -> Option<(TextureId, Vec2)> {
        // The body belongs to the registered frame; before there is one, the clean frame is enough.
        let registered = snapshot.registered.as_ref();
        let clean = registered.map(|r| &r.clean).or(snapshot.clean.as_ref())?;
        let body = snapshot.body.as_ref().filter(|body| {
            settings.shows(Layer::Body) && registered.is_some() && body.id == clean.id
        });
        let outline = settings.shows(Layer::PersonOutline);
        let key = OverlayKey { clean: clean.id, body: body.map(|b| b.id), outline };
        let draw = || draw_overlay(snapshot, clean, body.map(|b| MeshView::from(&**b)), outline);
        let texture = self.overlay.texture(ui.ctx(), key, draw);
        Some((texture.id(), texture.size_vec2()))
    }
}

fn draw_depth(frame: &Frame, calibration: &Calibration, clean: Option<&CleanFrame>) -> Picture {
    let depth = &frame.depth;
    let [near_m, far_m] = calibration.range_m;
    let range = clean.map_or(DepthRange { near_m, far_m }, DepthRange::of);
    let source = [depth.width() as usize, depth.height() as usize];
    raw_depth_picture(depth, calibration.metres_per_unit, range, &framing(source))
}

fn draw_overlay(
    snapshot: &Snapshot,
    clean: &Arc<CleanFrame>,
    body: Option<MeshView<'_>>,
    outline: bool,
) -> Picture {
    let framing = framing([clean.depth.width, clean.depth.height]);
    let sensor = snapshot
        .calibration
        .as_ref()
        .zip(snapshot.registered.as_ref());
    let mut picture = match (body, sensor) {
        (Some(body), Some((calibration, registered))) => {
            let sensor = (&calibration.depth.intrinsics, registered.world_from_camera);
            body_over_depth(clean, body, sensor, &framing, OverlayStyle::default())
        }
        _ => clean_picture(clean, DepthRange::of(clean), &framing),
    };
    if outline {
        outline_person(&mut picture, clean, &framing, palette::WAITING);
    }
    picture
}

/// The whole image, smaller if it is large.
fn framing(source: [usize; 2]) -> Framing {
    let [width, height] = source.map(|s| s as f32);
    let scale = (LARGEST_PX as f32 / width.max(height)).min(1.0);
    let size = [
        (width * scale).round() as u32,
        (height * scale).round() as u32,
    ];
    Framing::fitted(source, size)
}

/// A picture with its name in a corner, as large as fits, cropped to the box's shape.
fn picture(ui: &mut Ui, size: Vec2, name: &str, texture: Option<(TextureId, Vec2)>, mirror: bool) {
    let (rectangle, _) = ui.allocate_exact_size(size, Sense::hover());
    ui.painter().rect_filled(rectangle, 6.0, theme::PANEL);
    if let Some((id, native)) = texture {
        Image::new(SizedTexture::new(id, rectangle.size()))
            .uv(cover(native, rectangle.size(), mirror))
            .corner_radius(6)
            .paint_at(ui, rectangle);
    } else {
        let font = FontId::proportional(13.0);
        ui.painter().text(
            rectangle.center(),
            Align2::CENTER_CENTER,
            "waiting",
            font,
            theme::DIM,
        );
    }
    caption(ui, rectangle, name);
}

fn caption(ui: &Ui, rectangle: Rect, name: &str) {
    let font = FontId::proportional(12.0);
    let at = rectangle.left_top() + vec2(10.0, 8.0);
    let text = ui
        .painter()
        .layout_no_wrap(name.to_owned(), font, theme::TEXT);
    let behind = Rect::from_min_size(at, text.size()).expand2(vec2(6.0, 3.0));
    ui.painter()
        .rect_filled(behind, 4.0, Color32::from_black_alpha(120));
    ui.painter().galley(at, text, theme::TEXT);
}

/// The part of a picture that fills a box of another shape, mirrored on request.
fn cover(native: Vec2, shown: Vec2, mirror: bool) -> Rect {
    let (picture, place) = (native.x / native.y.max(1.0), shown.x / shown.y.max(1.0));
    let half = vec2((place / picture).min(1.0), (picture / place).min(1.0)) * 0.5;
    let (left, right) = (0.5 - half.x, 0.5 + half.x);
    let (left, right) = if mirror { (right, left) } else { (left, right) };
    Rect { min: pos2(left, 0.5 - half.y), max: pos2(right, 0.5 + half.y) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wide_picture_loses_its_sides_in_a_square_box_and_nothing_else() {
        let part = cover(vec2(200.0, 100.0), vec2(50.0, 50.0), false);
        assert_eq!(part, Rect { min: pos2(0.25, 0.0), max: pos2(0.75, 1.0) });
        let mirrored = cover(vec2(200.0, 100.0), vec2(50.0, 50.0), true);
        assert_eq!(
            mirrored,
            Rect { min: pos2(0.75, 0.0), max: pos2(0.25, 1.0) }
        );
    }
}
