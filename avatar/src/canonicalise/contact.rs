//! Where a hand or forearm is near the rest of the body, one cannot tell whose a point is: such points are left out.
//!
//! A wrong guess puts a piece of hand on the hip, and the avatar grows a spike there.

use effigy_fusion::{TriangleMesh, mesh::closest_point::ClosestPoint};
use effigy_registration::BodyModel;
use glam::Vec3;
use rayon::prelude::*;

/// Elbow, wrist and hand of either side.
const FOREARMS: [[u8; 3]; 2] = [[18, 20, 22], [19, 21, 23]];
/// Upper arm and forearm of either side: what is not the other end of a contact.
const ARMS: [[u8; 4]; 2] = [[16, 18, 20, 22], [17, 19, 21, 23]];

/// One frame's forearms and what they may touch.
pub(super) struct Contacts {
    sides: Vec<Side>,
    reach_m: f32,
    margin_m: f32,
}

struct Side {
    forearm: ClosestPoint,
    rest: ClosestPoint,
}

impl Contacts {
    /// `posed` are the body's posed vertices. Points count as undecided if they are within `reach_m` of both a
    /// forearm and the rest of the body, and nearer to one than to the other by less than `margin_m`.
    pub(super) fn new(model: &BodyModel, posed: &[Vec3], reach_m: f32, margin_m: f32) -> Self {
        let main_bone = model.part_labels();
        let of_bones = |belongs: &dyn Fn(u8) -> bool| {
            let triangles = model
                .triangles
                .iter()
                .filter(|t| t.iter().all(|&v| belongs(main_bone[v as usize])));
            let mesh = TriangleMesh::new(posed.to_vec(), triangles.copied().collect());
            ClosestPoint::from_mesh(&mesh).ok()
        };
        let sides = FOREARMS.iter().zip(&ARMS).filter_map(|(forearm, arm)| {
            Some(Side {
                forearm: of_bones(&|bone| forearm.contains(&bone))?,
                rest: of_bones(&|bone| !arm.contains(&bone))?,
            })
        });
        Self { sides: sides.collect(), reach_m, margin_m }
    }

    /// Whether each point could be a forearm's as well as something else's.
    pub(super) fn are_undecided(&self, points: &[Vec3]) -> Vec<bool> {
        let undecided = |point: &Vec3| {
            self.sides.iter().any(|side| {
                let to_forearm_m = side.forearm.query(*point).distance;
                // Most points are nowhere near a forearm.
                if to_forearm_m > self.reach_m {
                    return false;
                }
                let to_rest_m = side.rest.query(*point).distance;
                to_rest_m <= self.reach_m && (to_rest_m - to_forearm_m).abs() < self.margin_m
            })
        };
        points.par_iter().with_min_len(256).map(undecided).collect()
    }
}

#[cfg(test)]
mod tests {
    use effigy_registration::{BodyParams, smpl::builtin};

    use super::*;

    #[test]
    fn only_points_between_hand_and_hip_are_undecided() {
        let body = builtin::body();
        // Arms hanging down: hands beside the thighs.
        let mut params = BodyParams::ZERO;
        (params.theta[16].z, params.theta[17].z) = (-1.4, 1.4);
        let posed = body.pose(&params);
        let contacts = Contacts::new(&body, &posed.vertices, 0.10, 0.04);
        let (hand, chest) = (posed.joints[22], posed.joints[9]);
        let knee = posed.joints[4];
        let side = ClosestPoint::from_mesh(&TriangleMesh::new(
            posed.vertices,
            body.triangles
                .iter()
                .filter(|t| {
                    t.iter()
                        .all(|&v| [0, 1].contains(&body.skinning[v as usize].bones[0]))
                })
                .copied()
                .collect(),
        ))
        .unwrap();
        let hip = side.query(hand).point;
        assert!(
            hip.distance(hand) < 0.18,
            "the hand hangs beside the hip: {}",
            hip.distance(hand)
        );
        let between = hand.lerp(hip, 0.5);
        let said = contacts.are_undecided(&[between, chest, knee, Vec3::splat(9.0)]);
        assert_eq!(said, [true, false, false, false]);
    }
}
