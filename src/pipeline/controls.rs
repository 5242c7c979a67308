//! What the window asks of a running pipeline.

use std::{
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
    thread,
    time::Duration,
};

use crossbeam::channel::{Receiver, never};
use effigy_viewer::UiCommand;

use super::{avatar_stage::AvatarStage, outputs::Outputs};
use crate::interrupt;

/// How often somebody who waits looks again.
const POLL: Duration = Duration::from_millis(20);

/// Commands come in here; capture looks at the pause.
#[derive(Clone)]
pub(crate) struct Controls {
    commands: Receiver<UiCommand>,
    paused: Arc<AtomicBool>,
}

impl Controls {
    /// Nobody asks anything.
    pub(crate) fn none() -> Self {
        Self::new(never())
    }

    pub(crate) fn new(commands: Receiver<UiCommand>) -> Self {
        Self { commands, paused: Arc::default() }
    }

    /// Waits while paused; says how long that was.
    pub(crate) fn wait_while_paused(&self) -> Duration {
        let mut waited = Duration::ZERO;
        while self.paused.load(Ordering::Relaxed) && !interrupt::requested() {
            thread::sleep(POLL);
            waited += POLL;
        }
        waited
    }

    /// Does what has been asked for since the last call.
    pub(crate) fn obey(&self, avatar: &mut AvatarStage, outputs: &Outputs) -> anyhow::Result<()> {
        for command in self.commands.try_iter() {
            match command {
                UiCommand::Pause => self.paused.store(true, Ordering::Relaxed),
                UiCommand::Resume => self.paused.store(false, Ordering::Relaxed),
                UiCommand::FineTune => {
                    if !avatar.start()? {
                        outputs.say("no keyframe yet: step into view, whole body");
                    }
                }
                UiCommand::CancelFineTuning => avatar.cancel(),
                UiCommand::StartOver => avatar.start_over(),
                UiCommand::ExportGlb => outputs.export_now(avatar.avatar())?,
                UiCommand::Quit => interrupt::request(),
                UiCommand::Step | UiCommand::Seek { .. } | UiCommand::Loop(_) => {
                    outputs.say("stepping and seeking come with a later version");
                }
            }
        }
        Ok(())
    }
}
