//! Ctrl-C: asked for once, everything ends in order; asked for twice, at once.

use std::{
    error::Error,
    fmt,
    sync::atomic::{AtomicBool, Ordering},
};

use anyhow::Context as _;

static REQUESTED: AtomicBool = AtomicBool::new(false);

/// The shell's code for "ended by an interrupt".
pub(crate) const EXIT_INTERRUPTED: u8 = 130;

/// Catches Ctrl-C for the rest of the program.
#[expect(clippy::exit, reason = "a second Ctrl-C means now")]
pub(crate) fn install() -> anyhow::Result<()> {
    ctrlc::set_handler(|| {
        if REQUESTED.swap(true, Ordering::Relaxed) {
            std::process::exit(EXIT_INTERRUPTED.into());
        }
    })
    .context("cannot catch Ctrl-C")
}

/// Ended in order by Ctrl-C before the work was done, and how to go on: what follows in a script must not start.
#[derive(Debug)]
pub(crate) struct Stopped(pub(crate) String);

impl fmt::Display for Stopped {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "stopped; {}", self.0)
    }
}

impl Error for Stopped {}

/// As if Ctrl-C had been pressed.
pub(crate) fn request() {
    REQUESTED.store(true, Ordering::Relaxed);
}

/// Whether the user wants to stop.
pub(crate) fn requested() -> bool {
    REQUESTED.load(Ordering::Relaxed)
}
