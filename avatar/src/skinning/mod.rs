//! Skinning both ways: which bones move a point, and the map between star pose and posed space.
//!
//! Inverse skinning asks for the weights of points on a posed body, forward skinning for those of points
//! in canonical space. Either way the map is two blends and a product (docs/spaces.md):
//! `x_posed = (sum w B) (sum w V)^-1 x_star + t`.

mod closest_body_point;
pub mod network;
mod oriented_bvh;
mod warp;
mod worn;

use effigy_registration::{
    PosedBody,
    smpl::{JOINT_COUNT, VertexWeights},
};
use glam::Vec3;
use rayon::prelude::*;

use crate::neighbors::Neighbors;

pub use closest_body_point::star_body;
pub use closest_body_point::{ClosestBodyPoint, ClosestBodyPointConfig};
pub use network::{NetworkSkinning, SkinningNetworks};
pub use warp::Warp;
pub(crate) use warp::{rest_from_canonical, transform_normal};
pub use worn::offsets_from_body;

/// How much each of the 24 bones moves a point; sums to one.
pub type BoneWeights = [f32; JOINT_COUNT];

/// One point's weights, and how far it is from the body they were taken from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SkinnedPoint {
    pub weights: BoneWeights,
    pub distance_to_body_m: f32,
}

/// Anything that gives points bone weights: closest body points at first, networks later.
///
/// `normals` are unit normals at the points, or empty; a zero normal says nothing.
pub trait Skinning: Send + Sync {
    /// Weights of points around a posed body; points and body in one space.
    fn inverse(&self, posed: &PosedBody, points: &[Vec3], normals: &[Vec3]) -> Vec<SkinnedPoint>;

    /// Weights of points in canonical space.
    fn forward(&self, points_in_canonical: &[Vec3], normals: &[Vec3]) -> Vec<SkinnedPoint>;

    /// Whether a point's weights depend on the points around it: then a cloud must not be asked about in parts.
    fn looks_around(&self) -> bool {
        false
    }
}

/// Toes and fingers ride on ankles and wrists, as in MetaAvatar: depth cannot see them turn.
const CARRIED_BONES: [(usize, usize); 4] = [(10, 7), (11, 8), (22, 20), (23, 21)];

/// Gives the weights of toes and fingers to the bones that carry them.
pub fn fold_extremities(weights: &mut BoneWeights) {
    for (bone, carrier) in CARRIED_BONES {
        weights[carrier] += weights[bone];
        weights[bone] = 0.0;
    }
}

/// All 24 weights of a body vertex.
pub fn dense(weights: &VertexWeights) -> BoneWeights {
    let mut dense = [0.0; JOINT_COUNT];
    for (&bone, &weight) in weights.bones.iter().zip(&weights.weights) {
        dense[bone as usize] += weight;
    }
    dense
}

/// The four largest weights, in falling order, scaled to sum to one; unused slots name bone 0.
pub fn four_largest(weights: &BoneWeights) -> VertexWeights {
    let mut order: [usize; JOINT_COUNT] = std::array::from_fn(|bone| bone);
    order.sort_by(|&a, &b| weights[b].total_cmp(&weights[a]).then(a.cmp(&b)));
    let sum: f32 = order[..4].iter().map(|&bone| weights[bone].max(0.0)).sum();
    let mut four = VertexWeights::default();
    if sum <= 0.0 {
        four.weights[0] = 1.0;
        return four;
    }
    for (slot, &bone) in order[..4].iter().enumerate() {
        let weight = weights[bone].max(0.0) / sum;
        if weight > 0.0 {
            four.bones[slot] = bone as u8;
            four.weights[slot] = weight;
        }
    }
    four
}

/// Half of a vertex's own weights, half of its neighbours' mean.
pub(crate) fn average(neighbors: &Neighbors, weights: &[BoneWeights]) -> Vec<BoneWeights> {
    (0..weights.len())
        .into_par_iter()
        .with_min_len(256)
        .map(|vertex| {
            let around = neighbors.of(vertex);
            if around.is_empty() {
                return weights[vertex];
            }
            let mut sum = [0.0; JOINT_COUNT];
            for &other in around {
                for (sum, &weight) in sum.iter_mut().zip(&weights[other as usize]) {
                    *sum += weight;
                }
            }
            let scale = 0.5 / around.len() as f32;
            std::array::from_fn(|bone| 0.5 * weights[vertex][bone] + scale * sum[bone])
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn four_largest_weights_sum_to_one_and_keep_their_order() {
        let mut weights = [0.0; JOINT_COUNT];
        for (bone, weight) in [
            (3, 0.1),
            (5, 0.4),
            (7, 0.2),
            (9, 0.15),
            (11, 0.05),
            (13, 0.1),
        ] {
            weights[bone] = weight;
        }
        let four = four_largest(&weights);
        assert_eq!(four.bones, [5, 7, 9, 3]);
        assert!((four.weights.iter().sum::<f32>() - 1.0).abs() < 1e-6);
    }

    #[test]
    fn toes_and_fingers_ride_on_ankles_and_wrists() {
        let mut weights = [0.0; JOINT_COUNT];
        weights[10] = 0.25;
        weights[7] = 0.25;
        weights[23] = 0.5;
        fold_extremities(&mut weights);
        assert_eq!(
            (weights[7], weights[21], weights[10], weights[23]),
            (0.5, 0.5, 0.0, 0.0)
        );
    }
}
