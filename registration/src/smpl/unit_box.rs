//! The unit box: canonical space scaled into [-1, 1]^3 by the minimal body.

use glam::Vec3;
use serde::{Deserialize, Serialize};

/// Room left on each side, as a share of the body's span (MetaAvatar).
const PADDING: f32 = 0.05;

/// Canonical metres to unit coordinates: `unit = 2 ((x - centre - min + pad) / (1.1 span) - 0.5)`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct UnitBox {
    pub center: Vec3,
    /// Smallest centred coordinate over all axes.
    pub min_m: f32,
    /// Largest minus smallest centred coordinate over all axes.
    pub span_m: f32,
}

impl UnitBox {
    /// The box of a minimal body in star pose, as MetaAvatar's code pads and scales it (docs/spaces.md). `None` for an empty body.
    pub fn from_canonical_body(vertices: &[Vec3]) -> Option<Self> {
        if vertices.is_empty() {
            return None;
        }
        let center = vertices.iter().sum::<Vec3>() / vertices.len() as f32;
        let min_m = vertices
            .iter()
            .map(|v| (*v - center).min_element())
            .fold(f32::MAX, f32::min);
        let max_m = vertices
            .iter()
            .map(|v| (*v - center).max_element())
            .fold(f32::MIN, f32::max);
        Some(Self { center, min_m, span_m: max_m - min_m })
    }

    pub fn unit_from_canonical(&self, point: Vec3) -> Vec3 {
        let share = (point - self.center - self.min_m + PADDING * self.span_m) / self.width_m();
        (share - 0.5) * 2.0
    }

    pub fn canonical_from_unit(&self, point: Vec3) -> Vec3 {
        (point * 0.5 + 0.5) * self.width_m() + self.min_m - PADDING * self.span_m + self.center
    }

    /// The length of one unit, in metres.
    pub fn metres_per_unit(&self) -> f32 {
        self.width_m() * 0.5
    }

    fn width_m(&self) -> f32 {
        (1.0 + 2.0 * PADDING) * self.span_m
    }
}
