//! The bottom line: what one can ask for.

use eframe::egui::{Button, Slider, Ui};

use super::small;
use crate::{
    Looping, PlaybackView, Snapshot, UiCommand,
    app::{settings::Layer, theme, window::Desk},
};

pub(in crate::app) fn controls(ui: &mut Ui, snapshot: &Snapshot, desk: &mut Desk) {
    ui.horizontal(|ui| {
        if let Some(view) = snapshot.playback {
            playback(ui, view, desk);
            ui.separator();
        }
        layers(ui, desk);
        ui.separator();
        avatar(ui, snapshot, desk);
    });
}

fn playback(ui: &mut Ui, view: PlaybackView, desk: &mut Desk) {
    let (label, wish) = if view.paused {
        ("Play", UiCommand::Resume)
    } else {
        ("Pause", UiCommand::Pause)
    };
    if ui.button(label).on_hover_text("Space").clicked() {
        desk.send(wish);
    }
    if ui.add_enabled(view.paused, Button::new("Step")).clicked() {
        desk.send(UiCommand::Step);
    }
    if ui.selectable_label(view.looping, "Loop").clicked() {
        let looping = if view.looping {
            Looping::Once
        } else {
            Looping::Forever
        };
        desk.send(UiCommand::Loop(looping));
    }
    if let Some(last) = view.frame_count.and_then(|count| count.checked_sub(1)) {
        let mut frame = view.frame.min(last);
        ui.spacing_mut().slider_width = 150.0;
        let slider = ui.add(Slider::new(&mut frame, 0..=last).show_value(false));
        if slider.changed() {
            desk.send(UiCommand::Seek { frame });
        }
        ui.label(small(format!("{} / {}", view.frame, last), theme::DIM));
    }
}

fn layers(ui: &mut Ui, desk: &mut Desk) {
    for layer in Layer::ALL {
        if ui
            .selectable_label(desk.settings.shows(layer), layer.label())
            .clicked()
        {
            desk.settings.toggle(layer);
        }
    }
    let mirror = ui.selectable_label(desk.settings.mirror, "Mirror");
    if mirror
        .on_hover_text("M: left is left, as in a mirror")
        .clicked()
    {
        desk.settings.mirror = !desk.settings.mirror;
    }
}

fn avatar(ui: &mut Ui, snapshot: &Snapshot, desk: &mut Desk) {
    let training = snapshot.training.as_ref().is_some_and(|t| t.running);
    if training {
        if ui.button("Cancel fine-tuning").clicked() {
            desk.send(UiCommand::CancelFineTuning);
        }
    } else if snapshot.keyframes.collected > 0 {
        let button = ui.button("Fine-tune now");
        if button
            .on_hover_text("With the keyframes there are")
            .clicked()
        {
            desk.send(UiCommand::FineTune);
        }
    }
    if snapshot.avatar.is_some() && ui.button("Export GLB").clicked() {
        desk.send(UiCommand::ExportGlb);
    }
    if ui.button("Screenshot").clicked() {
        desk.wants_screenshot = true;
    }
    ui.menu_button("Start over", |ui| {
        if ui.button("Forget keyframes and avatar").clicked() {
            desk.send(UiCommand::StartOver);
            ui.close();
        }
    });
}
