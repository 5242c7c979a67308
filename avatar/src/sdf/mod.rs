//! Signed distance fields in unit space: positive outside, negative inside.

pub mod batch;
mod config;
mod elementwise;
mod field;
mod kernel;
pub mod loss;
#[cfg(test)]
mod plain;
mod sincos;

use glam::Vec3;

pub use config::{OMEGA, SirenConfig};
pub use field::SirenField;
pub(crate) use sincos::sincos;

/// Anything that can be meshed and driven. Values are in unit-space lengths.
pub trait SignedDistanceField: Sync {
    /// One value a point; `out` is as long as `points`.
    fn values(&self, points: &[Vec3], out: &mut [f32]);

    /// Values and spatial gradients; all three slices have one length.
    fn values_and_gradients(&self, points: &[Vec3], values: &mut [f32], gradients: &mut [Vec3]);
}
