//! The window on the main thread, the pipeline beside it.

use std::{
    panic::resume_unwind,
    path::{Path, PathBuf},
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
    thread,
    time::Duration,
};

use anyhow::Context as _;
use effigy_viewer::{SnapshotSlot, ViewerError, ViewerOptions, command_channel, run};

use crate::{interrupt, pipeline::controls::Controls};

/// Wishes that wait; more are refused.
const COMMANDS: usize = 16;

/// How often the pipeline looks whether the window is there.
const POLL: Duration = Duration::from_millis(5);

/// Whether there was a window to show.
pub(crate) enum Shown {
    Closed,
    /// One clear line why not; nothing has run.
    Impossible(ViewerError),
}

/// Shows the window while `pipeline` runs beside it; closing the window ends the pipeline in order.
///
/// `pictures`: the folder that the window's own button saves into.
pub(crate) fn show(
    picture: Option<(PathBuf, f32)>,
    pictures: &Path,
    exit_after_secs: Option<f32>,
    pipeline: impl FnOnce(Arc<SnapshotSlot>, Controls) -> anyhow::Result<()> + Send,
) -> anyhow::Result<Shown> {
    let slot = Arc::new(SnapshotSlot::new());
    let (sender, commands) = command_channel(COMMANDS);
    let options = ViewerOptions {
        screenshot: picture,
        exit_after_secs,
        screenshot_folder: Some(pictures.to_owned()),
    };
    let no_window = AtomicBool::new(false);
    thread::scope(|scope| {
        let shared = Arc::clone(&slot);
        let no_window = &no_window;
        let worker = thread::Builder::new()
            .name("pipeline".to_owned())
            .spawn_scoped(scope, move || {
                while !shared.is_watched() {
                    if no_window.load(Ordering::Relaxed) {
                        return Ok(());
                    }
                    thread::sleep(POLL);
                }
                let worked = pipeline(Arc::clone(&shared), Controls::new(commands));
                // What went well stays to be looked at; an error is for the terminal.
                if worked.is_err() || interrupt::requested() {
                    shared.update(|snapshot| snapshot.closing = true);
                }
                worked
            })
            .context("cannot start the pipeline thread")?;
        let shown = run(Arc::clone(&slot), sender, options);
        let was_there = slot.is_watched();
        if shown.is_err() && !was_there {
            no_window.store(true, Ordering::Relaxed);
        } else {
            interrupt::request();
        }
        let worked = worker.join().unwrap_or_else(|panic| resume_unwind(panic));
        match shown {
            Ok(()) => worked.map(|()| Shown::Closed),
            Err(error) if was_there => Err(error.into()),
            Err(error) => Ok(Shown::Impossible(error)),
        }
    })
}
