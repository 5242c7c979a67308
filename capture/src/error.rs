//! What can go wrong with a source or a recording.

use std::path::{Path, PathBuf};

use crate::time::FrameId;

#[derive(Debug, thiserror::Error)]
pub enum CaptureError {
    #[error("a {what} image of {width}x{height} needs {} pixels, got {got}", *width as u64 * *height as u64)]
    PixelCount { what: &'static str, width: u32, height: u32, got: usize },
    #[error("{path}: {source}")]
    Io { path: PathBuf, source: std::io::Error },
    #[error("cannot create {path}: {source}; choose a folder that exists and may be written to")]
    CannotCreate { path: PathBuf, source: std::io::Error },
    #[error(
        "recording to {path} stopped after {frames_written} frames: {reason}; what was flushed before stays playable"
    )]
    RecorderFailed { path: PathBuf, frames_written: u64, reason: String },
    #[error(
        "{what} image is {}x{}, the calibration expects {}x{}: record with the calibration of this source",
        got_px[0], got_px[1], expected_px[0], expected_px[1]
    )]
    SizeMismatch { what: &'static str, got_px: [u32; 2], expected_px: [u32; 2] },
    #[error("{path}: {source}")]
    InFile { path: PathBuf, source: Box<Self> },
    #[error("the calibration's {field} is {found}, expected {expected}")]
    BadCalibration { field: &'static str, found: String, expected: &'static str },
    #[error("{path} is not a recording: it starts with {found}, expected the 8 bytes of MCAP")]
    NotARecording { path: PathBuf, found: String },
    #[error(
        "{path} holds nothing that Effigy can play: {reason}; expected an `effigy.recording` metadata record near \
         its start (see docs/recording_format.md)"
    )]
    NoCalibration { path: PathBuf, reason: String },
    #[error("{path}: the chunk at byte {at_byte} cannot be read: {reason}")]
    BadChunk { path: PathBuf, at_byte: u64, reason: String },
    #[error("{path}: {what} of frame {} cannot be read: {reason}", id.0)]
    BadFrame { path: PathBuf, id: FrameId, what: &'static str, reason: String },
    #[error("{path} has {count} frames, there is none with index {index}")]
    NoSuchFrame { path: PathBuf, index: usize, count: usize },
    #[error("{path}: {what} has {got} bytes, more than the {limit} that are read: {why}")]
    TooLarge { path: PathBuf, what: &'static str, got: u64, limit: u64, why: &'static str },
    #[error("{path}: {reason}")]
    BadImage { path: PathBuf, reason: String },
    #[error("{path}, line {line}: expected {expected}, found {found:?}")]
    BadLine { path: PathBuf, line: usize, expected: &'static str, found: String },
    #[error("{path} is not a readable point cloud: {reason}")]
    BadPointCloud { path: PathBuf, reason: String },
    #[error("{path} holds no depth images: expected {expected}")]
    EmptyFolder { path: PathBuf, expected: &'static str },
    #[error(
        "{path} starts with {found}, which is none of: an MCAP recording, an organised PCD cloud, a 16-bit PNG or PGM \
         depth image, a folder of depth images"
    )]
    UnknownSource { path: PathBuf, found: String },
}

impl CaptureError {
    /// For `map_err`: names the file of an error that does not.
    pub(crate) fn in_file(path: &Path) -> impl FnOnce(Self) -> Self + '_ {
        move |source| Self::InFile { path: path.to_owned(), source: Box::new(source) }
    }

    /// For `map_err`: an I/O error at a path.
    pub(crate) fn io(path: &Path) -> impl FnOnce(std::io::Error) -> Self + '_ {
        move |source| Self::Io { path: path.to_owned(), source }
    }
}
