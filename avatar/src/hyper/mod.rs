//! The hypernetwork: a pose becomes the parameters of a signed distance field.
//!
//! `phi(pose) = phi* + residual(pose)`: `phi*` is the meta-learned field of people in general, the residual
//! comes from a hierarchical bone encoder and one head a layer of the field.

pub(crate) mod blob;
mod config;
pub(crate) mod heads;
pub(crate) mod network;
pub(crate) mod optimizer;
pub(crate) mod pose_encoder;
mod prior;

pub use blob::{Precision, decode_field};
pub use config::{HeadKind, HyperConfig};
pub use network::{HyperNetwork, Provenance};
pub use optimizer::RateConfig;
pub use prior::{PRIOR_CONFIG, prior};
