//! Playing a recording: forwards, again and again, one frame at a time, from anywhere.

use std::path::Path;

use super::reader::Recording;
use crate::{
    calibration::Calibration,
    error::CaptureError,
    frame::Frame,
    source::FrameSource,
    time::{FrameId, Timestamp},
};

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum PlayState {
    #[default]
    Playing,
    Paused,
}

/// What comes after the last frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Repeat {
    #[default]
    Once,
    /// The first frame again, with its own id and time: the source's clock jumps back.
    Loop,
}

/// What a player has to show.
#[derive(Clone, Debug)]
pub enum Played {
    Frame(Frame),
    /// Paused, and no step is due.
    Paused,
    Ended,
}

/// A recording with a position. Frames that cannot be read are skipped and counted.
pub struct Player {
    recording: Recording,
    next: usize,
    state: PlayState,
    steps: u32,
    repeat: Repeat,
    skipped: u64,
    warned_at: Option<u64>,
}

impl Player {
    pub fn open(path: &Path) -> Result<Self, CaptureError> {
        Ok(Self::new(Recording::open(path)?))
    }

    pub fn new(recording: Recording) -> Self {
        Self {
            recording,
            next: 0,
            state: PlayState::Playing,
            steps: 0,
            repeat: Repeat::Once,
            skipped: 0,
            warned_at: None,
        }
    }

    pub fn repeating(self, repeat: Repeat) -> Self {
        Self { repeat, ..self }
    }

    pub fn recording(&self) -> &Recording {
        &self.recording
    }

    pub fn state(&self) -> PlayState {
        self.state
    }

    pub fn pause(&mut self) {
        self.state = PlayState::Paused;
    }

    pub fn resume(&mut self) {
        self.state = PlayState::Playing;
        self.steps = 0;
    }

    /// While paused: one frame more.
    pub fn step(&mut self) {
        if self.state == PlayState::Paused {
            self.steps += 1;
        }
    }

    /// Continues with the frame that has an index; past the last one is the end.
    pub fn seek(&mut self, index: usize) {
        self.next = index.min(self.recording.frame_count());
    }

    /// Continues with the first frame at or after a time.
    pub fn seek_time(&mut self, time: Timestamp) {
        self.next = self.recording.index_at(time);
    }

    /// Continues with the frame that has an id; `false`, and nothing changes, if there is none.
    pub fn seek_id(&mut self, id: FrameId) -> bool {
        let index = self.recording.index_of(id);
        self.next = index.unwrap_or(self.next);
        index.is_some()
    }

    /// What comes after the last frame from now on.
    pub fn repeat(&mut self, repeat: Repeat) {
        self.repeat = repeat;
    }

    /// The index of the frame that comes next.
    pub fn position(&self) -> usize {
        self.next
    }

    /// How many frames could not be read so far.
    pub fn skipped(&self) -> u64 {
        self.skipped
    }

    /// The next frame, if playing or a step is due.
    pub fn poll(&mut self) -> Result<Played, CaptureError> {
        if self.state == PlayState::Paused && self.steps == 0 {
            return Ok(Played::Paused);
        }
        let played = match self.advance()? {
            Some(frame) => Played::Frame(frame),
            None => Played::Ended,
        };
        self.steps = self.steps.saturating_sub(1);
        Ok(played)
    }

    /// The next readable frame, whether paused or not. A whole round without one is the end.
    fn advance(&mut self) -> Result<Option<Frame>, CaptureError> {
        for _ in 0..=self.recording.frame_count() {
            if self.next >= self.recording.frame_count() {
                if self.repeat == Repeat::Once {
                    return Ok(None);
                }
                self.next = 0;
            }
            let frame = self.recording.frame(self.next);
            self.next += 1;
            match frame {
                Ok(frame) => return Ok(Some(frame)),
                Err(error) => self.skip(error)?,
            }
        }
        Ok(None)
    }

    /// Damage is skipped, with one warning a chunk; all else is an error.
    fn skip(&mut self, error: CaptureError) -> Result<(), CaptureError> {
        match &error {
            CaptureError::BadChunk { at_byte, .. } => {
                if self.warned_at != Some(*at_byte) {
                    tracing::warn!("{error}; its frames are skipped");
                    self.warned_at = Some(*at_byte);
                }
            }
            CaptureError::BadFrame { .. } => tracing::warn!("{error}; it is skipped"),
            CaptureError::NoSuchFrame { .. } => return Ok(()),
            _ => return Err(error),
        }
        self.skipped += 1;
        Ok(())
    }
}

impl FrameSource for Player {
    fn name(&self) -> String {
        format!("recording {}", self.recording.path().display())
    }

    fn calibration(&self) -> &Calibration {
        self.recording.calibration()
    }

    /// While paused each call is a step: use [`Player::poll`] where somebody may pause.
    fn next_frame(&mut self) -> Result<Option<Frame>, CaptureError> {
        self.advance()
    }

    fn frame_count(&self) -> Option<u64> {
        match self.repeat {
            Repeat::Once => Some(self.recording.frame_count() as u64),
            Repeat::Loop => None,
        }
    }

    fn player(&mut self) -> Option<&mut Player> {
        Some(self)
    }
}
