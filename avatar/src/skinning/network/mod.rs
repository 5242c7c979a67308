//! Skinning networks: from a cloud (and the tracked body beside it) to bone weights.
//!
//! Three of one kind (convolutional occupancy networks, Peng et al. 2020, which MetaAvatar uses): the inverse one looks at posed clouds, the forward one at canonical
//! clouds, and both add to what the closest body points say; the third sees nothing but a raw cloud and names the
//! body part of each point.

mod blob;
mod config;
mod features;
mod learn;
mod loss;
mod mixture;
mod net;
mod planes;
#[cfg(test)]
mod tests;
pub mod train;

use std::sync::Arc;

use effigy_registration::{BodyModel, PosedBody, smpl::JOINT_COUNT};
use glam::Vec3;
use rayon::prelude::*;

pub use blob::NETWORKS_FORMAT;
pub use config::NetworkConfig;
pub use loss::SkinningLossConfig;

use self::{
    features::{BODY_FEATURES, Described, Surroundings, normalisation},
    loss::softmax,
    mixture::{MIXTURE_OUTPUTS, Mixture},
    net::{Cloud, Net},
};
use super::{
    BoneWeights, ClosestBodyPoint, ClosestBodyPointConfig, SkinnedPoint, Skinning, fold_extremities,
};
use crate::hyper::Provenance;

/// A network's layers and numbers.
#[derive(Clone, Debug)]
pub struct SkinningNetwork {
    net: Net,
    parameters: Vec<f32>,
}

impl SkinningNetwork {
    pub fn config(&self) -> NetworkConfig {
        self.net.config
    }

    pub fn parameter_count(&self) -> usize {
        self.net.layout.count
    }

    /// Multiply-adds of one forward pass over a cloud of this many points.
    pub fn multiply_adds(&self, points: usize) -> usize {
        self.net.multiply_adds(points)
    }

    /// As it is before any learning.
    pub fn untrained(config: NetworkConfig, seed: u64) -> Self {
        use rand::SeedableRng as _;
        let net = Net::new(config);
        let parameters = net.init(&mut rand::rngs::StdRng::seed_from_u64(seed));
        Self { net, parameters }
    }

    /// All that such a network holds, without making room for it.
    pub fn count_parameters(config: NetworkConfig) -> usize {
        Net::new(config).layout.count
    }

    /// Weights by the network's answer and by what the body says.
    fn beside_body(&self, described: &Described) -> Vec<BoneWeights> {
        let answers = self.net.forward(&self.parameters, &described.cloud);
        let answers = answers.chunks_exact(self.net.config.outputs);
        answers
            .zip(&described.named)
            .map(|(answer, named)| Mixture::new(answer, named).weights)
            .collect()
    }
}

/// The three networks that are trained together.
#[derive(Clone, Debug)]
pub struct SkinningNetworks {
    /// Posed clouds beside the tracked body.
    pub inverse: SkinningNetwork,
    /// Canonical clouds beside the body in star pose.
    pub forward: SkinningNetwork,
    /// Raw posed clouds.
    pub labels: SkinningNetwork,
    pub provenance: Provenance,
}

impl SkinningNetworks {
    /// Ours, before any learning.
    pub fn untrained(seed: u64) -> Self {
        let beside_body = NetworkConfig::beside_body(BODY_FEATURES, MIXTURE_OUTPUTS);
        Self {
            inverse: SkinningNetwork::untrained(beside_body, seed),
            forward: SkinningNetwork::untrained(beside_body, seed.wrapping_add(1)),
            labels: SkinningNetwork::untrained(NetworkConfig::CLOUD_ONLY, seed.wrapping_add(2)),
            provenance: Provenance::default(),
        }
    }

    /// Bone weights of a raw cloud's points; y is up, nothing else is known of the person.
    pub fn weights_of_cloud(&self, points: &[Vec3]) -> Vec<BoneWeights> {
        let cloud = bare_cloud(points);
        let logits = self.labels.net.forward(&self.labels.parameters, &cloud);
        logits.chunks_exact(JOINT_COUNT).map(softmax).collect()
    }

    /// The body part (bone) of each point of a raw cloud; y is up, nothing else is known of the person.
    pub fn part_labels(&self, points: &[Vec3]) -> Vec<u8> {
        let largest = |weights: &BoneWeights| {
            let best = (1..JOINT_COUNT).fold(0, |best, bone| {
                if weights[bone] > weights[best] {
                    bone
                } else {
                    best
                }
            });
            best as u8
        };
        self.weights_of_cloud(points).iter().map(largest).collect()
    }
}

/// A cloud about which nothing else is known.
fn bare_cloud(points: &[Vec3]) -> Cloud {
    let (middle, scale) = normalisation(points.iter().copied());
    Cloud {
        points: points
            .iter()
            .map(|&point| (point - middle) * scale)
            .collect(),
        features: Vec::new(),
    }
}

/// The body that networks look at, in training as later: loose cloth may hang from both legs.
fn beside(model: Arc<BodyModel>, betas: &[f32; 10]) -> ClosestBodyPoint {
    let config = ClosestBodyPointConfig { both_legs: 4.0, ..ClosestBodyPointConfig::default() };
    ClosestBodyPoint::new(model, betas, config)
}

/// Skinning of one person by the networks.
///
/// Points without normals are no surface (empty space beside the person, say): those are skinned by the closest
/// body point, which is right for any point near the body.
pub struct NetworkSkinning {
    networks: Arc<SkinningNetworks>,
    closest: ClosestBodyPoint,
    rest_joints: [Vec3; JOINT_COUNT],
}

impl NetworkSkinning {
    pub fn new(networks: Arc<SkinningNetworks>, model: Arc<BodyModel>, betas: &[f32; 10]) -> Self {
        let closest = beside(model, betas);
        let rest_joints = closest.rest_joints();
        Self { networks, closest, rest_joints }
    }
}

impl Skinning for NetworkSkinning {
    fn inverse(&self, posed: &PosedBody, points: &[Vec3], normals: &[Vec3]) -> Vec<SkinnedPoint> {
        if normals.is_empty() {
            return self.closest.inverse(posed, points, normals);
        }
        let trees = self.closest.posed_trees(posed);
        let around = Surroundings::posed(&self.closest, &trees, posed, &self.rest_joints);
        skin(&self.networks.inverse, &around.describe(points, normals))
    }

    fn looks_around(&self) -> bool {
        true
    }

    fn forward(&self, points_in_canonical: &[Vec3], normals: &[Vec3]) -> Vec<SkinnedPoint> {
        if normals.is_empty() {
            return self.closest.forward(points_in_canonical, normals);
        }
        let around = Surroundings::star(&self.closest);
        skin(
            &self.networks.forward,
            &around.describe(points_in_canonical, normals),
        )
    }
}

fn skin(network: &SkinningNetwork, described: &Described) -> Vec<SkinnedPoint> {
    let weights = network.beside_body(described);
    weights
        .into_par_iter()
        .zip(&described.closest)
        .map(|(mut weights, closest)| {
            fold_extremities(&mut weights);
            SkinnedPoint { weights, ..*closest }
        })
        .collect()
}
