//! The live window: streams, body, avatar, fine-tuning, timing.

mod options;
mod panels;
mod run;
mod scene;
mod screenshot;
mod settings;
mod stream;
mod theme;
mod window;

pub use options::ViewerOptions;
pub use run::run;
