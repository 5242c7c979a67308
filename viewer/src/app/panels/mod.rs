//! One file a panel; each shows a snapshot and sends wishes.

mod controls;
mod progress;
mod stage;
mod status;
mod streams;
mod timing;
mod training;

use eframe::egui::{Color32, Frame, Margin, RichText, Ui};

pub(super) use controls::controls;
pub(super) use progress::progress;
pub(super) use stage::stage_caption;
pub(super) use status::status;
pub(super) use streams::StreamsPanel;

use super::theme;

/// A quiet box with a heading.
fn card(ui: &mut Ui, heading: &str, contents: impl FnOnce(&mut Ui)) {
    Frame::new()
        .fill(theme::PANEL)
        .corner_radius(6)
        .inner_margin(Margin::same(12))
        .show(ui, |ui| {
            ui.set_width(ui.available_width());
            ui.label(small(heading, theme::DIM));
            contents(ui);
        });
    ui.add_space(4.0);
}

fn small(text: impl Into<String>, color: Color32) -> RichText {
    RichText::new(text).size(11.5).color(color)
}
