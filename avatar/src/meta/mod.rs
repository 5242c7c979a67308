//! Meta-learning of the prior over many people.
//!
//! Stage 1 (Reptile) finds `phi*`, a field from which any clothed person is a few steps away. Stage 2 teaches
//! the hypernetwork how people's surfaces follow their poses: all people share it, each has a code of their
//! own in the coefficients, and `phi*` stays as it is. People come from the caller: this crate knows no
//! simulator.

mod checkpoint;
mod config;
mod joint;
mod reptile;
mod task;
#[cfg(test)]
mod tests;
mod train;

pub use config::{JointConfig, PriorConfig, ReptileConfig};
pub use task::{Person, PersonFrame, PersonSource};
pub use train::{PriorProgress, Stage, train_prior};
