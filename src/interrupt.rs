//! Ctrl-C: asked for once, everything ends in order; asked for twice, at once.

use std::{
    error::Error,
    fmt,
    path::Path,
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
pub(crate) struct Stopped(String);

impl Stopped {
    /// What is there is found by the same command.
    pub(crate) fn on_the_way() -> Self {
        Self("the same command goes on from here".to_owned())
    }

    /// What was done till then was printed and written.
    pub(crate) fn early() -> Self {
        Self("the table holds what was done till then".to_owned())
    }

    /// A file that ends before what it was to hold.
    pub(crate) fn short(path: &Path, frames: u64) -> Self {
        Self(format!(
            "{} holds the {frames} frames till then",
            path.display()
        ))
    }

    /// What is there is found with `--resume`.
    pub(crate) fn at_checkpoint(checkpoint: &Path) -> Self {
        Self(format!("`--resume` goes on from {}", checkpoint.display()))
    }
}

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
