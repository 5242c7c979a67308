//! The live window: streams, body, avatar, fine-tuning, timing.

mod options;
mod run;

pub use options::ViewerOptions;
pub use run::run;
