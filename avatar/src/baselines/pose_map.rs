//! Which joints' pose a point is told, in the manner of `SCANimate`: those near the bones that move it.

use effigy_registration::smpl::{JOINT_COUNT, PARENTS};
use glam::{IVec3, Vec3, ivec3};

use super::pose_code::{QUATERNION_NUMBERS, quaternions};
use crate::{
    PoseInput, Subject,
    nn::field_mlp::CodeAt,
    skinning::{BoneWeights, Skinning},
};

/// Points of the lattice a side: 4 cm for an adult.
const SIDE: usize = 48;

/// A joint has a say as far along the skeleton as this (`SCANimate`).
const RINGS: usize = 4;

/// For each place of the unit box how much each joint's pose counts there, on a lattice.
pub struct PoseMap {
    /// `SIDE^3` of them, x fastest.
    shares: Vec<BoneWeights>,
}

impl PoseMap {
    /// Skinning weights of the places, spread along the skeleton.
    pub fn new(subject: &Subject, skinning: &dyn Skinning) -> Self {
        let side = SIDE as i32;
        let points: Vec<Vec3> = (0..side * side * side)
            .map(|index| {
                let place = ivec3(index % side, index / side % side, index / (side * side));
                let in_unit = place.as_vec3() * (2.0 / (side - 1) as f32) - 1.0;
                subject.unit_box.canonical_from_unit(in_unit)
            })
            .collect();
        let rings = rings();
        let skinned = skinning.forward(&points, &[]);
        let spread = |weights: &BoneWeights| -> BoneWeights {
            std::array::from_fn(|joint| {
                let near = (0..JOINT_COUNT).filter(|&bone| rings[joint][bone] <= RINGS);
                near.map(|bone| weights[bone]).sum::<f32>().min(1.0)
            })
        };
        Self { shares: skinned.iter().map(|point| spread(&point.weights)).collect() }
    }

    /// The pose as points of this person are told it.
    pub(super) fn in_pose<'a>(&'a self, pose: &PoseInput) -> LocalPose<'a> {
        LocalPose { map: self, quaternions: quaternions(pose) }
    }

    /// Between the eight points around a place.
    fn at(&self, point: Vec3) -> BoneWeights {
        let last = (SIDE - 1) as f32;
        let place = ((point + 1.0) * 0.5 * last).clamp(Vec3::ZERO, Vec3::splat(last - 1e-3));
        let low = place.floor();
        let share = place - low;
        let low: IVec3 = low.as_ivec3();
        let mut sum = [0.0; JOINT_COUNT];
        for corner in 0..8 {
            let step = ivec3(corner & 1, corner >> 1 & 1, corner >> 2 & 1);
            let high = step.as_vec3();
            let parts = high * share + (1.0 - high) * (1.0 - share);
            let at = low + step;
            let index = (at.z as usize * SIDE + at.y as usize) * SIDE + at.x as usize;
            let weight = parts.x * parts.y * parts.z;
            for (sum, value) in sum.iter_mut().zip(&self.shares[index]) {
                *sum += weight * value;
            }
        }
        sum
    }
}

/// One pose, seen through a person's map.
pub(super) struct LocalPose<'a> {
    map: &'a PoseMap,
    quaternions: Vec<f32>,
}

impl CodeAt for LocalPose<'_> {
    fn write(&self, point: Vec3, code: &mut [f32]) {
        debug_assert_eq!(code.len(), QUATERNION_NUMBERS, "one code a point");
        let shares = self.map.at(point);
        let joints = code
            .chunks_exact_mut(4)
            .zip(self.quaternions.chunks_exact(4));
        for ((out, turn), share) in joints.zip(&shares[1..]) {
            out.iter_mut()
                .zip(turn)
                .for_each(|(out, x)| *out = share * x);
        }
    }
}

/// Steps along the skeleton from each joint to each other.
fn rings() -> [[usize; JOINT_COUNT]; JOINT_COUNT] {
    let chain = |joint: usize| {
        let mut chain = vec![joint];
        while let Some(&last) = chain.last().filter(|&&last| last != 0) {
            chain.push(PARENTS[last]);
        }
        chain
    };
    std::array::from_fn(|a| {
        let from_a = chain(a);
        std::array::from_fn(|b| {
            let from_b = chain(b);
            let met = from_a.iter().enumerate().find_map(|(steps, joint)| {
                let more = from_b.iter().position(|other| other == joint)?;
                Some(steps + more)
            });
            met.expect("every chain ends at the root")
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        skinning::{ClosestBodyPoint, ClosestBodyPointConfig},
        testing::Suit,
    };

    #[test]
    fn joints_are_counted_along_the_skeleton() {
        let rings = rings();
        assert_eq!(
            (rings[4][4], rings[4][1], rings[4][0], rings[4][5]),
            (0, 1, 2, 4)
        );
        assert_eq!(rings[5][4], 4);
    }

    #[test]
    fn a_hand_is_told_of_its_elbow_and_not_of_the_knees() {
        let suit = Suit::new(0.0);
        let skinning = ClosestBodyPoint::new(
            std::sync::Arc::clone(&suit.model),
            &suit.subject.betas,
            ClosestBodyPointConfig::default(),
        );
        let map = PoseMap::new(&suit.subject, &skinning);
        let wrist = suit.subject.rest_joints[20];
        let shares = map.at(suit.subject.unit_box.unit_from_canonical(wrist));
        assert!(shares[18] > 0.9, "elbow {}", shares[18]);
        assert!(
            shares[4] < 0.1 && shares[5] < 0.1,
            "knees {} {}",
            shares[4],
            shares[5]
        );
    }
}
