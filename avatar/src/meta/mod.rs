//! Meta-learning of the prior over many people.
//!
//! `Field` (Reptile) finds `phi*`, a field from which any clothed person is a few steps away. `Joint` teaches the
//! hypernetwork how people's surfaces follow their poses: all people share it, each has a code of their own in
//! the coefficients, and `phi*` stays as it is. `Adapt` makes of it a start from which fine-tuning to eight
//! single views ends well. People come from the caller: this crate knows no simulator.

mod adapt;
mod batch;
mod checkpoint;
mod config;
mod joint;
mod reptile;
mod task;
#[cfg(test)]
mod tests;
mod train;
mod validation;

pub use config::{AdaptConfig, JointConfig, OuterStep, PriorConfig, ReptileConfig};
pub use task::{Person, PersonFrame, PersonSource};
pub use train::{
    PriorProgress, Stage, TrainEvent, Training, time_one_step, train_field, train_hyper,
};
pub use validation::{HeldOut, Validated, Validation};
