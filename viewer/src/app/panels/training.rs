//! How fine-tuning goes: step, time left, and two curves.

use eframe::egui::{Align, Color32, Layout, ProgressBar, Ui};
use egui_plot::{Line, Plot, PlotPoints};

use super::small;
use crate::{TrainingView, app::theme};

const PLOT_HEIGHT: f32 = 74.0;

pub(super) fn training(ui: &mut Ui, view: &TrainingView) {
    let share = view.step as f32 / view.steps.max(1) as f32;
    ui.add(
        ProgressBar::new(share)
            .desired_height(6.0)
            .fill(theme::ACCENT),
    );
    ui.horizontal(|ui| {
        ui.label(small(
            format!("step {} of {}", view.step, view.steps),
            theme::DIM,
        ));
        ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
            ui.label(small(time_left(view), theme::TEXT));
        });
    });
    let held_out = ("Held-out residual, mm", theme::ACCENT);
    curve(ui, held_out, &view.held_out_mm, |last| format!("{last:.2}"));
    curve(ui, ("Loss", theme::CLAY), &view.loss, |last| {
        format!("{last:.4}")
    });
}

fn time_left(view: &TrainingView) -> String {
    match (view.running, view.seconds_left) {
        (true, Some(secs)) if secs >= 90.0 => format!("{:.0} min left", secs / 60.0),
        (true, Some(secs)) => format!("{secs:.0} s left"),
        (true, None) => "running".to_owned(),
        (false, _) if view.step >= view.steps => "done".to_owned(),
        (false, _) => "stopped".to_owned(),
    }
}

/// One curve with its name and its last value; nothing until there are two points.
fn curve(
    ui: &mut Ui,
    (name, color): (&str, Color32),
    points: &[[f64; 2]],
    label: impl Fn(f64) -> String,
) {
    let Some(last) = points.last().filter(|_| points.len() > 1) else {
        return;
    };
    ui.horizontal(|ui| {
        ui.label(small(name, theme::DIM));
        ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
            ui.label(small(label(last[1]), color));
        });
    });
    Plot::new(name)
        .height(PLOT_HEIGHT)
        .include_y(0.0)
        .show_axes(false)
        .show_grid(false)
        .show_background(false)
        .allow_drag(false)
        .allow_zoom(false)
        .allow_scroll(false)
        .allow_boxed_zoom(false)
        .show(ui, |plot| {
            plot.line(
                Line::new(name, PlotPoints::from(points.to_vec()))
                    .color(color)
                    .width(1.6),
            );
        });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn time_left_speaks_of_minutes_seconds_and_the_end() {
        let view = |running, step, seconds_left| TrainingView {
            running,
            step,
            steps: 100,
            seconds_left,
            ..TrainingView::default()
        };
        assert_eq!(time_left(&view(true, 10, Some(150.0))), "2 min left");
        assert_eq!(time_left(&view(true, 10, Some(31.4))), "31 s left");
        assert_eq!(time_left(&view(false, 100, None)), "done");
        assert_eq!(time_left(&view(false, 40, None)), "stopped");
    }
}
