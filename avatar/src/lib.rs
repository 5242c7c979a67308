//! The avatar: canonical samples, skinning, the neural signed distance field and its hypernetwork,
//! fine-tuning, meshing, live drive and export.
//!
//! In: `effigy_registration::RegisteredFrame`s. Out: an avatar that can be posed. Works in `canonical`
//! (star pose, metres) and `unit` space (canonical in [-1, 1]^3).

pub mod pose_input;
pub mod samples;
pub mod sdf;

pub use pose_input::PoseInput;
pub use samples::CanonicalSamples;
pub use sdf::SignedDistanceField;
