//! The map between canonical (star pose) and posed space.

use effigy_registration::{
    BodyParams,
    smpl::{BoneTransforms, JOINT_COUNT, VertexWeights, star_transforms},
};
use glam::{Affine3A, Mat3A, Vec3};

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

    /// Posed from canonical, for a point with these weights.
    pub fn posed_from_canonical(&self, weights: &BoneWeights) -> Affine3A {
        self.posed_from_rest(weights) * blend(&self.star, weights).inverse()
    }

    /// Canonical from posed, for a point with these weights.
    pub fn canonical_from_posed(&self, weights: &BoneWeights) -> Affine3A {
        blend(&self.star, weights) * self.posed_from_rest(weights).inverse()
    }

    /// Posed from rest (zero pose) space, translation included.
    pub fn posed_from_rest(&self, weights: &BoneWeights) -> Affine3A {
        let mut posed = blend(&self.posed, weights);
        posed.translation += glam::Vec3A::from(self.trans);
        posed
    }

    /// As [`Self::posed_from_rest`], for at most four bones.
    pub fn posed_from_rest_by_four(&self, weights: &VertexWeights) -> Affine3A {
        let mut posed = self.posed.blend(weights);
        posed.translation += glam::Vec3A::from(self.trans);
        posed
    }
}

/// Rest (zero pose) from canonical, for at most four bones: it depends on no pose.
pub(crate) fn rest_from_canonical(star: &BoneTransforms, weights: &VertexWeights) -> Affine3A {
    star.blend(weights).inverse()
}

/// A normal goes with the inverse transpose of its surface's map; zero stays zero.
pub(crate) fn transform_normal(inverse_of_map: &Mat3A, normal: Vec3) -> Vec3 {
    Vec3::from(inverse_of_map.transpose() * glam::Vec3A::from(normal)).normalize_or_zero()
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
