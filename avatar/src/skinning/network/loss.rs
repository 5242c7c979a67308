//! What is wrong with some weights: how far they are from the true ones, and where that puts the points.

use effigy_registration::smpl::JOINT_COUNT;
use glam::Vec3;
use serde::{Deserialize, Serialize};

use crate::skinning::{BoneWeights, Warp};

/// What counts how much.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SkinningLossConfig {
    /// Of the cross-entropy of the weights: it pulls hardest where the answer is wrong, where absolute differences
    /// of saturated shares hardly pull at all.
    pub entropy: f32,
    /// Of the sum of absolute differences of the weights.
    pub weights: f32,
    /// Of a metre between a point and its true place.
    pub place_a_metre: f32,
    /// Of the absolute differences of the two networks' weights.
    pub agreement: f32,
    /// Points at which the closest body point is wrong count this much more.
    pub doubtful: f32,
}

impl Default for SkinningLossConfig {
    fn default() -> Self {
        Self { entropy: 1.0, weights: 0.5, place_a_metre: 20.0, agreement: 0.05, doubtful: 3.0 }
    }
}

/// 24 shares that sum to one, of 24 numbers.
pub(super) fn softmax(logits: &[f32]) -> BoneWeights {
    let largest = logits.iter().copied().fold(f32::NEG_INFINITY, f32::max);
    let mut shares: BoneWeights = std::array::from_fn(|bone| (logits[bone] - largest).exp());
    let sum: f32 = shares.iter().sum();
    for share in &mut shares {
        *share /= sum;
    }
    shares
}

/// The gradient by the logits.
pub(super) fn softmax_backward(shares: &BoneWeights, bar: &BoneWeights) -> BoneWeights {
    let mean: f32 = shares.iter().zip(bar).map(|(share, bar)| share * bar).sum();
    std::array::from_fn(|bone| shares[bone] * (bar[bone] - mean))
}

/// `-sum b ln a` and its change by `a`.
pub(super) fn cross_entropy(a: &BoneWeights, b: &BoneWeights) -> (f32, BoneWeights) {
    /// Smaller shares are as good as none.
    const LEAST: f32 = 1e-9;
    let loss = a.iter().zip(b).map(|(a, b)| -b * a.max(LEAST).ln()).sum();
    (
        loss,
        std::array::from_fn(|bone| -b[bone] / a[bone].max(LEAST)),
    )
}

/// One way of a warp.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Way {
    /// From posed to canonical.
    Inverse,
    /// From canonical to posed.
    Forward,
}

/// A point that a warp moves, and where it should arrive.
pub(super) struct Journey<'a> {
    pub(super) warp: &'a Warp,
    pub(super) way: Way,
    pub(super) from: Vec3,
    pub(super) to: Vec3,
}

impl Journey<'_> {
    /// How far from where it should be the point arrives, and the change of that distance by each weight.
    pub(super) fn miss_m(&self, weights: &BoneWeights) -> (f32, BoneWeights) {
        let (arrived, changes) = match self.way {
            Way::Inverse => (
                self.warp.canonical_from_posed(weights),
                self.warp.canonical_by_weights(weights, self.from),
            ),
            Way::Forward => (
                self.warp.posed_from_canonical(weights),
                self.warp.posed_by_weights(weights, self.from),
            ),
        };
        let miss = arrived.transform_point3(self.from) - self.to;
        // A near hit has no direction; below a tenth of a millimetre the pull fades.
        let direction = glam::Vec3A::from(miss) / miss.length().max(1e-4);
        (miss.length(), changes.map(|change| change.dot(direction)))
    }
}

/// `sum |a - b|` and its change by `a`.
pub(super) fn difference(a: &BoneWeights, b: &BoneWeights) -> (f32, BoneWeights) {
    let sum = a.iter().zip(b).map(|(a, b)| (a - b).abs()).sum();
    let sign = |bone: usize| {
        let difference = a[bone] - b[bone];
        if difference == 0.0 {
            0.0
        } else {
            difference.signum()
        }
    };
    (sum, std::array::from_fn(sign))
}

/// Adds `factor * b` to `a`.
pub(super) fn add(a: &mut BoneWeights, factor: f32, b: &BoneWeights) {
    for bone in 0..JOINT_COUNT {
        a[bone] += factor * b[bone];
    }
}
