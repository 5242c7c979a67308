//! What can go wrong with pictures and with the window.

use std::path::PathBuf;

#[derive(Debug, thiserror::Error)]
pub enum ViewerError {
    #[error("cannot write the picture {path}: {source}; is the folder there and writable?")]
    Picture { path: PathBuf, source: image::ImageError },
    #[error("no display to open a window on ({detail}); run with --headless to get files instead")]
    NoDisplay { detail: String },
    #[error(
        "no graphics adapter that can draw ({detail}); install Mesa's Vulkan or GL driver, or run with --headless"
    )]
    NoAdapter { detail: String },
    #[error("the window closed with an error: {detail}; --headless runs without one")]
    Window { detail: String },
}
