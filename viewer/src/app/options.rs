//! What a caller may ask of the window.

use std::path::PathBuf;

/// How the window starts and ends.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ViewerOptions {
    /// Save a picture of the window after so many seconds.
    pub screenshot: Option<(PathBuf, f32)>,
    /// Close by itself after so many seconds.
    pub exit_after_secs: Option<f32>,
    /// Where the screenshot button saves; the working folder if not given.
    pub screenshot_folder: Option<PathBuf>,
}
