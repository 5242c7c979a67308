//! The way to an avatar: find, collect, learn, live.

use eframe::egui::{Align, Color32, Layout, RichText, ScrollArea, Sense, Stroke, Ui, vec2};

use super::{card, small, timing::timing, training::training};
use crate::{
    Snapshot, TrackState,
    app::{settings::Layer, theme, window::Desk},
};

#[derive(Clone, Copy, PartialEq, Eq)]
enum Progress {
    Ahead,
    Now,
    Done,
}

pub(in crate::app) fn progress(ui: &mut Ui, snapshot: &Snapshot, desk: &Desk) {
    ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
        card(ui, "Progress", |ui| steps(ui, snapshot));
        if let Some(view) = &snapshot.training {
            card(ui, "Fine-tuning", |ui| training(ui, view));
        }
        if desk.settings.shows(Layer::Timing) {
            card(ui, "Time a stage takes, ms", |ui| {
                timing(ui, &snapshot.performance);
            });
        }
    });
}

fn steps(ui: &mut Ui, snapshot: &Snapshot) {
    let keyframes = &snapshot.keyframes;
    let found = !matches!(snapshot.state, TrackState::Searching) || keyframes.collected > 0;
    let enough = keyframes.wanted > 0 && keyframes.collected >= keyframes.wanted;
    let training = snapshot.training.as_ref().is_some_and(|t| t.running);
    let live = snapshot.avatar.is_some();
    let progress = |done: bool, begun: bool| match (done, begun) {
        (true, _) => Progress::Done,
        (false, true) => Progress::Now,
        (false, false) => Progress::Ahead,
    };
    step(ui, progress(found, true), "Find the person", "");
    let counted = format!("{} / {}", keyframes.collected, keyframes.wanted);
    let count = if keyframes.wanted > 0 {
        counted
    } else {
        String::new()
    };
    step(ui, progress(enough, found), "Collect keyframes", &count);
    if found && !enough {
        keyframe_dots(ui, keyframes.collected, keyframes.wanted);
        if !keyframes.hint.is_empty() {
            ui.horizontal(|ui| {
                ui.add_space(22.0);
                ui.label(small(&keyframes.hint, theme::WAITING));
            });
        }
    }
    let learning = if training && live { "refining" } else { "" };
    step(
        ui,
        progress(live, enough || training),
        "Learn the avatar",
        learning,
    );
    step(
        ui,
        progress(live, false),
        "Live",
        if live { "follows you" } else { "" },
    );
}

fn step(ui: &mut Ui, progress: Progress, name: &str, detail: &str) {
    let (mark, text) = match progress {
        Progress::Done => (theme::GOOD, theme::TEXT),
        Progress::Now => (theme::WAITING, theme::TEXT),
        Progress::Ahead => (theme::LINE, theme::DIM),
    };
    ui.horizontal(|ui| {
        draw_mark(ui, progress, mark);
        ui.label(RichText::new(name).color(text));
        ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
            ui.label(
                RichText::new(detail)
                    .monospace()
                    .size(12.0)
                    .color(theme::DIM),
            );
        });
    });
}

fn draw_mark(ui: &mut Ui, progress: Progress, color: Color32) {
    let (place, _) = ui.allocate_exact_size(vec2(14.0, 14.0), Sense::hover());
    let (painter, center) = (ui.painter(), place.center());
    match progress {
        Progress::Done => {
            let points = [vec2(-5.0, 0.0), vec2(-1.5, 3.5), vec2(5.0, -4.0)].map(|d| center + d);
            painter.line(points.to_vec(), Stroke::new(2.0, color));
        }
        Progress::Now => {
            painter.circle_filled(center, 4.0, color);
        }
        Progress::Ahead => {
            painter.circle_stroke(center, 4.0, Stroke::new(1.5, color));
        }
    }
}

fn keyframe_dots(ui: &mut Ui, collected: usize, wanted: usize) {
    // Beyond two dozen the dots would not fit; the count beside the step says it all.
    if wanted > 24 {
        return;
    }
    ui.horizontal(|ui| {
        ui.add_space(22.0);
        ui.spacing_mut().item_spacing.x = 5.0;
        for index in 0..wanted {
            let (place, _) = ui.allocate_exact_size(vec2(9.0, 9.0), Sense::hover());
            let color = if index < collected {
                theme::ACCENT
            } else {
                theme::LINE
            };
            ui.painter().circle_filled(place.center(), 4.0, color);
        }
    });
}
