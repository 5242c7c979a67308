//! Opens the window and says plainly why it cannot.

use std::sync::Arc;

use eframe::{egui, egui_wgpu};

use super::ViewerOptions;
use crate::{CommandSender, SnapshotSlot, ViewerError};

/// Shows the latest snapshots until the window is closed; call it on the main thread.
///
/// Without a display or a graphics adapter it returns at once with [`ViewerError::NoDisplay`] or
/// [`ViewerError::NoAdapter`].
pub fn run(
    slot: Arc<SnapshotSlot>,
    commands: CommandSender,
    options: ViewerOptions,
) -> Result<(), ViewerError> {
    let native = eframe::NativeOptions {
        viewport: egui::ViewportBuilder::default().with_title("Effigy"),
        renderer: eframe::Renderer::Wgpu,
        ..eframe::NativeOptions::default()
    };
    let create: eframe::AppCreator<'_> =
        Box::new(move |_| Ok(Box::new(First { slot, commands, options })));
    eframe::run_native("Effigy", native, create).map_err(|error| explain(&error))
}

struct First {
    slot: Arc<SnapshotSlot>,
    commands: CommandSender,
    options: ViewerOptions,
}

impl eframe::App for First {
    fn ui(&mut self, ui: &mut egui::Ui, _: &mut eframe::Frame) {
        ui.label(self.slot.latest().state.label());
        ui.label(format!("{:?} {:?}", self.commands, self.options));
    }
}

fn explain(error: &eframe::Error) -> ViewerError {
    let detail = error.to_string();
    match error {
        eframe::Error::WinitEventLoop(_) | eframe::Error::Winit(_) => {
            ViewerError::NoDisplay { detail }
        }
        eframe::Error::Wgpu(
            egui_wgpu::WgpuError::RequestAdapterError(_)
            | egui_wgpu::WgpuError::RequestDeviceError(_)
            | egui_wgpu::WgpuError::CreateSurfaceError(_),
        ) => ViewerError::NoAdapter { detail },
        _ => ViewerError::Window { detail },
    }
}
