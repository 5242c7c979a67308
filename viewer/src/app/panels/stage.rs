//! What the avatar's view says about itself.

use eframe::egui::{Align2, FontId, Rect, Ui, vec2};

use crate::{
    Snapshot,
    app::{theme, window::Desk},
};

pub(in crate::app) fn stage_caption(ui: &Ui, area: Rect, snapshot: &Snapshot, desk: &Desk) {
    title(ui, area, snapshot);
    foot(ui, area, snapshot, desk);
}

fn title(ui: &Ui, area: Rect, snapshot: &Snapshot) {
    let (title, detail) = match (&snapshot.avatar, &snapshot.body) {
        (Some(avatar), _) => ("Avatar", format!("frame {}", avatar.id.0)),
        (None, Some(_)) => (
            "Fitted body",
            "an avatar appears when there are enough keyframes".to_owned(),
        ),
        (None, None) => ("Avatar", "nobody found yet".to_owned()),
    };
    let at = area.left_top() + vec2(14.0, 11.0);
    let painter = ui.painter();
    let font = FontId::proportional(14.0);
    let drawn = painter.text(at, Align2::LEFT_TOP, title, font, theme::TEXT);
    let at = drawn.right_bottom() + vec2(8.0, -1.0);
    painter.text(
        at,
        Align2::LEFT_BOTTOM,
        detail,
        FontId::proportional(11.5),
        theme::DIM,
    );
}

/// How to move the camera, and the newest line: the window's own, else the pipeline's, else a standing promise.
fn foot(ui: &Ui, area: Rect, snapshot: &Snapshot, desk: &Desk) {
    let painter = ui.painter();
    let help = "drag to turn, scroll to zoom, double-click to start over";
    let at = area.left_bottom() + vec2(14.0, -10.0);
    painter.text(
        at,
        Align2::LEFT_BOTTOM,
        help,
        FontId::proportional(11.0),
        theme::DIM,
    );
    let (news, color) = match desk.news().or(snapshot.message.as_deref()) {
        Some(news) => (news, theme::TEXT),
        None => ("Everything stays on this machine", theme::DIM),
    };
    let at = area.right_bottom() + vec2(-14.0, -10.0);
    painter.text(
        at,
        Align2::RIGHT_BOTTOM,
        news,
        FontId::proportional(11.5),
        color,
    );
}
