//! What each stage costs, and what was dropped and why.

use eframe::egui::{Align, Grid, Layout, RichText, Ui};

use super::small;
use crate::{PerformanceView, app::theme};

pub(super) fn timing(ui: &mut Ui, performance: &PerformanceView) {
    if performance.stages.is_empty() {
        ui.label(small("nothing measured yet", theme::DIM));
        return;
    }
    let width = ui.available_width();
    Grid::new("stages")
        .num_columns(3)
        .min_col_width(0.0)
        .spacing([8.0, 3.0])
        .show(ui, |ui| {
            for heading in ["", "median", "p95"] {
                cell(ui, width, heading.is_empty(), small(heading, theme::DIM));
            }
            ui.end_row();
            for stage in &performance.stages {
                cell(ui, width, true, RichText::new(&stage.name).size(12.5));
                for ms in [stage.p50_ms, stage.p95_ms] {
                    cell(
                        ui,
                        width,
                        false,
                        RichText::new(format!("{ms:.1}")).monospace(),
                    );
                }
                ui.end_row();
            }
        });
    for drop in performance.drops.iter().filter(|drop| drop.count > 0) {
        let text = format!("{} dropped: {}", drop.count, drop.cause);
        ui.label(small(text, theme::WAITING));
    }
}

/// A cell of fixed width, so that numbers stand still; names to the left, numbers to the right.
fn cell(ui: &mut Ui, width: f32, name: bool, text: RichText) {
    let share = if name { 0.5 } else { 0.2 };
    let (layout, size) = if name {
        (Layout::left_to_right(Align::Center), [width * share, 16.0])
    } else {
        (Layout::right_to_left(Align::Center), [width * share, 16.0])
    };
    ui.allocate_ui_with_layout(size.into(), layout, |ui| {
        ui.set_min_width(width * share);
        ui.label(text);
    });
}
