//! The person's shape, learned while following.

use effigy_capture::Timestamp;

use super::{Tracker, phase::Following};
use crate::{
    align::{Context, Effort, align},
    fit::{Learned, Moment},
    observe::Observation,
};

impl Tracker {
    pub(super) fn learn_shape(
        &mut self,
        following: &mut Following,
        observation: &Observation,
        now: Timestamp,
        good: bool,
    ) {
        let first_track = *self.first_track.get_or_insert(now);
        let decided = following.bodies.len() == 1;
        let moment = Moment {
            secs: (now - first_track) as f32,
            observation,
            state: &following.bodies[0].state,
            good: good && decided,
        };
        let grounded = self.world.is_grounded();
        let config = &self.config;
        let Some(Learned { betas, thickness_m }) =
            self.shape
                .advance(&moment, &config.fit, &self.clothes, grounded)
        else {
            return;
        };
        if let (Some(thickness_m), true) = (thickness_m, config.fit.learns_thickness) {
            self.clothes = config.energy.with_clothes(&thickness_m);
            if self.worn.is_none() {
                self.energy = self.clothes;
            }
        }
        let old_pelvis = self.shaped.rest_joints[0];
        self.shaped = self.dressed(&self.surface, betas);
        let shift = old_pelvis - self.shaped.rest_joints[0];
        for body in &mut following.bodies {
            body.state.betas = betas;
            body.state.trans += shift;
            // The new shape settles in on the frame it was made in, so that the next one starts from rest.
            let context = Context { energy: &self.energy, predicted: None, grounded, whole: true };
            let effort = Effort { every: 2, ..self.config.effort() };
            let settled = align(&self.shaped, &body.state, observation, &context, &effort);
            body.state = settled.state;
        }
    }
}
