//! Fine-tuning: the meta-learned hypernetwork learns one person from a few keyframes.
//!
//! In: [`crate::CanonicalSamples`] (unit space). Out: a [`crate::hyper::HyperNetwork`] of that person. The
//! stage reads no clock: the caller passes one in.

mod config;
mod live_gradients;
pub(crate) mod sampling;
mod step;
#[cfg(test)]
pub(crate) mod tests;

pub use config::{FineTuneConfig, SamplingConfig};
pub use step::{FineTuneProgress, FineTuner, fine_tune};
