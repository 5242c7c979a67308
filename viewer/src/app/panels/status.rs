//! The top line: what runs, how the tracking is, how fast.

use eframe::egui::{Align, Color32, Layout, RichText, Sense, Ui, vec2};

use super::small;
use crate::{
    Snapshot, TrackState,
    app::{theme, window::Desk},
};

pub(in crate::app) fn status(ui: &mut Ui, snapshot: &Snapshot, desk: &Desk) {
    ui.horizontal(|ui| {
        ui.label(
            RichText::new("Effigy")
                .heading()
                .strong()
                .color(theme::TEXT),
        );
        ui.add_space(6.0);
        ui.label(RichText::new(&snapshot.source.name).color(theme::DIM));
        ui.add_space(14.0);
        state_chip(ui, snapshot.state);
        let advice = snapshot.state.advice();
        if !advice.is_empty() {
            ui.label(small(advice, theme::DIM));
        }
        ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
            figures(ui, snapshot, desk);
        });
    });
}

pub(super) fn state_color(state: TrackState) -> Color32 {
    match state {
        TrackState::Tracking { .. } => theme::GOOD,
        TrackState::Searching | TrackState::Partial => theme::WAITING,
        TrackState::Lost { .. } => theme::BAD,
        TrackState::Finished => theme::DIM,
    }
}

fn state_chip(ui: &mut Ui, state: TrackState) {
    let color = state_color(state);
    let (dot, _) = ui.allocate_exact_size(vec2(10.0, 10.0), Sense::hover());
    ui.painter().circle_filled(dot.center(), 4.5, color);
    let label = ui.label(RichText::new(state.label()).color(color));
    match state {
        TrackState::Tracking { residual_rms_m } => {
            let text = format!("{:.1} mm", residual_rms_m * 1000.0);
            let hover = "Root mean square distance of the depth points to the fitted body";
            ui.label(small(text, theme::DIM)).on_hover_text(hover);
        }
        TrackState::Lost { for_secs } => {
            ui.label(small(format!("for {for_secs:.1} s"), theme::DIM));
        }
        TrackState::Searching | TrackState::Partial | TrackState::Finished => {
            label.on_hover_text(state.advice());
        }
    }
}

/// Right to left: what computes, latency, frame rate.
fn figures(ui: &mut Ui, snapshot: &Snapshot, desk: &Desk) {
    let performance = &snapshot.performance;
    let color = if desk.software {
        theme::WAITING
    } else {
        theme::DIM
    };
    let hover = if desk.software {
        "No graphics card: the processor draws this window, so it is drawn less often"
    } else {
        "What draws this window"
    };
    ui.label(small(&desk.adapter, color)).on_hover_text(hover);
    if !snapshot.source.device.is_empty() {
        ui.label(small(&snapshot.source.device, theme::DIM))
            .on_hover_text("What computes");
    }
    ui.add_space(10.0);
    if performance.latency_p50_ms > 0.0 {
        let text = format!(
            "{:.0} / {:.0} ms",
            performance.latency_p50_ms, performance.latency_p95_ms
        );
        let hover = "Latency from exposure to avatar: median / 95th percentile";
        ui.label(RichText::new(text).monospace())
            .on_hover_text(hover);
        ui.add_space(8.0);
    }
    if performance.frames_per_sec > 0.0 {
        let text = format!("{:.1} fps", performance.frames_per_sec);
        ui.label(RichText::new(text).monospace())
            .on_hover_text("Frames through the pipeline");
    }
}
