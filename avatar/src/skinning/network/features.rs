//! What a tracked body says about points near it, as the network's input.
//!
//! Two body points are named for each point: the closest one that faces the same way, and the closest one. Where
//! they are far apart on the body, two parts touch, and the network has to choose.

use effigy_registration::{PosedBody, smpl::JOINT_COUNT};
use glam::{Mat3A, Vec3};
use rayon::prelude::*;

use super::{mixture::Named, net::Cloud};
use crate::skinning::{
    BoneWeights, ClosestBodyPoint, SkinnedPoint, Warp, closest_body_point::BodyTrees,
    oriented_bvh::OrientedHit, transform_normal,
};

/// Of one named body point.
const BY_CANDIDATE: usize = 3 + 3 + 3 + JOINT_COUNT;
/// Numbers a point has beside its place: two candidates, and its normal in canonical space.
pub(super) const BODY_FEATURES: usize = 2 * BY_CANDIDATE + 3;

/// The network sees lengths in these: the whole body is about +-1, a finger's width about 0.2.
const BODY_M: f32 = 0.9;
const NEAR_M: f32 = 0.1;
/// Farther off the body, distances say no more.
const FAR_M: f32 = 0.3;
/// Added to weights before the logarithm: a bone that neither candidate names can still be chosen.
const LEAST_WEIGHT: f32 = 2e-3;

/// A cloud beside a body.
pub(super) struct Described {
    pub(super) cloud: Cloud,
    pub(super) named: Vec<Named>,
    /// Skinning by the closest body point.
    pub(super) closest: Vec<SkinnedPoint>,
}

/// A body in a pose that points are described by.
pub(super) struct Surroundings<'a> {
    skinning: &'a ClosestBodyPoint,
    trees: &'a BodyTrees,
    /// How points lose the pose; none in star pose.
    warp: Option<Warp>,
    /// From posed space to the root's own, at the middle of the body, in units of 1.5 over its size.
    rotation: Mat3A,
    middle: Vec3,
    scale: f32,
    star_middle: Vec3,
}

impl<'a> Surroundings<'a> {
    pub(super) fn posed(
        skinning: &'a ClosestBodyPoint,
        trees: &'a BodyTrees,
        posed: &PosedBody,
        rest_joints: &[Vec3; JOINT_COUNT],
    ) -> Self {
        let rotation = posed.bones.0[0].matrix3.transpose();
        let warp = Some(Warp::of_posed(posed, rest_joints));
        Self { warp, ..Self::unposed(skinning, trees, rotation, &posed.vertices) }
    }

    pub(super) fn star(skinning: &'a ClosestBodyPoint) -> Self {
        let trees = &skinning.star_body;
        Self::unposed(skinning, trees, Mat3A::IDENTITY, &skinning.star)
    }

    fn unposed(
        skinning: &'a ClosestBodyPoint,
        trees: &'a BodyTrees,
        rotation: Mat3A,
        body: &[Vec3],
    ) -> Self {
        let turned = body.iter().map(|&vertex| rotation * vertex);
        let (middle, scale) = normalisation(turned);
        let (star_middle, _) = normalisation(skinning.star.iter().copied());
        Self { skinning, trees, warp: None, rotation, middle, scale, star_middle }
    }

    /// `normals` are unit or zero, or there are none.
    pub(super) fn describe(&self, points: &[Vec3], normals: &[Vec3]) -> Described {
        let rows: Vec<Row> = points
            .par_iter()
            .enumerate()
            .with_min_len(64)
            .map(|(index, &point)| {
                self.row(point, normals.get(index).copied().unwrap_or(Vec3::ZERO))
            })
            .collect();
        let place = |&point: &Vec3| (self.rotation * point - self.middle) * self.scale;
        Described {
            cloud: Cloud {
                points: points.iter().map(place).collect(),
                features: rows.iter().flat_map(|row| row.features).collect(),
            },
            named: rows.iter().map(|row| row.named).collect(),
            closest: rows.iter().map(|row| row.closest).collect(),
        }
    }

    fn row(&self, point: Vec3, normal: Vec3) -> Row {
        let opposed_m = self.skinning.config.opposed_normal_m;
        let facing = self.trees.whole.closest(point, normal, opposed_m);
        let nearest = self.trees.whole.closest(point, Vec3::ZERO, opposed_m);
        let weights = [(&facing, normal), (&nearest, Vec3::ZERO)]
            .map(|(hit, normal)| self.skinning.weights_near(self.trees, hit, point, normal));
        let mut features = [0.0; BODY_FEATURES];
        let mut normal_in_canonical = normal;
        for (candidate, hit) in [&facing, &nearest].into_iter().enumerate() {
            let own = &mut features[candidate * BY_CANDIDATE..][..BY_CANDIDATE];
            let canonical = self.canonical(point, normal, &weights[candidate]);
            if candidate == 0 {
                normal_in_canonical = canonical.1;
            }
            own[..3].copy_from_slice(&self.in_star(self.star_place(hit)));
            own[3..6].copy_from_slice(&self.in_star(canonical.0));
            own[6] = hit.distance_m.min(FAR_M) / NEAR_M;
            own[7] = hit.offset.dot(hit.normal).clamp(-FAR_M, FAR_M) / NEAR_M;
            own[8] = normal.dot(hit.normal);
            own[9..].copy_from_slice(&weights[candidate]);
        }
        features[2 * BY_CANDIDATE..].copy_from_slice(&normal_in_canonical.to_array());
        let [a, b] = &weights;
        let base = std::array::from_fn(|bone| (0.5 * (a[bone] + b[bone]) + LEAST_WEIGHT).ln());
        let closest = SkinnedPoint { weights: weights[0], distance_to_body_m: facing.distance_m };
        let named = Named { candidates: weights, base };
        Row { features, named, closest }
    }

    fn canonical(&self, point: Vec3, normal: Vec3, weights: &BoneWeights) -> (Vec3, Vec3) {
        match &self.warp {
            Some(warp) => {
                let posed_from_canonical = warp.posed_from_canonical(weights);
                (
                    posed_from_canonical.inverse().transform_point3(point),
                    transform_normal(&posed_from_canonical.matrix3, normal),
                )
            }
            None => (point, normal),
        }
    }

    fn star_place(&self, hit: &OrientedHit) -> Vec3 {
        let corners = hit.vertices.iter().zip(&hit.barycentric);
        corners
            .map(|(&vertex, &share)| self.skinning.star[vertex as usize] * share)
            .sum()
    }

    fn in_star(&self, point: Vec3) -> [f32; 3] {
        // A wrong candidate's canonical place can be anywhere.
        ((point - self.star_middle) / BODY_M)
            .clamp(Vec3::splat(-2.0), Vec3::splat(2.0))
            .to_array()
    }
}

struct Row {
    features: [f32; BODY_FEATURES],
    named: Named,
    closest: SkinnedPoint,
}

/// The middle of the points' box, and 1.5 over its largest side (as MetaAvatar normalises clouds).
pub(super) fn normalisation(points: impl Iterator<Item = Vec3>) -> (Vec3, f32) {
    const LEAST_SIZE_M: f32 = 1.6;
    let start = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    let (low, high) = points.fold(start, |(low, high), p| (low.min(p), high.max(p)));
    if !low.is_finite() {
        return (Vec3::ZERO, 1.0);
    }
    let size = (high - low).max_element().max(LEAST_SIZE_M);
    (0.5 * (low + high), 1.5 / size)
}
