//! Ctrl-C: asked for once, everything ends in order; asked for twice, at once.

use std::sync::atomic::{AtomicBool, Ordering};

use anyhow::Context as _;

static REQUESTED: AtomicBool = AtomicBool::new(false);

/// The shell's code for "ended by an interrupt".
const EXIT_INTERRUPTED: i32 = 130;

/// Catches Ctrl-C for the rest of the program.
#[expect(clippy::exit, reason = "a second Ctrl-C means now")]
pub(crate) fn install() -> anyhow::Result<()> {
    ctrlc::set_handler(|| {
        if REQUESTED.swap(true, Ordering::Relaxed) {
            std::process::exit(EXIT_INTERRUPTED);
        }
    })
    .context("cannot catch Ctrl-C")
}

/// As if Ctrl-C had been pressed.
pub(crate) fn request() {
    REQUESTED.store(true, Ordering::Relaxed);
}

/// Whether the user wants to stop.
pub(crate) fn requested() -> bool {
    REQUESTED.load(Ordering::Relaxed)
}
