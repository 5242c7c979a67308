//! Scores of people who are not SMPL's: twelve limb joints, less what skeletons disagree about.

use effigy_capture::FrameId;
use effigy_registration::{
    RegisteredFrame,
    smpl::{JOINT_COUNT, VertexWeights},
};
use effigy_sim_sensor::{
    StrangerTruth,
    stranger::{EstimatedLimbs, LIMB_JOINTS, LimbJoint, limb_errors_m},
};
use glam::Vec3;

use super::score::{BodyErrors, FrameScore, Judge, State, is_swapped};

/// Scores one stranger's frames and remembers them: the constant offset of each joint is known in the end.
pub(super) struct StrangerJudge<'a> {
    judge: Judge<'a>,
    truth: StrangerTruth,
    /// Numbers of the scored frames in which somebody was found, and what was found there.
    found_in: Vec<usize>,
    limbs: Vec<EstimatedLimbs>,
    scored: usize,
}

impl<'a> StrangerJudge<'a> {
    pub(super) fn new(judge: Judge<'a>, truth: StrangerTruth) -> Self {
        let weights = &truth.character().weights;
        let parts = weights.iter().map(VertexWeights::main_bone).collect();
        let judge = judge.with_parts(parts);
        Self { judge, truth, found_in: Vec::new(), limbs: Vec::new(), scored: 0 }
    }

    pub(super) fn score(
        &mut self,
        registered: &RegisteredFrame,
        content: FrameId,
        milliseconds: f32,
    ) -> FrameScore {
        let truth = self.truth.at(content);
        let mut measured = [false; JOINT_COUNT];
        for joint in LIMB_JOINTS {
            measured[joint] = true;
        }
        let seen = self
            .judge
            .observed(&truth.surface_in_world, truth.world_from_camera);
        let truth_from_found = truth.world_from_camera * registered.world_from_camera.inverse();
        let joints = self
            .judge
            .joints(registered)
            .map(|found| found.map(|joint| truth_from_found * joint));
        if let Some(joints) = &joints {
            self.found_in.push(self.scored);
            self.limbs.push((*joints, truth.limbs));
        }
        self.scored += 1;
        FrameScore {
            timestamp: registered.clean.timestamp,
            milliseconds,
            present: true,
            state: State::of(&registered.tracking),
            measured,
            observed: std::array::from_fn(|joint| measured[joint] && seen[joint]),
            errors: joints.map(|joints| errors(&joints, &truth.limbs)),
            smooth_errors: None,
        }
    }

    /// Takes each joint's constant offset in its bone's axes out of its errors.
    pub(super) fn remove_offsets(&self, frames: &mut [FrameScore]) {
        let errors_m = limb_errors_m(&self.limbs);
        for (frame, errors_m) in self.found_in.iter().zip(errors_m) {
            if let Some(errors) = &mut frames[*frame].errors {
                for (joint, error_m) in LIMB_JOINTS.into_iter().zip(errors_m) {
                    errors.joints_mm[joint] = error_m * 1e3;
                }
            }
        }
    }
}

fn errors(joints: &[Vec3; JOINT_COUNT], limbs: &[LimbJoint; LIMB_JOINTS.len()]) -> BodyErrors {
    let mut real = *joints;
    for (&joint, limb) in LIMB_JOINTS.iter().zip(limbs) {
        real[joint] = limb.position;
    }
    let hips = |joints: &[Vec3; JOINT_COUNT]| joints[1].midpoint(joints[2]);
    BodyErrors {
        joints_mm: std::array::from_fn(|joint| joints[joint].distance(real[joint]) * 1e3),
        v2v_mm: None,
        root_m: hips(joints).distance(hips(&real)),
        wrists_mm: [20, 21].map(|wrist| (joints[wrist] - real[wrist]) * 1e3),
        swapped: is_swapped(joints, &real),
    }
}
