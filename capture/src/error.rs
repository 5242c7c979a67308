//! What can go wrong with a source or a recording.

use std::path::PathBuf;

#[derive(Debug, thiserror::Error)]
pub enum CaptureError {
    #[error("a {what} image of {width}x{height} needs {} pixels, got {got}", *width as u64 * *height as u64)]
    PixelCount { what: &'static str, width: u32, height: u32, got: usize },
    #[error("{path}: {source}")]
    Io { path: PathBuf, source: std::io::Error },
}
