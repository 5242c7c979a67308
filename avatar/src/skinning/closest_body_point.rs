//! Skinning without training: a point takes the weights of the closest point of the minimal body.

use std::sync::Arc;

use effigy_fusion::mesh::normals::vertex_normals;
use effigy_registration::{
    BodyModel, PosedBody,
    smpl::{JOINT_COUNT, star_transforms},
};
use glam::Vec3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::{
    BoneWeights, SkinnedPoint, Skinning, average, dense, fold_extremities,
    oriented_bvh::{OrientedBvh, OrientedHit},
};
use crate::neighbors::Neighbors;

/// How body weights become point weights.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ClosestBodyPointConfig {
    /// What an opposite normal adds to the distance. Larger than the gap between an arm and the torso it
    /// hangs beside, so that a sleeve facing outwards does not take the ribs' weights.
    pub opposed_normal_m: f32,
    /// Points this far off the body take weights averaged over about that radius, so that weights
    /// change slowly where the closest point jumps.
    pub full_smoothing_m: f32,
}

impl Default for ClosestBodyPointConfig {
    fn default() -> Self {
        Self { opposed_normal_m: 0.1, full_smoothing_m: 0.06 }
    }
}

/// Levels of smoothing between none and full.
const SMOOTHING_LEVELS: usize = 4;

/// Skinning by the closest point of one person's minimal body.
pub struct ClosestBodyPoint {
    pub(super) model: Arc<BodyModel>,
    pub(super) config: ClosestBodyPointConfig,
    rest_joints: [Vec3; JOINT_COUNT],
    /// Vertices of the minimal body in star pose.
    pub(super) star: Vec<Vec3>,
    pub(super) star_body: OrientedBvh,
    /// Weights of the body's vertices, from unsmoothed to smoothed over `full_smoothing_m`.
    levels: Vec<Vec<BoneWeights>>,
}

impl ClosestBodyPoint {
    pub fn new(model: Arc<BodyModel>, betas: &[f32; 10], config: ClosestBodyPointConfig) -> Self {
        let star = star_body(&model, betas);
        let rest_joints = model.joints(&model.shaped_vertices(betas));
        let star_normals = vertex_normals(&star, &model.triangles);
        let levels = smoothing_levels(&model, &star, config.full_smoothing_m);
        let star_body = OrientedBvh::new(&star, &star_normals, &model.triangles);
        Self { model, config, rest_joints, star, star_body, levels }
    }

    /// Zero-pose joints of this person's minimal body.
    pub(super) fn rest_joints(&self) -> [Vec3; JOINT_COUNT] {
        self.rest_joints
    }

    /// The tree over this model's body in a pose.
    pub(super) fn posed_tree(&self, posed: &PosedBody) -> OrientedBvh {
        let normals = vertex_normals(&posed.vertices, &self.model.triangles);
        OrientedBvh::new(&posed.vertices, &normals, &self.model.triangles)
    }

    fn skin(&self, body: &OrientedBvh, points: &[Vec3], normals: &[Vec3]) -> Vec<SkinnedPoint> {
        points
            .par_iter()
            .enumerate()
            .with_min_len(64)
            .map(|(index, &point)| {
                let normal = normals.get(index).copied().unwrap_or(Vec3::ZERO);
                let hit = body.closest(point, normal, self.config.opposed_normal_m);
                SkinnedPoint { weights: self.weights_at(&hit), distance_to_body_m: hit.distance_m }
            })
            .collect()
    }

    pub(super) fn weights_at(&self, hit: &OrientedHit) -> BoneWeights {
        let last = self.levels.len() - 1;
        let level = hit.distance_m / self.config.full_smoothing_m.max(1e-6) * last as f32;
        let lower = (level as usize).min(last.saturating_sub(1));
        let share = (level - lower as f32).clamp(0.0, 1.0);
        let mut weights = [0.0; JOINT_COUNT];
        for (level, level_share) in [(lower, 1.0 - share), ((lower + 1).min(last), share)] {
            for (&vertex, &barycentric) in hit.vertices.iter().zip(&hit.barycentric) {
                let factor = level_share * barycentric;
                let of_vertex = &self.levels[level][vertex as usize];
                for (sum, &weight) in weights.iter_mut().zip(of_vertex) {
                    *sum += factor * weight;
                }
            }
        }
        weights
    }
}

impl Skinning for ClosestBodyPoint {
    fn inverse(&self, posed: &PosedBody, points: &[Vec3], normals: &[Vec3]) -> Vec<SkinnedPoint> {
        self.skin(&self.posed_tree(posed), points, normals)
    }

    fn forward(&self, points_in_canonical: &[Vec3], normals: &[Vec3]) -> Vec<SkinnedPoint> {
        self.skin(&self.star_body, points_in_canonical, normals)
    }
}

/// The minimal body in star pose, without pose correctives.
pub(crate) fn star_body(model: &BodyModel, betas: &[f32; 10]) -> Vec<Vec3> {
    let mut vertices = model.shaped_vertices(betas);
    let star = star_transforms(&model.joints(&vertices));
    for (vertex, weights) in vertices.iter_mut().zip(&model.skinning) {
        *vertex = star.blend(weights).transform_point3(*vertex);
    }
    vertices
}

/// Vertex weights averaged over neighbours, more at each level.
fn smoothing_levels(model: &BodyModel, star: &[Vec3], full_m: f32) -> Vec<Vec<BoneWeights>> {
    let mut weights: Vec<BoneWeights> = model.skinning.iter().map(dense).collect();
    weights.iter_mut().for_each(fold_extremities);
    let neighbors = Neighbors::new(star.len(), &model.triangles);
    let edge_m = neighbors.mean_edge(star).max(1e-4);
    let mut levels = vec![weights];
    for level in 1..=SMOOTHING_LEVELS {
        // n passes of averaging over an edge e spread a weight over about e sqrt(n).
        let passes_until = |level: usize| {
            let radius_m = full_m * level as f32 / SMOOTHING_LEVELS as f32;
            (radius_m / edge_m).powi(2).round().min(256.0) as usize
        };
        let mut next = levels[level - 1].clone();
        for _ in passes_until(level - 1)..passes_until(level) {
            next = average(&neighbors, &next);
        }
        levels.push(next);
    }
    levels
}
