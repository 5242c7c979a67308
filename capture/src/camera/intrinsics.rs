//! The pinhole.

use glam::{Vec2, Vec3, vec2, vec3};
use serde::{Deserialize, Serialize};

/// Pinhole intrinsics in pixels; pixel centres are at integers.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Intrinsics {
    pub width: u32,
    pub height: u32,
    pub fx: f32,
    pub fy: f32,
    pub cx: f32,
    pub cy: f32,
}

impl Intrinsics {
    /// Where a point in camera space falls, without distortion. The caller keeps z positive.
    #[inline]
    pub fn project(&self, point: Vec3) -> Vec2 {
        vec2(
            self.fx * point.x / point.z + self.cx,
            self.fy * point.y / point.z + self.cy,
        )
    }

    /// The point on a pixel's ray at a depth, without distortion.
    #[inline]
    pub fn unproject(&self, pixel: Vec2, depth_m: f32) -> Vec3 {
        vec3(
            (pixel.x - self.cx) / self.fx * depth_m,
            (pixel.y - self.cy) / self.fy * depth_m,
            depth_m,
        )
    }

    pub fn pixel_count(&self) -> usize {
        self.width as usize * self.height as usize
    }
}
