//! Finding a body in one frame, no pose assumed: many coarse hypotheses, the best by how their drawings agree.

use glam::{Quat, Vec3};
use serde::{Deserialize, Serialize};

use crate::{
    align::{Aligned, Context, Effort, EnergyConfig, align},
    correspond::Visibility,
    observe::Observation,
    prior::JOINT_PRIORS,
    smpl::JOINT_COUNT,
    state::BodyState,
    surface::{PosedSurface, ShapedSurface},
};

/// How widely to search.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct InitializeConfig {
    /// Headings tried, evenly around the compass.
    pub headings: usize,
    /// Rounds of alignment for every hypothesis.
    pub coarse_rounds: usize,
    /// Hypotheses that are followed further.
    pub keep: usize,
    pub middle_rounds: usize,
    /// Hypotheses that are aligned with all points and full visibility.
    pub finalists: usize,
    pub final_rounds: usize,
}

impl Default for InitializeConfig {
    fn default() -> Self {
        Self {
            headings: 12,
            coarse_rounds: 2,
            keep: 24,
            middle_rounds: 6,
            finalists: 10,
            final_rounds: 8,
        }
    }
}

/// The two surfaces a search needs: a coarse one to look around with, and the one that tracking uses.
pub(crate) struct Searcher<'a> {
    pub(crate) coarse: &'a ShapedSurface,
    pub(crate) fine: &'a ShapedSurface,
    pub(crate) energy: &'a EnergyConfig,
    pub(crate) grounded: bool,
    pub(crate) config: &'a InitializeConfig,
}

/// A frame at both resolutions.
pub(crate) struct Sight<'a> {
    pub(crate) coarse: &'a Observation,
    pub(crate) fine: &'a Observation,
}

impl Searcher<'_> {
    /// The best bodies found, best first, each with a different heading or pose.
    pub(crate) fn search(&self, sight: &Sight<'_>, hints: &[BodyState]) -> Vec<Aligned> {
        let mut hypotheses = self.starts(sight.coarse);
        hypotheses.extend_from_slice(hints);
        let coarse = Effort { rounds: self.config.coarse_rounds, ..COARSE };
        let mut found = self.refine(&hypotheses, self.coarse, sight.coarse, &coarse);
        found.truncate(self.config.keep);
        let middle = Effort { rounds: self.config.middle_rounds, widen: 2.0, ..COARSE };
        let mut found = self.refine(&states(&found), self.coarse, sight.coarse, &middle);
        keep_different(&mut found, self.config.finalists);
        let last = Effort {
            rounds: self.config.final_rounds,
            steps: 1,
            every: 2,
            drawn_visibility: true,
            widen: 1.5,
            settled_from: 0.5,
        };
        let mut found = self.refine(&states(&found), self.fine, sight.fine, &last);
        // A template's raised arm may have hidden behind the body: unseen limbs are as people hold them.
        let relaxed: Vec<BodyState> = found.iter().filter_map(with_unseen_arms_at_rest).collect();
        found.extend(self.refine(&relaxed, self.fine, sight.fine, &last));
        found.sort_by(|a, b| a.score_m().total_cmp(&b.score_m()));
        keep_different(&mut found, self.config.finalists);
        found
    }

    pub(crate) fn refine(
        &self,
        starts: &[BodyState],
        shaped: &ShapedSurface,
        observation: &Observation,
        effort: &Effort,
    ) -> Vec<Aligned> {
        let context =
            Context { energy: self.energy, predicted: None, grounded: self.grounded, whole: true };
        let mut found: Vec<Aligned> = starts
            .iter()
            .map(|start| align(shaped, start, observation, &context, effort))
            .collect();
        found.sort_by(|a, b| a.score_m().total_cmp(&b.score_m()));
        found
    }

    /// Every template pose at every heading, put where the points are.
    fn starts(&self, observation: &Observation) -> Vec<BodyState> {
        let headings = self.config.headings.max(1);
        let mut starts = Vec::with_capacity(headings * TEMPLATES.len());
        for template in &TEMPLATES {
            for i in 0..headings {
                let heading =
                    Quat::from_rotation_y(std::f32::consts::TAU * i as f32 / headings as f32);
                starts.push(self.placed(template, heading, observation));
            }
        }
        starts
    }

    fn placed(&self, template: &Template, heading: Quat, observation: &Observation) -> BodyState {
        let mut rotations = [Quat::IDENTITY; JOINT_COUNT];
        rotations[0] = heading;
        for &(joint, theta) in template.joints {
            rotations[joint] = Quat::from_scaled_axis(Vec3::from(theta));
        }
        let mut state = BodyState { betas: self.coarse.betas, rotations, trans: Vec3::ZERO };
        let body = PosedSurface::new(self.coarse, &state);
        let extent = &observation.extent;
        let camera = observation.view.camera_from_world.inverse().translation;
        // The visible side of the body goes where the visible points are.
        let from_there = camera - extent.center;
        let visible = Visibility::by_facing(&body, from_there);
        let (mut sum, mut count) = (Vec3::ZERO, 0.0);
        for (i, vertex) in (0_u32..).zip(&body.vertices) {
            if visible.is_visible(i) {
                sum += *vertex;
                count += 1.0;
            }
        }
        let mut trans = extent.center - sum / f32::max(count, 1.0);
        trans.y = if self.grounded {
            -body.lowest_y()
        } else {
            extent.high_y - body.highest_y()
        };
        state.trans = trans;
        state
    }
}

pub(crate) const COARSE: Effort = Effort {
    rounds: 2,
    steps: 1,
    every: 1,
    drawn_visibility: false,
    widen: 3.0,
    settled_from: 1.0,
};

struct Template {
    joints: &'static [(usize, [f32; 3])],
}

/// Poses to start from: left and right shoulder are 16 and 17, elbows 18 and 19, hips 1 and 2, knees 4 and 5.
const TEMPLATES: [Template; 7] = [
    // Arms hanging.
    Template { joints: &[(16, [0.0, 0.0, -1.25]), (17, [0.0, 0.0, 1.25])] },
    // A-pose.
    Template { joints: &[(16, [0.0, 0.0, -0.7]), (17, [0.0, 0.0, 0.7])] },
    // T-pose.
    Template { joints: &[] },
    // Arms raised.
    Template { joints: &[(16, [0.0, 0.0, 1.1]), (17, [0.0, 0.0, -1.1])] },
    // One arm raised.
    Template { joints: &[(16, [0.0, 0.0, 0.8]), (17, [0.0, 0.0, 1.25])] },
    Template { joints: &[(16, [0.0, 0.0, -1.25]), (17, [0.0, 0.0, -0.8])] },
    // Half a squat with the arms forwards.
    Template {
        joints: &[
            (1, [-1.0, 0.0, 0.1]),
            (2, [-1.0, 0.0, -0.1]),
            (4, [1.5, 0.0, 0.0]),
            (5, [1.5, 0.0, 0.0]),
            (7, [-0.5, 0.0, 0.0]),
            (8, [-0.5, 0.0, 0.0]),
            (16, [0.0, -1.3, -0.5]),
            (17, [0.0, 1.3, 0.5]),
        ],
    },
];

/// The body with each arm that nothing shows put where the prior has it; `None` if all is seen.
fn with_unseen_arms_at_rest(found: &Aligned) -> Option<BodyState> {
    /// Collar, shoulder, elbow, wrist.
    const ARMS: [[usize; 4]; 2] = [[13, 16, 18, 20], [14, 17, 19, 21]];
    const UNSEEN: f32 = 0.5;
    let mut state = found.state;
    for [collar, shoulder, elbow, wrist] in ARMS {
        if found.joint_confidence[elbow] < UNSEEN && found.joint_confidence[wrist] < UNSEEN {
            for joint in [collar, shoulder, elbow, wrist] {
                state.rotations[joint] =
                    Quat::from_scaled_axis(Vec3::from(JOINT_PRIORS[joint].mean));
            }
        }
    }
    (state != found.state).then_some(state)
}

fn states(found: &[Aligned]) -> Vec<BodyState> {
    found.iter().map(|aligned| aligned.state).collect()
}

/// Drops what another, better one already is: the same heading and much the same pose.
fn keep_different(found: &mut Vec<Aligned>, count: usize) {
    let mut kept: Vec<Aligned> = Vec::with_capacity(count);
    for candidate in found.drain(..) {
        if kept.len() < count
            && kept
                .iter()
                .all(|other| differ(&candidate.state, &other.state))
        {
            kept.push(candidate);
        }
    }
    *found = kept;
}

fn differ(a: &BodyState, b: &BodyState) -> bool {
    /// Closer headings and limbs than this end in the same place anyway.
    const SAME_RAD: f32 = 0.5;
    [0, 1, 2, 16, 17]
        .iter()
        .any(|&joint| a.rotations[joint].angle_between(b.rotations[joint]) > SAME_RAD)
}
