//! Where two parts of the body touch in a pose though they are far apart on the body: there skinning is hard.

use effigy_avatar::skinning::star_body;
use effigy_fusion::{TriangleMesh, mesh::closest_point::ClosestPoint};
use effigy_registration::{BodyModel, PosedBody, smpl::JOINT_COUNT};
use glam::Vec3;

/// Another part is this near in the pose...
const NEAR_M: f32 = 0.05;
/// ...and at least this far in star pose, so that it is no neighbour across a joint.
const FAR_M: f32 = 0.06;
/// An armpit reaches this far from the shoulder joint.
const ARMPIT_M: f32 = 0.30;

/// Parts of a body between which contact counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Limb {
    Trunk,
    LeftArm,
    RightArm,
    LeftLeg,
    RightLeg,
}

impl Limb {
    const ALL: [Self; 5] = [
        Self::Trunk,
        Self::LeftArm,
        Self::RightArm,
        Self::LeftLeg,
        Self::RightLeg,
    ];

    fn of_bone(bone: u8) -> Self {
        match bone {
            1 | 4 | 7 | 10 => Self::LeftLeg,
            2 | 5 | 8 | 11 => Self::RightLeg,
            16 | 18 | 20 | 22 => Self::LeftArm,
            17 | 19 | 21 | 23 => Self::RightArm,
            _ => Self::Trunk,
        }
    }
}

/// What a point of a person's surface is near to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Region {
    /// Upper arm against trunk, near the shoulder.
    Armpit,
    /// One leg against the other.
    InnerThigh,
    /// A hand on the hip, say.
    OtherContact,
    /// Everywhere else.
    Free,
}

/// The minimal body's limbs in one pose.
pub(super) struct Contacts {
    limbs: Vec<(Limb, ClosestPoint)>,
    /// The body's vertices in star pose.
    star: Vec<Vec3>,
    shoulders: [Vec3; 2],
}

impl Contacts {
    pub(super) fn new(model: &BodyModel, betas: &[f32; 10], posed: &PosedBody) -> Self {
        let labels = model.part_labels();
        let of_limb = |limb: Limb| {
            let triangles = model.triangles.iter().filter(|triangle| {
                triangle
                    .iter()
                    .all(|&v| Limb::of_bone(labels[v as usize]) == limb)
            });
            let mesh = TriangleMesh::new(posed.vertices.clone(), triangles.copied().collect());
            Some((limb, ClosestPoint::from_mesh(&mesh).ok()?))
        };
        let star = star_body(model, betas);
        Self {
            limbs: Limb::ALL.into_iter().filter_map(of_limb).collect(),
            star,
            shoulders: [posed.joints[16], posed.joints[17]],
        }
    }

    /// The region of a point with these true weights, in posed space, whose true place in star pose is known.
    pub(super) fn region(&self, weights: &[f32; JOINT_COUNT], posed: Vec3, star: Vec3) -> Region {
        let largest = (1..JOINT_COUNT).fold(0, |best, bone| {
            if weights[bone] > weights[best] {
                bone
            } else {
                best
            }
        });
        let own = Limb::of_bone(largest as u8);
        let mut region = Region::Free;
        for (limb, surface) in self.limbs.iter().filter(|(limb, _)| *limb != own) {
            let Some(hit) = surface.query_within(posed, NEAR_M) else {
                continue;
            };
            let corners = surface.triangles()[hit.triangle as usize];
            let other_in_star: Vec3 = (0..3)
                .map(|k| self.star[corners[k] as usize] * hit.barycentric[k])
                .sum();
            if other_in_star.distance(star) < FAR_M {
                continue;
            }
            match (own, *limb) {
                (Limb::LeftLeg, Limb::RightLeg) | (Limb::RightLeg, Limb::LeftLeg) => {
                    return Region::InnerThigh;
                }
                (Limb::Trunk, arm @ (Limb::LeftArm | Limb::RightArm))
                | (arm @ (Limb::LeftArm | Limb::RightArm), Limb::Trunk)
                    if posed.distance(self.shoulders[usize::from(arm == Limb::RightArm)])
                        < ARMPIT_M =>
                {
                    return Region::Armpit;
                }
                _ => region = Region::OtherContact,
            }
        }
        region
    }
}

#[cfg(test)]
mod tests {
    use effigy_registration::{BodyParams, smpl::builtin};

    use super::*;

    #[test]
    fn only_limbs_that_touch_are_in_contact() {
        let body = builtin::body();
        let weights_of = |bone: usize| {
            let mut weights = [0.0; JOINT_COUNT];
            weights[bone] = 1.0;
            weights
        };
        // Arms down, legs together.
        let mut params = BodyParams::ZERO;
        (params.theta[16].z, params.theta[17].z) = (-1.3, 1.3);
        let posed = body.pose(&params);
        let star = star_body(&body, &params.betas);
        let contacts = Contacts::new(&body, &params.betas, &posed);
        let count = |bone: usize, wanted: Region| {
            let labels = body.part_labels();
            let own = (0..star.len()).filter(|&v| usize::from(labels[v]) == bone);
            own.filter(|&v| {
                contacts.region(&weights_of(bone), posed.vertices[v], star[v]) == wanted
            })
            .count()
        };
        assert!(
            count(16, Region::Armpit) > 5,
            "{}",
            count(16, Region::Armpit)
        );
        assert!(
            count(1, Region::InnerThigh) > 5,
            "{}",
            count(1, Region::InnerThigh)
        );
        assert_eq!(
            count(15, Region::Free),
            body.part_labels()
                .into_iter()
                .filter(|&bone| usize::from(bone) == 15)
                .count()
        );
        assert_eq!(count(16, Region::InnerThigh), 0);
    }
}
