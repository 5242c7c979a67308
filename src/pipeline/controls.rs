//! What the window asks of a running pipeline.

use std::{
    sync::{Arc, Mutex, PoisonError},
    thread,
    time::Duration,
};

use crossbeam::channel::{Receiver, never};
use effigy_capture::{
    FrameSource,
    recording::{Player, Repeat},
};
use effigy_viewer::{Looping, PlaybackView, UiCommand};

use super::{avatar_stage::AvatarStage, outputs::Outputs, schedule::Decision};
use crate::interrupt;

/// How often somebody who waits looks again.
const POLL: Duration = Duration::from_millis(20);

/// Commands come in here; capture looks at what concerns playing.
#[derive(Clone)]
pub(crate) struct Controls {
    commands: Receiver<UiCommand>,
    playing: Arc<Mutex<Playing>>,
}

/// How the source is to be played.
#[derive(Clone, Copy, Debug, Default)]
struct Playing {
    paused: bool,
    steps: u32,
    seek: Option<u64>,
    looping: bool,
}

/// What capture has to do before the next frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Steered {
    /// Time has passed that the source's clock knows nothing of.
    pub(crate) waited: bool,
    /// The next frame is not the one after the last.
    pub(crate) jumped: bool,
}

impl Controls {
    /// Nobody asks anything.
    pub(crate) fn none() -> Self {
        Self::new(never())
    }

    pub(crate) fn new(commands: Receiver<UiCommand>) -> Self {
        Self { commands, playing: Arc::default() }
    }

    /// Before each frame: waits while paused (and not `stopped`), goes where the user wants to.
    pub(crate) fn steer(
        &self,
        source: &mut dyn FrameSource,
        stopped: impl Fn() -> bool,
    ) -> Steered {
        let mut steered = Steered::default();
        loop {
            let playing = self.take_wishes();
            if let Some(player) = source.player() {
                player.repeat(if playing.looping {
                    Repeat::Loop
                } else {
                    Repeat::Once
                });
                if let Some(index) = playing.seek {
                    player.seek(usize::try_from(index).unwrap_or(usize::MAX));
                    steered.jumped = true;
                }
            }
            // A seek shows where it led to, even while paused.
            let goes_on = !playing.paused || playing.steps > 0 || playing.seek.is_some();
            if goes_on || stopped() {
                return steered;
            }
            thread::sleep(POLL);
            steered.waited = true;
        }
    }

    /// Where a recording stands after a frame; `None` for a live source.
    pub(crate) fn playback(&self, player: Option<&mut Player>) -> Option<PlaybackView> {
        let player = player?;
        let playing = self.lock();
        Some(PlaybackView {
            frame: (player.position() as u64).saturating_sub(1),
            frame_count: Some(player.recording().frame_count() as u64),
            paused: playing.paused,
            looping: playing.looping,
        })
    }

    /// Whether the user has paused.
    pub(crate) fn paused(&self) -> bool {
        self.lock().paused
    }

    /// Does what has been asked for since the last call.
    pub(crate) fn obey(&self, avatar: &mut AvatarStage, outputs: &Outputs) -> anyhow::Result<()> {
        for command in self.commands.try_iter() {
            match command {
                UiCommand::Pause => self.lock().paused = true,
                UiCommand::Resume => self.lock().paused = false,
                UiCommand::Step => self.lock().steps += 1,
                UiCommand::Seek { frame } => self.lock().seek = Some(frame),
                UiCommand::Loop(looping) => self.lock().looping = looping == Looping::Forever,
                UiCommand::FineTune if avatar.keyframe_count() == 0 => {
                    outputs.say("no keyframe yet: step into view, whole body");
                }
                UiCommand::FineTune => avatar.request(Decision::Begin),
                UiCommand::CancelFineTuning => avatar.request(Decision::Cancel),
                UiCommand::StartOver => avatar.request(Decision::StartOver),
                UiCommand::ExportGlb => outputs.export_now(avatar.avatar())?,
                UiCommand::Quit => interrupt::request(),
            }
        }
        Ok(())
    }

    /// The wishes as they are; a step and a seek are granted once.
    fn take_wishes(&self) -> Playing {
        let mut playing = self.lock();
        let wishes = *playing;
        playing.seek = None;
        playing.steps = playing.steps.saturating_sub(1);
        wishes
    }

    fn lock(&self) -> std::sync::MutexGuard<'_, Playing> {
        self.playing.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
