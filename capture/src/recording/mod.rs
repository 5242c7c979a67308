//! Recordings: MCAP files that other tools open, too. The format is in `docs/recording_format.md`.
//!
//! [`RecordingWriter`] writes on a thread of its own, [`Recording`] is random access, [`Player`] plays.

mod chunk;
mod damage;
mod descriptor;
mod format;
mod foxglove;
mod info;
mod outline;
mod player;
mod reader;
mod recorder;
mod records;
mod scan;
mod sink;
mod writer;

pub use damage::Damage;
pub use info::{Info, info};
pub use player::{Player, Repeat};
pub use reader::{Event, Recording};
pub use writer::{DropCounts, Pushed, RecordConfig, RecordingSummary, RecordingWriter};

pub use crate::codec::color::ColorCodec;
pub(crate) use format::MAGIC;
