//! Rigid motions between spaces.

use std::ops::Mul;

use glam::{Mat3, Quat, Vec3};
use serde::{Deserialize, Serialize};

/// A rotation followed by a translation; name it `b_from_a` and write `point_in_b = b_from_a * point_in_a`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Rigid3 {
    pub rotation: Quat,
    pub translation: Vec3,
}

impl Rigid3 {
    pub const IDENTITY: Self = Self { rotation: Quat::IDENTITY, translation: Vec3::ZERO };

    #[inline]
    pub fn inverse(self) -> Self {
        let rotation = self.rotation.inverse();
        Self { rotation, translation: -(rotation * self.translation) }
    }

    /// Rotates a direction; the translation does not apply.
    #[inline]
    pub fn rotate(self, direction: Vec3) -> Vec3 {
        self.rotation * direction
    }

    #[inline]
    pub fn rotation_matrix(self) -> Mat3 {
        Mat3::from_quat(self.rotation)
    }
}

impl Default for Rigid3 {
    fn default() -> Self {
        Self::IDENTITY
    }
}

impl Mul<Vec3> for Rigid3 {
    type Output = Vec3;

    #[inline]
    fn mul(self, point: Vec3) -> Vec3 {
        self.rotation * point + self.translation
    }
}

impl Mul for Rigid3 {
    type Output = Self;

    #[inline]
    fn mul(self, c_from_a: Self) -> Self {
        Self {
            rotation: (self.rotation * c_from_a.rotation).normalize(),
            translation: self * c_from_a.translation,
        }
    }
}
