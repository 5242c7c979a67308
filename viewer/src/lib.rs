//! The window, and the same pictures as files.
//!
//! In: [`Snapshot`]s in world space (y up, metres) and the clean frames of the depth camera. Out: pictures
//! drawn on the CPU alone ([`pictures`]), and with the feature `window` a live view ([`app`]) that answers
//! with [`UiCommand`]s.

#[cfg(feature = "window")]
pub mod app;
pub mod commands;
pub mod error;
pub mod pictures;
pub mod snapshot;

#[cfg(feature = "window")]
pub use app::{ViewerOptions, run};
pub use commands::{CommandSender, Looping, UiCommand, command_channel};
pub use error::ViewerError;
pub use snapshot::{
    AvatarView, BodyView, CauseCount, KeyframesView, PerformanceView, PlaybackView, Snapshot,
    SnapshotSlot, SourceView, StageTiming, TrackState, TrainingView,
};
