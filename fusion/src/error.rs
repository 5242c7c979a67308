//! What can go wrong in fusion and in mesh files.

use std::path::PathBuf;

#[derive(Debug, thiserror::Error)]
pub enum FusionError {
    #[error(
        "depth image is {got_px:?}, calibration expects {expected_px:?}; replay it with its own calibration"
    )]
    SizeMismatch { got_px: [u32; 2], expected_px: [u32; 2] },
    #[error("{path}: {source}")]
    Io { path: PathBuf, source: std::io::Error },
}
