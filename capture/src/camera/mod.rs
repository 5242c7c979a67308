//! Cameras: pinhole intrinsics, lens distortion, rigid transforms.

mod intrinsics;
mod model;
mod rigid;

pub use intrinsics::Intrinsics;
pub use model::{CameraModel, Distortion};
pub use rigid::Rigid3;
