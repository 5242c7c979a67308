//! Where frames come from.

use std::path::Path;

use crate::{calibration::Calibration, error::CaptureError, frame::Frame, recording::Player};

/// A sensor, a recording or a simulator.
pub trait FrameSource: Send {
    /// What the source is, for people: "recording s.mcap", "simulated azure".
    fn name(&self) -> String;

    fn calibration(&self) -> &Calibration;

    /// The next frame in order; `None` at the end. Blocks while a live sensor has nothing new.
    fn next_frame(&mut self) -> Result<Option<Frame>, CaptureError>;

    /// How many frames there are in all, where that is known.
    fn frame_count(&self) -> Option<u64> {
        None
    }
}

/// Opens a recording.
pub fn open(path: &Path) -> Result<Box<dyn FrameSource>, CaptureError> {
    Ok(Box::new(Player::open(path)?))
}
