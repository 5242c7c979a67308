//! The loss of the field: surface, normals, eikonal, off-surface, near-surface and free space.
//!
//! With `f` the value and `g` the spatial gradient at a point of weight `w`:
//!
//! ```text
//! surface      3000 |f|  +  100 (1 - cos(g, n))        points the sensor measured
//! near         |f - d|                                 d along the normal from a measured point
//! free         max(0, d - f)                           seen to be empty, at least d from the surface
//! off-surface   100 exp(-100 |f|)                      anywhere in the box
//! eikonal        50 | |g| - 1 |                        every point
//! ```
//!
//! divided by the sum of all weights (MetaAvatar: means over all 2N points). A point of weight zero counts
//! in no term. The paper's own fine-tuning has no normals, no near and no free points, and repels what
//! failed the re-projection test: [`Known::Repelled`] with [`LossConfig::paper`].

use std::ops::AddAssign;

use glam::Vec3;
use serde::{Deserialize, Serialize};

/// What is known about the field at a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Known {
    /// On the surface; `normal` is zero where none was measured.
    Surface { normal: Vec3 },
    /// This signed distance from the surface, in unit lengths.
    Distance(f32),
    /// In free space, at least this far outside.
    Free { at_least: f32 },
    /// Nothing: a random point of the box, most likely not on the surface.
    Nothing,
    /// The paper's quirk: a measured point that failed the re-projection test is pushed off the surface;
    /// it is left out of the data terms' denominator.
    Repelled,
}

/// A point's knowledge and its weight in every term.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LossPoint {
    pub known: Known,
    pub weight: f32,
}

/// Weights of the terms.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LossConfig {
    pub surface: f32,
    pub normal: f32,
    pub eikonal: f32,
    pub off_surface: f32,
    /// `alpha` of `exp(-alpha |f|)`, per unit length.
    pub off_surface_sharpness: f32,
    /// Of the error of a known distance: the paper has no such points, this is the surface term's scale,
    /// lowered because an offset along a noisy normal is no exact distance.
    pub distance: f32,
    /// Of the violation of free space.
    pub free: f32,
}

impl LossConfig {
    /// MetaAvatar's weights.
    pub fn paper() -> Self {
        Self { distance: 0.0, free: 0.0, ..Self::default() }
    }
}

impl Default for LossConfig {
    fn default() -> Self {
        Self {
            surface: 3000.0,
            normal: 100.0,
            eikonal: 50.0,
            off_surface: 100.0,
            off_surface_sharpness: 100.0,
            distance: 1000.0,
            free: 1000.0,
        }
    }
}

/// The loss by term; the same units as the total.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct LossTerms {
    pub surface: f64,
    pub normal: f64,
    pub eikonal: f64,
    pub off_surface: f64,
    pub distance: f64,
    pub free: f64,
}

impl LossTerms {
    pub fn total(&self) -> f64 {
        self.surface + self.normal + self.eikonal + self.off_surface + self.distance + self.free
    }
}

impl AddAssign for LossTerms {
    fn add_assign(&mut self, other: Self) {
        self.surface += other.surface;
        self.normal += other.normal;
        self.eikonal += other.eikonal;
        self.off_surface += other.off_surface;
        self.distance += other.distance;
        self.free += other.free;
    }
}

/// One over the sums of weights that turn sums into means, known before the first point is evaluated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Scale {
    data: f32,
    eikonal: f32,
}

impl Scale {
    pub(crate) fn of<'a>(points: impl Iterator<Item = &'a LossPoint>) -> Self {
        let (mut data, mut all) = (0.0_f64, 0.0_f64);
        for point in points {
            all += f64::from(point.weight);
            if point.known != Known::Repelled {
                data += f64::from(point.weight);
            }
        }
        let inverse = |sum: f64| if sum > 0.0 { (1.0 / sum) as f32 } else { 0.0 };
        Self { data: inverse(data), eikonal: inverse(all) }
    }

    /// What a point of this weight counts in a mean over all data.
    pub(crate) fn of_data(self, weight: f32) -> f32 {
        self.data * weight
    }
}

/// The loss at one point and its derivatives by the value and by the spatial gradient.
#[inline]
pub(crate) fn point_loss(
    config: &LossConfig,
    scale: Scale,
    point: &LossPoint,
    value: f32,
    gradient: Vec3,
) -> (LossTerms, f32, Vec3) {
    let mut terms = LossTerms::default();
    let data = scale.data * point.weight;
    let length = gradient.length().max(1e-12);
    let direction = gradient / length;
    let eikonal = config.eikonal * scale.eikonal * point.weight;
    terms.eikonal = f64::from(eikonal * (length - 1.0).abs());
    let mut gradient_bar = direction * (eikonal * sign(length - 1.0));
    let value_bar = match point.known {
        Known::Surface { normal } => {
            terms.surface = f64::from(config.surface * data * value.abs());
            if normal != Vec3::ZERO {
                let cosine = direction.dot(normal);
                let weight = config.normal * data;
                terms.normal = f64::from(weight * (1.0 - cosine));
                gradient_bar -= (normal - direction * cosine) * (weight / length);
            }
            config.surface * data * sign(value)
        }
        Known::Distance(distance) => {
            let error = value - distance;
            terms.distance = f64::from(config.distance * data * error.abs());
            config.distance * data * sign(error)
        }
        Known::Free { at_least } => {
            let violation = (at_least - value).max(0.0);
            terms.free = f64::from(config.free * data * violation);
            -config.free * data * sign(violation)
        }
        Known::Nothing | Known::Repelled => {
            let alpha = config.off_surface_sharpness;
            let repulsion = config.off_surface * data * (-alpha * value.abs()).exp();
            terms.off_surface = f64::from(repulsion);
            -alpha * repulsion * sign(value)
        }
    };
    (terms, value_bar, gradient_bar)
}

/// -1, 0 or 1: the subgradient of the absolute value.
fn sign(x: f32) -> f32 {
    if x > 0.0 {
        1.0
    } else if x < 0.0 {
        -1.0
    } else {
        0.0
    }
}
