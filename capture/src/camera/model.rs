//! A pinhole with a lens in front of it.

use serde::{Deserialize, Serialize};

use super::Intrinsics;

/// Lens distortion, with the coefficients in OpenCV's order.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub enum Distortion {
    #[default]
    None,
    /// `k1, k2, p1, p2, k3, k4, k5, k6`: the rational model; `k4..k6` are 0 for plumb-bob.
    BrownConrady([f32; 8]),
    /// `k1..k4` of the equidistant fisheye model.
    KannalaBrandt([f32; 4]),
}

#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct CameraModel {
    pub intrinsics: Intrinsics,
    pub distortion: Distortion,
}

impl From<Intrinsics> for CameraModel {
    fn from(intrinsics: Intrinsics) -> Self {
        Self { intrinsics, distortion: Distortion::None }
    }
}
