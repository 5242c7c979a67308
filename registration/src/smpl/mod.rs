//! SMPL: the model's arrays, its parameters, linear blend skinning, star pose and unit box.
//!
//! `rest` space is SMPL's zero pose (y up, facing +z, left = +x, metres). Equations: Loper et al. 2015,
//! and `docs/spaces.md`.

pub mod builtin;
mod identity;
mod jacobian;
mod joints;
mod lbs;
mod load;
pub mod mirror;
mod model;
pub mod npz;
mod params;
mod parts;
mod poser;
mod rodrigues;
mod star_pose;
mod unit_box;

pub use jacobian::{PARAMETER_COUNT, PoseJacobian};
pub use joints::{JOINT_COUNT, JOINT_NAMES, MEASURED_JOINTS, PARENTS};
pub use lbs::{BoneTransforms, PosedBody};
pub use model::{BodyIdentity, BodyModel, PoseDirection, SparseRow, VertexWeights};
pub use params::BodyParams;
pub use poser::Poser;
pub use rodrigues::rotation_from_axis_angle;
pub use star_pose::{STAR_HALF_ANGLE_RAD, star_transforms};
pub use unit_box::UnitBox;
