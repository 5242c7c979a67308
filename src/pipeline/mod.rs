//! The stages put together: the only threads, the only clock, and who waits for whom.

pub(crate) mod avatar_job;
pub(crate) mod avatar_stage;
pub(crate) mod clock;
pub(crate) mod controls;
pub(crate) mod devices;
pub(crate) mod evaluate;
#[cfg_attr(not(feature = "gpu"), path = "no_graphics_card.rs")]
mod graphics_card;
pub(crate) mod lock_step;
pub(crate) mod outputs;
pub(crate) mod pictures;
pub(crate) mod poses;
pub(crate) mod publish;
pub(crate) mod real_time;
pub(crate) mod recorder;
pub(crate) mod refine;
pub(crate) mod run_log;
pub(crate) mod schedule;
pub(crate) mod settings;
pub(crate) mod track_stage;
