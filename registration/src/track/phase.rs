//! What the tracker is busy with.

use effigy_capture::Timestamp;

use super::{body::Body, config::TrackConfig};
use crate::{align::Aligned, state::BodyState};

#[derive(Clone, Debug)]
#[expect(clippy::large_enum_variant, reason = "a tracker has one")]
pub(super) enum Phase {
    Searching {
        since: Option<Timestamp>,
        last_try: Option<Timestamp>,
        last_seen: Option<BodyState>,
    },
    Following(Following),
}

#[derive(Clone, Debug)]
pub(super) struct Following {
    /// The first is the one reported.
    pub(super) bodies: Vec<Body>,
    pub(super) since: Timestamp,
    pub(super) last: Timestamp,
    /// Whether all of the body is in view now, and when it last was.
    pub(super) whole: bool,
    pub(super) last_whole: Timestamp,
    pub(super) bad_since: Option<Timestamp>,
    pub(super) last_recovery: Option<Timestamp>,
}

impl Phase {
    pub(super) fn nowhere() -> Self {
        Self::Searching { since: None, last_try: None, last_seen: None }
    }
}

impl Following {
    /// The best body found, and beside it the best one that looks the other way, if it is nearly as good.
    pub(super) fn new(found: &[Aligned], now: Timestamp) -> Self {
        /// A rival with a larger error than this, relative to the best, has lost already.
        const RIVAL: f32 = 1.35;
        /// Looking another way means this much.
        const OTHER_WAY_RAD: f32 = 1.0;
        let best = &found[0];
        let rival = found.iter().skip(1).find(|other| {
            let turn = best.state.rotations[0].angle_between(other.state.rotations[0]);
            turn > OTHER_WAY_RAD && other.agreement.error_m < RIVAL * best.agreement.error_m
        });
        let bodies = std::iter::once(best).chain(rival).map(Body::new).collect();
        Self {
            bodies,
            since: now,
            last: now,
            whole: true,
            last_whole: now,
            bad_since: None,
            last_recovery: None,
        }
    }

    /// Whether a limb seems astray; not asked again too soon.
    pub(super) fn wants_recovery(
        &mut self,
        found: &Aligned,
        now: Timestamp,
        config: &TrackConfig,
    ) -> bool {
        let rested = self
            .last_recovery
            .is_none_or(|last| (now - last) as f32 >= config.recover_every_secs);
        let wanted = rested && found.stray > config.stray_share;
        if wanted {
            self.last_recovery = Some(now);
        }
        wanted
    }

    /// Lets the body that has agreed best so far speak, and ends the rivalry when it is time; returns where the
    /// speaker's alignment stands in the order of this frame.
    pub(super) fn decide(&mut self, now: Timestamp, undecided_secs: f32) -> usize {
        if self.bodies.len() < 2 {
            return 0;
        }
        let swap = self.bodies[1].error_sum_m < self.bodies[0].error_sum_m;
        if swap {
            self.bodies.swap(0, 1);
        }
        if (now - self.since) as f32 >= undecided_secs {
            self.bodies.truncate(1);
        }
        usize::from(swap)
    }
}
