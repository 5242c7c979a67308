//! A single frame as a source: one depth image, or a cloud.

use std::{path::Path, sync::Arc};

use super::{
    intrinsics::{self, Layout},
    read_depth,
};
use crate::{
    calibration::Calibration,
    error::CaptureError,
    frame::Frame,
    source::FrameSource,
    time::{FrameId, Timestamp},
};

/// One frame, once.
pub struct Still {
    name: String,
    calibration: Calibration,
    frame: Option<Frame>,
}

impl Still {
    pub fn new(name: String, calibration: Calibration, frame: Frame) -> Self {
        Self { name, calibration, frame: Some(frame) }
    }

    /// A 16-bit PNG or PGM. Its camera comes from `calibration.json` or `intrinsics.txt` beside it, else from defaults.
    pub fn open_depth_image(path: &Path) -> Result<Self, CaptureError> {
        let depth = read_depth(path)?;
        let folder = path
            .parent()
            .filter(|parent| !parent.as_os_str().is_empty())
            .unwrap_or(Path::new("."));
        let calibration =
            intrinsics::of_folder(folder, [depth.width(), depth.height()], Layout::Plain)?;
        let frame =
            Frame { id: FrameId(0), timestamp: Timestamp(0), depth: Arc::new(depth), color: None };
        Ok(Self::new(
            format!("depth image {}", path.display()),
            calibration,
            frame,
        ))
    }
}

impl FrameSource for Still {
    fn name(&self) -> String {
        self.name.clone()
    }

    fn calibration(&self) -> &Calibration {
        &self.calibration
    }

    fn next_frame(&mut self) -> Result<Option<Frame>, CaptureError> {
        Ok(self.frame.take())
    }

    fn frame_count(&self) -> Option<u64> {
        Some(1)
    }
}
