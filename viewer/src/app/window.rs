//! The window's own state, and where each panel goes.

use std::{path::PathBuf, sync::Arc, time::Duration};

use eframe::{
    CreationContext, egui,
    egui::{CentralPanel, Context, Frame, Key, Margin, Panel, Ui, ViewportCommand},
    wgpu,
};

use super::{
    ViewerOptions, panels, panels::StreamsPanel, scene::SceneView, screenshot::Screenshots,
    settings::Settings, theme,
};
use crate::{CommandSender, Snapshot, SnapshotSlot, UiCommand, ViewerError};

/// Between two redraws that new snapshots ask for. A software adapter shares the processor with the
/// pipeline, so it gets fewer.
const REDRAW: Duration = Duration::from_millis(33);
const REDRAW_IN_SOFTWARE: Duration = Duration::from_millis(80);
/// How long a line of news stays.
const NEWS_SECS: f64 = 6.0;

pub(super) struct Window {
    slot: Arc<SnapshotSlot>,
    options: ViewerOptions,
    scene: SceneView,
    streams: StreamsPanel,
    screenshots: Screenshots,
    pub(super) desk: Desk,
}

/// What panels may read and change besides the snapshot.
pub(super) struct Desk {
    pub(super) commands: CommandSender,
    pub(super) settings: Settings,
    /// "llvmpipe (software)".
    pub(super) adapter: String,
    pub(super) software: bool,
    pub(super) wants_screenshot: bool,
    news: Option<(String, f64)>,
    now_secs: f64,
}

impl Window {
    pub(super) fn new(
        creation: &CreationContext<'_>,
        slot: Arc<SnapshotSlot>,
        commands: CommandSender,
        options: ViewerOptions,
    ) -> Result<Self, ViewerError> {
        let Some(state) = creation.wgpu_render_state.clone() else {
            return Err(ViewerError::NoAdapter { detail: "wgpu is not in use".to_owned() });
        };
        theme::apply(&creation.egui_ctx);
        let info = state.adapter.get_info();
        let software = info.device_type == wgpu::DeviceType::Cpu;
        // Whoever waits for the window then finds its adapter, too.
        slot.set_adapter(state.adapter.clone());
        wake_on_news(&slot, &creation.egui_ctx, software);
        let desk = Desk {
            commands,
            settings: Settings::default(),
            adapter: adapter_line(&info, software),
            software,
            wants_screenshot: false,
            news: None,
            now_secs: 0.0,
        };
        let scene = SceneView::new(state, software);
        let (streams, screenshots) = (StreamsPanel::new(), Screenshots::default());
        Ok(Self { slot, options, scene, streams, screenshots, desk })
    }

    fn lay_out(&mut self, ui: &mut Ui, snapshot: &Snapshot) {
        let bar = Frame::new().inner_margin(Margin::symmetric(14, 9));
        let side = Frame::new().inner_margin(Margin { left: 14, right: 10, top: 0, bottom: 0 });
        let other_side =
            Frame::new().inner_margin(Margin { left: 10, right: 14, top: 0, bottom: 0 });
        Panel::top("status")
            .frame(bar)
            .show_separator_line(false)
            .show(ui, |ui| {
                panels::status(ui, snapshot, &self.desk);
            });
        Panel::bottom("controls")
            .frame(bar)
            .show_separator_line(false)
            .show(ui, |ui| {
                panels::controls(ui, snapshot, &mut self.desk);
            });
        Panel::left("streams")
            .frame(side)
            .exact_size(330.0)
            .resizable(false)
            .show_separator_line(false)
            .show(ui, |ui| {
                self.streams.show(ui, snapshot, &self.desk.settings);
            });
        Panel::right("progress")
            .frame(other_side)
            .exact_size(300.0)
            .resizable(false)
            .show_separator_line(false)
            .show(ui, |ui| panels::progress(ui, snapshot, &self.desk));
        CentralPanel::no_frame().show(ui, |ui| {
            let area = ui.max_rect();
            self.scene.show(ui, snapshot, &self.desk.settings);
            panels::stage_caption(ui, area, snapshot, &self.desk);
        });
    }

    /// Screenshots, the end, and the keyboard.
    fn answer(&mut self, context: &Context, snapshot: &Snapshot) {
        let now_secs = context.input(|input| input.time);
        self.desk.now_secs = now_secs;
        if let Some(news) = self.screenshots.take_news() {
            self.desk.announce(news);
        }
        let due = |(_, after): &mut (PathBuf, f32)| now_secs >= f64::from(*after);
        if let Some((path, _)) = self.options.screenshot.take_if(due) {
            self.screenshots.take(context, path);
        }
        if std::mem::take(&mut self.desk.wants_screenshot) {
            self.screenshots
                .take(context, self.screenshot_path(now_secs));
        }
        let exit_after_secs = self.options.exit_after_secs;
        if snapshot.closing || exit_after_secs.is_some_and(|secs| now_secs >= f64::from(secs)) {
            context.send_viewport_cmd(ViewportCommand::Close);
        }
        if self.options.exit_after_secs.is_some() || self.options.screenshot.is_some() {
            context.request_repaint_after(Duration::from_millis(100));
        }
        self.answer_keys(context, snapshot);
    }

    fn answer_keys(&mut self, context: &Context, snapshot: &Snapshot) {
        let pressed = |key| context.input(|input| input.key_pressed(key));
        if let Some(playback) = snapshot.playback {
            if pressed(Key::Space) {
                let wish = if playback.paused {
                    UiCommand::Resume
                } else {
                    UiCommand::Pause
                };
                self.desk.send(wish);
            }
            if pressed(Key::Period) || pressed(Key::ArrowRight) {
                self.desk.send(UiCommand::Step);
            }
        }
        if pressed(Key::M) {
            self.desk.settings.mirror = !self.desk.settings.mirror;
        }
    }

    fn screenshot_path(&self, now_secs: f64) -> PathBuf {
        let folder = self.options.screenshot_folder.clone().unwrap_or_default();
        folder.join(format!("effigy-{:06.0}.png", now_secs * 10.0))
    }
}

impl Desk {
    /// Hands a wish to the pipeline, or says that it is too busy to take one.
    pub(super) fn send(&mut self, command: UiCommand) {
        if !self.commands.send(command) {
            self.announce("The pipeline is busy; try again in a moment".to_owned());
        }
    }

    pub(super) fn announce(&mut self, news: String) {
        self.news = Some((news, self.now_secs + NEWS_SECS));
    }

    /// The window's own line of news, while it is fresh.
    pub(super) fn news(&self) -> Option<&str> {
        let news = self
            .news
            .as_ref()
            .filter(|(_, until)| self.now_secs < *until);
        news.map(|(text, _)| text.as_str())
    }
}

impl eframe::App for Window {
    fn ui(&mut self, ui: &mut Ui, _: &mut eframe::Frame) {
        let snapshot = self.slot.latest();
        self.answer(&ui.ctx().clone(), &snapshot);
        let background = ui.visuals().panel_fill;
        ui.painter()
            .rect_filled(ui.max_rect(), egui::CornerRadius::ZERO, background);
        self.lay_out(ui, &snapshot);
    }

    fn on_exit(&mut self) {
        self.desk.send(UiCommand::Quit);
    }
}

fn wake_on_news(slot: &SnapshotSlot, context: &Context, software: bool) {
    let pause = if software { REDRAW_IN_SOFTWARE } else { REDRAW };
    let context = context.clone();
    slot.set_waker(move || context.request_repaint_after(pause));
}

fn adapter_line(info: &wgpu::AdapterInfo, software: bool) -> String {
    // Mesa adds its compiler's version in parentheses: of no use to anybody here.
    let name = info.name.split(" (").next().unwrap_or_default();
    let kind = if software { ", in software" } else { "" };
    format!("{name}{kind} ({:?})", info.backend)
}
