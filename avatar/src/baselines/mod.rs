//! What the avatar is compared with: other networks in the place of the hypernetwork and its SIREN, and other people's
//! ways of learning a body from the same frames.
//!
//! In: [`crate::CanonicalSamples`]. Out: a [`crate::PoseField`] that can be meshed and posed as ours is. Nothing here is
//! used by the live chain. How each is set: `docs/evaluation.md`.

mod architecture;
mod conditioned;
mod fit;
mod occupancy;
mod pose_code;
mod pose_map;

pub use architecture::Architecture;
pub use conditioned::ConditionedField;
pub use fit::fit;
pub use occupancy::BodyLabels;
pub(crate) use pose_code::{QUATERNION_NUMBERS, quaternions};
pub use pose_map::PoseMap;
