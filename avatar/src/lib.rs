//! The avatar: canonical samples, skinning, the neural signed distance field and its hypernetwork,
//! fine-tuning, meshing, live drive and export.
//!
//! In: `effigy_registration::RegisteredFrame`s. Out: an avatar that can be posed. Works in `canonical`
//! (star pose, metres) and `unit` space (canonical in [-1, 1]^3).

pub mod bake;
pub mod baselines;
pub mod canonicalise;
pub mod checkpoint;
pub mod drive;
pub mod error;
pub mod export;
pub mod fine_tune;
#[cfg(feature = "gpu")]
pub mod gpu;
pub mod hyper;
pub mod keyframes;
mod live_driver;
pub mod mesher;
pub mod meta;
pub mod metrics;
pub mod model;
mod neighbors;
pub mod nn;
pub mod pose_input;
pub mod rendered;
pub mod samples;
pub mod sdf;
pub mod skinning;
#[cfg(test)]
mod testing;

pub use bake::{Bake, BakeConfig, BakeError, MapConfig, ShapeMap};
pub use canonicalise::{CanonicaliseConfig, Canonicaliser};
pub use drive::{AvatarMesh, DriveConfig, Driver, extract_posed};
pub use error::AvatarError;
pub use keyframes::{KeyframeConfig, KeyframeSelector};
pub use live_driver::LiveDriver;
pub use model::{Avatar, PoseField, Subject, TopologyConfig};
pub use pose_input::PoseInput;
pub use samples::CanonicalSamples;
pub use sdf::SignedDistanceField;
