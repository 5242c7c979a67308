//! Cameras: pinhole intrinsics, lens distortion, rigid transforms.

mod brown_conrady;
mod intrinsics;
mod kannala_brandt;
mod model;
mod newton;
mod rigid;

pub use intrinsics::Intrinsics;
pub use model::{CameraModel, Distortion};
pub use rigid::Rigid3;
