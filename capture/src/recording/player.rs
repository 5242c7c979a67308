//! Playing a recording: forwards, again and again, from anywhere.

use std::path::Path;

use super::reader::Recording;
use crate::{calibration::Calibration, error::CaptureError, frame::Frame, source::FrameSource};

/// What comes after the last frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Repeat {
    #[default]
    Once,
    /// The first frame again, with its own id and time: the source's clock jumps back.
    Loop,
}

/// A recording with a position. Frames that cannot be read are skipped and counted.
pub struct Player {
    recording: Recording,
    next: usize,
    repeat: Repeat,
    skipped: u64,
    warned_at: Option<u64>,
}

impl Player {
    pub fn open(path: &Path) -> Result<Self, CaptureError> {
        Ok(Self::new(Recording::open(path)?))
    }

    pub fn new(recording: Recording) -> Self {
        Self { recording, next: 0, repeat: Repeat::Once, skipped: 0, warned_at: None }
    }

    pub fn recording(&self) -> &Recording {
        &self.recording
    }

    /// Continues with the frame that has an index; past the last one is the end.
    pub fn seek(&mut self, index: usize) {
        self.next = index.min(self.recording.frame_count());
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

    /// The next readable frame. A whole round without one is the end.
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
