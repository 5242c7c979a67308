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
    /// Points off the legs take weights of both: a skirt must not tear between them. The farther leg has no say once
    /// it is this many times the nearer one's distance farther away than that one; 0 turns this off.
    pub both_legs: f32,
}

impl Default for ClosestBodyPointConfig {
    fn default() -> Self {
        Self { opposed_normal_m: 0.1, full_smoothing_m: 0.06, both_legs: 0.0 }
    }
}

/// The legs of both sides, feet included.
const LEGS: [[usize; 4]; 2] = [[1, 4, 7, 10], [2, 5, 8, 11]];
/// Cloth nearer than the first is one leg's own; from the second on it may hang from both.
const OFF_LEG_M: [f32; 2] = [0.02, 0.05];

/// Levels of smoothing between none and full.
const SMOOTHING_LEVELS: usize = 4;

/// A body in one pose: all of it, and each leg where both may have a say.
pub(super) struct BodyTrees {
    pub(super) whole: OrientedBvh,
    legs: Option<[OrientedBvh; 2]>,
}

impl BodyTrees {
    fn new(model: &BodyModel, vertices: &[Vec3], config: &ClosestBodyPointConfig) -> Self {
        let normals = vertex_normals(vertices, &model.triangles);
        let whole = OrientedBvh::new(vertices, &normals, &model.triangles);
        if config.both_legs <= 0.0 {
            return Self { whole, legs: None };
        }
        let labels = model.part_labels();
        let leg = |bones: [usize; 4]| {
            let is_legs = |v: &u32| bones.contains(&usize::from(labels[*v as usize]));
            let of_leg = model.triangles.iter().filter(|t| t.iter().all(is_legs));
            let triangles: Vec<[u32; 3]> = of_leg.copied().collect();
            OrientedBvh::new(vertices, &normals, &triangles)
        };
        Self { whole, legs: Some(LEGS.map(leg)) }
    }
}

/// Skinning by the closest point of one person's minimal body.
pub struct ClosestBodyPoint {
    pub(super) model: Arc<BodyModel>,
    pub(super) config: ClosestBodyPointConfig,
    rest_joints: [Vec3; JOINT_COUNT],
    /// Vertices of the minimal body in star pose.
    pub(super) star: Vec<Vec3>,
    pub(super) star_body: BodyTrees,
    /// Weights of the body's vertices, from unsmoothed to smoothed over `full_smoothing_m`.
    levels: Vec<Vec<BoneWeights>>,
}

impl ClosestBodyPoint {
    pub fn new(model: Arc<BodyModel>, betas: &[f32; 10], config: ClosestBodyPointConfig) -> Self {
        let star = star_body(&model, betas);
        let rest_joints = model.joints(&model.shaped_vertices(betas));
        let levels = smoothing_levels(&model, &star, config.full_smoothing_m);
        let star_body = BodyTrees::new(&model, &star, &config);
        Self { model, config, rest_joints, star, star_body, levels }
    }

    /// Zero-pose joints of this person's minimal body.
    pub(super) fn rest_joints(&self) -> [Vec3; JOINT_COUNT] {
        self.rest_joints
    }

    /// The trees over this model's body in a pose.
    pub(super) fn posed_trees(&self, posed: &PosedBody) -> BodyTrees {
        BodyTrees::new(&self.model, &posed.vertices, &self.config)
    }

    fn skin(&self, body: &BodyTrees, points: &[Vec3], normals: &[Vec3]) -> Vec<SkinnedPoint> {
        points
            .par_iter()
            .enumerate()
            .with_min_len(64)
            .map(|(index, &point)| {
                let normal = normals.get(index).copied().unwrap_or(Vec3::ZERO);
                let hit = body
                    .whole
                    .closest(point, normal, self.config.opposed_normal_m);
                SkinnedPoint {
                    weights: self.weights_near(body, &hit, point, normal),
                    distance_to_body_m: hit.distance_m,
                }
            })
            .collect()
    }

    /// Weights of a point whose closest body point is known.
    pub(super) fn weights_near(
        &self,
        body: &BodyTrees,
        hit: &OrientedHit,
        point: Vec3,
        normal: Vec3,
    ) -> BoneWeights {
        let own = self.weights_at(hit);
        let Some(legs) = &body.legs else {
            return own;
        };
        let on_legs: f32 = LEGS.as_flattened().iter().map(|&bone| own[bone]).sum();
        let say = smoothstep(OFF_LEG_M, hit.distance_m) * smoothstep([0.0, 0.5], on_legs);
        if say <= 0.0 {
            return own;
        }
        let opposed_m = self.config.opposed_normal_m;
        let hits = [0, 1].map(|side| legs[side].closest(point, normal, opposed_m));
        let [left_m, right_m] = hits.map(|hit| hit.cost_m);
        let range_m = self.config.both_legs * left_m.min(right_m).max(1e-6);
        let left = smoothstep([-range_m, range_m], right_m - left_m);
        let [of_left, of_right] = hits.map(|hit| self.weights_at(&hit));
        std::array::from_fn(|bone| {
            let of_both = of_right[bone] + (of_left[bone] - of_right[bone]) * left;
            own[bone] + (of_both - own[bone]) * say
        })
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
        self.skin(&self.posed_trees(posed), points, normals)
    }

    fn forward(&self, points_in_canonical: &[Vec3], normals: &[Vec3]) -> Vec<SkinnedPoint> {
        self.skin(&self.star_body, points_in_canonical, normals)
    }
}

/// From 0 to 1 between two values, level at both.
fn smoothstep([from, to]: [f32; 2], x: f32) -> f32 {
    let t = ((x - from) / (to - from)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// The minimal body in star pose, without pose correctives.
pub fn star_body(model: &BodyModel, betas: &[f32; 10]) -> Vec<Vec3> {
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

#[cfg(test)]
mod tests {
    use effigy_registration::smpl::builtin;

    use super::*;

    #[test]
    fn a_skirt_hangs_from_both_legs_and_trousers_from_their_own() {
        let body = builtin::body();
        let config = ClosestBodyPointConfig { both_legs: 4.0, ..Default::default() };
        let both = ClosestBodyPoint::new(body.clone(), &[0.0; 10], config);
        let own = ClosestBodyPoint::new(body, &[0.0; 10], ClosestBodyPointConfig::default());
        let joints = star_joints(&own);
        let between = 0.5 * (joints[4] + joints[5]);
        let left =
            |point: &SkinnedPoint| -> f32 { LEGS[0].iter().map(|&bone| point.weights[bone]).sum() };
        // In front of the middle between the knees, to either side of it.
        let front = [-0.02, 0.0, 0.02].map(|x| between + Vec3::new(x, 0.0, 0.08));
        let weights = both.forward(&front, &[]);
        assert!(
            (left(&weights[1]) - 0.5).abs() < 0.05,
            "{}",
            left(&weights[1])
        );
        for pair in weights.windows(2) {
            let jump = (left(&pair[0]) - left(&pair[1])).abs();
            assert!(jump < 0.2, "weights jump by {jump} over 2 cm");
        }
        let torn = own.forward(&front, &[]);
        let jump = left(&torn[2]) - left(&torn[0]);
        assert!(
            jump > 0.5,
            "without, weights jump between the legs: {jump} {torn:?}"
        );
        // A centimetre off the left shin.
        let shin = joints[7].lerp(joints[4], 0.5);
        let hit = own.star_body.whole.closest(shin, Vec3::ZERO, 0.0);
        let near = shin + hit.offset * -(1.0 + 0.01 / hit.distance_m);
        let [a, b] = [&both, &own].map(|skinning| skinning.forward(&[near], &[])[0]);
        assert_eq!(a, b);
        assert!(left(&a) > 0.9);
    }

    fn star_joints(person: &ClosestBodyPoint) -> [Vec3; JOINT_COUNT] {
        let star = star_transforms(&person.rest_joints);
        std::array::from_fn(|joint| star.0[joint].transform_point3(person.rest_joints[joint]))
    }
}
