//! From one frame to the next: moves the body on, brings limbs back, and notices when it is lost.

use effigy_fusion::CleanFrame;

use super::{
    Tracker, beyond_noise_m,
    body::Body,
    phase::{Following, Phase},
    tracked,
};
use crate::{
    align::{Aligned, Context, Effort, align},
    initialize::Sight,
    observe::Observation,
    recover::recover_arms,
    registered::Tracking,
};

impl Tracker {
    pub(super) fn follow(
        &mut self,
        mut following: Following,
        observation: &Observation,
        clean: &CleanFrame,
    ) -> Tracking {
        let now = clean.timestamp;
        let step_secs = ((now - following.last) as f32).clamp(0.0, 1.0);
        following.last = now;
        if following.whole {
            following.last_whole = now;
        }
        let whole = following.whole;
        let aligned: Vec<Aligned> = following
            .bodies
            .iter_mut()
            .map(|body| {
                let aligned = self.align_next(body, observation, step_secs, whole);
                body.advance(&aligned, step_secs, self.config.velocity_share);
                aligned
            })
            .collect();
        let best = following.decide(now, self.config.undecided_secs);
        let mut found = aligned[best].clone();
        if following.whole
            && following.wants_recovery(&found, now, &self.config)
            && let Some(better) = self.recover(&found, observation, clean)
        {
            following.bodies[0].jump(&better);
            found = better;
        }
        tracing::trace!(
            frame = clean.id.0,
            rounds = found.rounds,
            ended = ?found.termination,
            error_m = found.agreement.error_m,
            stray = found.stray,
            "followed"
        );
        let bad = whole
            && (beyond_noise_m(&found, observation) > self.config.bad_error_m
                || !found.shows_whole_body());
        following.bad_since = bad.then(|| following.bad_since.unwrap_or(now));
        if let Some(since) = following.bad_since
            && (now - since) as f32 >= self.config.patience_secs
        {
            self.phase = Phase::Searching {
                since: Some(since),
                last_try: None,
                last_seen: Some(found.state),
            };
            return self.search(clean, observation);
        }
        let tracking = tracked(&found);
        let teaches = !bad && following.whole;
        self.learn_shape(&mut following, observation, now, teaches);
        self.phase = Phase::Following(following);
        tracking
    }

    /// Other places for limbs that left depth points behind.
    fn recover(
        &self,
        present: &Aligned,
        observation: &Observation,
        clean: &CleanFrame,
    ) -> Option<Aligned> {
        let coarse = self.observe_coarsely(clean)?;
        let search_shaped = self.search_shape();
        let sight = Sight { coarse: &coarse, fine: observation };
        recover_arms(&self.searcher(&search_shaped), &sight, present)
    }

    /// One body's next state.
    fn align_next(
        &self,
        body: &Body,
        observation: &Observation,
        step_secs: f32,
        whole: bool,
    ) -> Aligned {
        let predicted = body.predict(step_secs);
        let context = Context { whole, ..self.context(Some(&predicted)) };
        let effort = Effort { widen: 2.0, ..self.config.effort() };
        align(
            &self.shaped,
            &predicted.state,
            observation,
            &context,
            &effort,
        )
    }
}
