//! The map between canonical (star pose) and posed space.

use effigy_registration::{
    BodyParams, PosedBody,
    smpl::{BoneTransforms, JOINT_COUNT, VertexWeights, star_transforms},
};
use glam::{Affine3A, Mat3A, Vec3, Vec3A};

use super::BoneWeights;

/// Two blends and their product, for one pose: `x_posed = (sum w B) (sum w V)^-1 x_star + t`.
#[derive(Clone, Copy, Debug)]
pub struct Warp {
    /// Rest to posed; root rotation included, translation not.
    posed: BoneTransforms,
    /// Rest to star pose.
    star: BoneTransforms,
    trans: Vec3,
}

impl Warp {
    /// The warp of a body with these zero-pose joints; posed space is the space of `params.trans`.
    pub fn new(params: &BodyParams, rest_joints: &[Vec3; JOINT_COUNT]) -> Self {
        let (posed, _) = BoneTransforms::from_pose(&params.theta, rest_joints);
        Self { posed, star: star_transforms(rest_joints), trans: params.trans }
    }

    /// The warp of a body that is posed already.
    pub fn of_posed(posed: &PosedBody, rest_joints: &[Vec3; JOINT_COUNT]) -> Self {
        // The root turns about the pelvis, so that only the translation moves it.
        let trans = posed.joints[0] - rest_joints[0];
        Self { posed: posed.bones, star: star_transforms(rest_joints), trans }
    }

    /// Posed from canonical, for a point with these weights.
    pub fn posed_from_canonical(&self, weights: &BoneWeights) -> Affine3A {
        self.posed_from_rest(weights) * blend(&self.star, weights).inverse()
    }

    /// Canonical from posed, for a point with these weights.
    pub fn canonical_from_posed(&self, weights: &BoneWeights) -> Affine3A {
        blend(&self.star, weights) * self.posed_from_rest(weights).inverse()
    }

    /// How a posed point's canonical place changes with each weight, at these weights.
    pub(crate) fn canonical_by_weights(
        &self,
        weights: &BoneWeights,
        posed: Vec3,
    ) -> [Vec3A; JOINT_COUNT] {
        change_by_weights((&self.star, &self.posed), weights, posed - self.trans)
    }

    /// How a canonical point's posed place changes with each weight, at these weights.
    pub(crate) fn posed_by_weights(
        &self,
        weights: &BoneWeights,
        canonical: Vec3,
    ) -> [Vec3A; JOINT_COUNT] {
        change_by_weights((&self.posed, &self.star), weights, canonical)
    }

    /// Posed from rest (zero pose) space, translation included.
    pub fn posed_from_rest(&self, weights: &BoneWeights) -> Affine3A {
        let mut posed = blend(&self.posed, weights);
        posed.translation += Vec3A::from(self.trans);
        posed
    }

    /// As [`Self::posed_from_rest`], for at most four bones.
    pub fn posed_from_rest_by_four(&self, weights: &VertexWeights) -> Affine3A {
        let mut posed = self.posed.blend(weights);
        posed.translation += Vec3A::from(self.trans);
        posed
    }
}

/// Rest (zero pose) from canonical, for at most four bones: it depends on no pose.
pub(crate) fn rest_from_canonical(star: &BoneTransforms, weights: &VertexWeights) -> Affine3A {
    star.blend(weights).inverse()
}

/// A normal goes with the inverse transpose of its surface's map; zero stays zero.
pub(crate) fn transform_normal(inverse_of_map: &Mat3A, normal: Vec3) -> Vec3 {
    Vec3::from(inverse_of_map.transpose() * Vec3A::from(normal)).normalize_or_zero()
}

/// For `y = T S^-1 x` with `T = sum w_b T_b` and `S = sum w_b S_b`, the changes `dy/dw_b` along which weights keep
/// their sum: with `q = S^-1 x` they are `T_b q - T S^-1 (S_b q)`, linear part of `T S^-1`.
fn change_by_weights(
    (to, from): (&BoneTransforms, &BoneTransforms),
    weights: &BoneWeights,
    point: Vec3,
) -> [Vec3A; JOINT_COUNT] {
    let from_inverse = blend(from, weights).inverse();
    let linear = blend(to, weights).matrix3 * from_inverse.matrix3;
    let at_rest = from_inverse.transform_point3a(Vec3A::from(point));
    std::array::from_fn(|bone| {
        to.0[bone].transform_point3a(at_rest) - linear * from.0[bone].transform_point3a(at_rest)
    })
}

fn blend(bones: &BoneTransforms, weights: &BoneWeights) -> Affine3A {
    let mut sum = Affine3A::ZERO;
    for (transform, &weight) in bones.0.iter().zip(weights) {
        if weight != 0.0 {
            sum.matrix3 += transform.matrix3 * weight;
            sum.translation += transform.translation * weight;
        }
    }
    sum
}

#[cfg(test)]
mod tests {
    use rand::{RngExt as _, SeedableRng as _, rngs::StdRng};

    use super::*;

    fn random_case(rng: &mut StdRng) -> (BodyParams, [Vec3; JOINT_COUNT], BoneWeights) {
        let mut vector =
            |size: f32| Vec3::from_array(std::array::from_fn(|_| rng.random_range(-size..size)));
        let mut params = BodyParams::ZERO;
        params.theta = std::array::from_fn(|_| vector(0.5));
        params.trans = vector(2.0);
        let joints = std::array::from_fn(|_| vector(0.5));
        let mut weights = [0.0; JOINT_COUNT];
        // A dominant bone keeps the blend far from singular.
        weights[rng.random_range(0..JOINT_COUNT)] = 0.7;
        weights[rng.random_range(0..JOINT_COUNT)] += 0.3;
        (params, joints, weights)
    }

    #[test]
    fn forward_undoes_inverse_for_random_poses_and_weights() {
        let mut rng = StdRng::seed_from_u64(1);
        for _ in 0..200 {
            let (params, joints, weights) = random_case(&mut rng);
            let warp = Warp::new(&params, &joints);
            let point = glam::vec3(0.3, -0.7, 0.2);
            let back = warp
                .posed_from_canonical(&weights)
                .transform_point3(warp.canonical_from_posed(&weights).transform_point3(point));
            // Single precision over two inverses of well-conditioned blends.
            assert!(back.distance(point) < 2e-5, "{}", back.distance(point));
        }
    }

    #[test]
    fn changes_by_weights_are_those_of_finite_differences() {
        const STEP: f32 = 1e-3;
        let mut rng = StdRng::seed_from_u64(2);
        for _ in 0..50 {
            let (params, joints, weights) = random_case(&mut rng);
            let warp = Warp::new(&params, &joints);
            let point = glam::vec3(0.3, -0.7, 0.2);
            let (a, b) = (
                rng.random_range(0..JOINT_COUNT),
                rng.random_range(0..JOINT_COUNT),
            );
            let moved = |step: f32| {
                let mut weights = weights;
                weights[a] += step;
                weights[b] -= step;
                weights
            };
            let difference = |map: &dyn Fn(&BoneWeights) -> Affine3A| {
                (map(&moved(STEP)).transform_point3(point)
                    - map(&moved(-STEP)).transform_point3(point))
                    / (2.0 * STEP)
            };
            let posed = warp.posed_by_weights(&weights, point);
            let canonical = warp.canonical_by_weights(&weights, point);
            for (change, expected) in [
                (posed, difference(&|w| warp.posed_from_canonical(w))),
                (canonical, difference(&|w| warp.canonical_from_posed(w))),
            ] {
                let error = Vec3::from(change[a] - change[b]).distance(expected);
                // Single precision over a step of a thousandth, at places of some metres.
                assert!(
                    error < 5e-3 * (1.0 + expected.length()),
                    "{error} of {expected}"
                );
            }
        }
    }

    #[test]
    fn hips_are_fixed_points_of_the_star_pose() {
        let joints: [Vec3; JOINT_COUNT] =
            std::array::from_fn(|j| Vec3::splat(0.1) * j as f32 + glam::vec3(0.0, 1.0, 0.0));
        let warp = Warp::new(&BodyParams::ZERO, &joints);
        for hip in [1, 2] {
            let mut weights = [0.0; JOINT_COUNT];
            weights[hip] = 1.0;
            let canonical = warp
                .canonical_from_posed(&weights)
                .transform_point3(joints[hip]);
            assert!(canonical.distance(joints[hip]) < 1e-6);
        }
    }
}
