//! Looking for a body that is not followed yet, or not any more.

use effigy_fusion::CleanFrame;

use super::{
    Tracker, beyond_noise_m,
    phase::{Following, Phase},
    tracked,
};
use crate::{
    align::{Aligned, align},
    fit::fit_one,
    initialize::{Searcher, Sight},
    observe::{Observation, ObserveConfig},
    registered::Tracking,
    state::BodyState,
    surface::ShapedSurface,
};

impl Tracker {
    pub(super) fn search(&mut self, clean: &CleanFrame, observation: &Observation) -> Tracking {
        let now = clean.timestamp;
        let Phase::Searching { since, last_try, last_seen } = &mut self.phase else {
            return Tracking::Lost { since: now };
        };
        let since_when = since.unwrap_or(now);
        let lost = Tracking::Lost { since: since_when };
        let too_soon = last_try.is_some_and(|t| ((now - t) as f32) < self.config.search_every_secs);
        if too_soon {
            return lost;
        }
        *last_try = Some(now);
        let hints: Vec<BodyState> = last_seen.iter().copied().collect();
        let found = self.find(clean, observation, &hints);
        let Some(best) = found.first() else {
            return lost;
        };
        tracing::trace!(
            error_m = best.agreement.error_m,
            stray = best.stray,
            "searched"
        );
        if beyond_noise_m(best, observation) > self.config.found_error_m {
            return lost;
        }
        if !best.shows_whole_body() {
            return Tracking::Partial { since: since_when };
        }
        let tracking = tracked(best);
        self.phase = Phase::Following(Following::new(&found, now));
        self.first_track.get_or_insert(now);
        self.shape_known = true;
        tracking
    }

    fn find(
        &mut self,
        clean: &CleanFrame,
        observation: &Observation,
        hints: &[BodyState],
    ) -> Vec<Aligned> {
        let Some(coarse) = self.observe_coarsely(clean) else {
            return Vec::new();
        };
        let search_shaped = self.search_shape();
        let searcher = self.searcher(&search_shaped);
        let mut found = searcher.search(&Sight { coarse: &coarse, fine: observation }, hints);
        if !self.shape_known {
            self.guess_shape(&mut found, observation);
        }
        found
    }

    /// The first shape, from the first frame: height above all.
    fn guess_shape(&mut self, found: &mut [Aligned], observation: &Observation) {
        let Some(best) = found.first() else {
            return;
        };
        let context = self.context(None);
        let fitted = fit_one(
            &self.surface,
            observation,
            &best.state,
            &self.config.fit,
            &context,
        );
        self.shaped = self.dressed(&self.surface, fitted.betas);
        let effort = self.config.effort();
        for aligned in found.iter_mut() {
            let mut start = aligned.state;
            start.betas = fitted.betas;
            *aligned = align(
                &self.shaped,
                &start,
                observation,
                &self.context(None),
                &effort,
            );
        }
        found.sort_by(|a, b| a.score_m().total_cmp(&b.score_m()));
    }

    pub(super) fn observe_coarsely(&self, clean: &CleanFrame) -> Option<Observation> {
        let config = ObserveConfig {
            points: self.config.search_points,
            cell_m: 0.03,
            ..self.config.looks()
        };
        Observation::new(clean, &self.camera, self.world.world_from_camera(), &config)
    }

    pub(super) fn search_shape(&self) -> ShapedSurface {
        self.dressed(&self.search_surface, self.shaped.betas)
    }

    pub(super) fn searcher<'a>(&'a self, coarse: &'a ShapedSurface) -> Searcher<'a> {
        Searcher {
            coarse,
            fine: &self.shaped,
            energy: &self.energy,
            grounded: self.world.is_grounded(),
            config: &self.config.search,
        }
    }
}
