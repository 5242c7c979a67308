//! Opens the window and says plainly why it cannot.

use std::{
    panic::{self, AssertUnwindSafe, PanicHookInfo},
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
    thread,
};

use eframe::{egui, egui_wgpu};

use super::{ViewerOptions, window::Window};
use crate::{CommandSender, SnapshotSlot, ViewerError};

const SIZE_POINTS: [f32; 2] = [1280.0, 800.0];
const SMALLEST_POINTS: [f32; 2] = [900.0, 560.0];

type PanicHook = dyn Fn(&PanicHookInfo<'_>) + Send + Sync;

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
        viewport: egui::ViewportBuilder::default()
            .with_title("Effigy")
            .with_app_id("effigy")
            .with_inner_size(SIZE_POINTS)
            .with_min_inner_size(SMALLEST_POINTS),
        renderer: eframe::Renderer::Wgpu,
        centered: true,
        ..eframe::NativeOptions::default()
    };
    quiet_until_open(|opened| {
        let create: eframe::AppCreator<'_> = Box::new(move |creation| {
            let window = Window::new(creation, slot, commands, options)?;
            opened.store(true, Ordering::Relaxed);
            Ok(Box::new(window))
        });
        eframe::run_native("Effigy", native, create).map_err(|error| explain(&error))
    })
}

/// Turns a panic before the window is open into an error: that is how the window library reports that one
/// of the system's libraries is not installed. A panic afterwards stays one.
fn quiet_until_open(
    show: impl FnOnce(&AtomicBool) -> Result<(), ViewerError>,
) -> Result<(), ViewerError> {
    let opened = Arc::new(AtomicBool::new(false));
    let usual: Arc<PanicHook> = Arc::from(panic::take_hook());
    let (hook, open, here) = (
        Arc::clone(&usual),
        Arc::clone(&opened),
        thread::current().id(),
    );
    panic::set_hook(Box::new(move |panic| {
        if open.load(Ordering::Relaxed) || thread::current().id() != here {
            hook(panic);
        }
    }));
    let shown = panic::catch_unwind(AssertUnwindSafe(|| show(&opened)));
    panic::set_hook(Box::new(move |panic| usual(panic)));
    shown.unwrap_or_else(|payload| {
        if opened.load(Ordering::Relaxed) {
            panic::resume_unwind(payload);
        }
        let text = payload.downcast_ref::<String>().map(String::as_str);
        let text = text.or_else(|| payload.downcast_ref::<&str>().copied());
        Err(ViewerError::NoDisplay { detail: short(text.unwrap_or("the window library failed")) })
    })
}

fn explain(error: &eframe::Error) -> ViewerError {
    let detail = short(&error.to_string());
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

/// The library's message without the place in its sources, without its full stop, on one line.
fn short(message: &str) -> String {
    let said = match message.rsplit_once(".rs:") {
        Some((_, place)) => place.trim_start_matches(|c: char| c.is_ascii_digit() || c == ':'),
        None => message.strip_prefix("WGPU error: ").unwrap_or(message),
    };
    let line = said.lines().next().unwrap_or_default().trim();
    line.trim_end_matches(['.', '{', '}', ':', ' ']).to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_missing_system_library_is_an_error_and_not_a_panic() {
        let missing = quiet_until_open(|_| panic!("Library libx.so could not be loaded."));
        let message = missing.expect_err("it panicked").to_string();
        assert!(
            message.contains("(Library libx.so could not be loaded)"),
            "{message}"
        );
    }

    #[test]
    fn a_librarys_message_loses_its_source_path() {
        let message = "winit EventLoopError: os error at /x/mod.rs:765: DISPLAY is not set.";
        assert_eq!(short(message), "DISPLAY is not set");
        let message = "WGPU error: Failed to create surface for any enabled backend: {}";
        assert_eq!(
            short(message),
            "Failed to create surface for any enabled backend"
        );
    }
}
