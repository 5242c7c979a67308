//! Following one body from frame to frame: finds it, follows it, and says when it is lost.

use std::sync::Arc;

use effigy_capture::{CameraModel, Rigid3, Timestamp};
use effigy_fusion::{CleanFrame, clean::PersonVisibility};
use glam::Quat;
use serde::{Deserialize, Serialize};

use crate::{
    align::{Aligned, Context, Effort, EnergyConfig, align},
    fit::{FitConfig, Moment, ShapeFit, fit_one},
    initialize::{InitializeConfig, Searcher, Sight},
    observe::{Extent, Observation, ObserveConfig},
    recover::recover_arms,
    registered::{RegisteredFrame, Tracking},
    smpl::{BodyModel, JOINT_COUNT},
    state::{BETA_COUNT, BodyState, axis_angle},
    surface::{ShapedSurface, Surface},
    world::World,
};

/// Everything that can be set about tracking.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct TrackConfig {
    /// Vertices of the surface that is fitted: three centimetres apart.
    pub surface_vertices: usize,
    /// Vertices of the surface that is searched with.
    pub search_vertices: usize,
    /// Depth points a frame.
    pub points: usize,
    pub search_points: usize,
    /// Rounds of matching and moving a frame.
    pub rounds: usize,
    /// Fewer person pixels are nobody (field practice: re-initialise below 1000).
    pub min_person_px: usize,
    /// Drawn body and picture differ by more than this on average: the track is bad.
    pub bad_error_m: f32,
    /// A search must end below this to be believed.
    pub found_error_m: f32,
    /// A bad track for this long is lost.
    pub patience_secs: f32,
    /// Pause between searches that fail.
    pub search_every_secs: f32,
    /// More depth points than this share without body near them: a limb is astray.
    pub stray_share: f32,
    /// Pause between attempts to bring a limb back.
    pub recover_every_secs: f32,
    /// Two headings are followed side by side for this long, until the picture has decided.
    pub undecided_secs: f32,
    pub energy: EnergyConfig,
    pub search: InitializeConfig,
    pub fit: FitConfig,
}

impl Default for TrackConfig {
    fn default() -> Self {
        Self {
            surface_vertices: 2400,
            search_vertices: 600,
            points: 1600,
            search_points: 260,
            rounds: 7,
            min_person_px: 1000,
            bad_error_m: 0.055,
            found_error_m: 0.05,
            patience_secs: 0.2,
            search_every_secs: 0.15,
            stray_share: 0.02,
            recover_every_secs: 0.1,
            undecided_secs: 0.5,
            energy: EnergyConfig::default(),
            search: InitializeConfig::default(),
            fit: FitConfig::default(),
        }
    }
}

/// Follows one body through the frames of one source.
#[derive(Debug)]
pub struct Tracker {
    config: TrackConfig,
    camera: CameraModel,
    world: World,
    surface: Arc<Surface>,
    search_surface: Arc<Surface>,
    shaped: ShapedSurface,
    shape: ShapeFit,
    shape_known: bool,
    first_track: Option<Timestamp>,
    phase: Phase,
}

#[derive(Clone, Debug)]
#[expect(clippy::large_enum_variant, reason = "a tracker has one")]
enum Phase {
    Searching {
        since: Option<Timestamp>,
        last_try: Option<Timestamp>,
        last_seen: Option<BodyState>,
    },
    Following(Following),
}

#[derive(Clone, Debug)]
struct Following {
    /// The first is the one reported.
    bodies: Vec<Body>,
    since: Timestamp,
    last: Timestamp,
    /// Whether all of the body is in view now, and when it last was.
    whole: bool,
    last_whole: Timestamp,
    bad_since: Option<Timestamp>,
    last_recovery: Option<Timestamp>,
}

/// One body being followed.
#[derive(Clone, Debug)]
struct Body {
    state: BodyState,
    before: Option<BodyState>,
    frame_secs: f32,
    confidence: [f32; JOINT_COUNT],
    /// Sum of errors since two bodies are followed.
    error_sum_m: f32,
}

impl Tracker {
    /// `world_from_camera` is what the calibration knows; a floor seen in the frames overrules it.
    pub fn new(
        model: Arc<BodyModel>,
        camera: CameraModel,
        config: TrackConfig,
        world_from_camera: Option<Rigid3>,
    ) -> Self {
        let surface = Arc::new(Surface::new(Arc::clone(&model), config.surface_vertices));
        let search_surface = Arc::new(Surface::new(model, config.search_vertices));
        let betas = [0.0; BETA_COUNT];
        Self {
            camera,
            world: World::new(world_from_camera),
            shaped: ShapedSurface::new(&surface, betas),
            shape: ShapeFit::new(Arc::clone(&surface)),
            surface,
            search_surface,
            shape_known: false,
            first_track: None,
            phase: Phase::Searching { since: None, last_try: None, last_seen: None },
            config,
        }
    }

    /// The person's shape as known so far.
    pub fn betas(&self) -> [f32; BETA_COUNT] {
        self.shaped.betas
    }

    /// Whether the betas will not change any more.
    pub fn betas_are_frozen(&self) -> bool {
        self.shape.is_frozen(&self.config.fit)
    }

    /// Starts anew with another person; what is known of the floor stays.
    pub fn forget_person(&mut self) {
        self.shaped = ShapedSurface::new(&self.surface, [0.0; BETA_COUNT]);
        self.shape = ShapeFit::new(Arc::clone(&self.surface));
        self.shape_known = false;
        self.first_track = None;
        self.forget_pose();
    }

    /// Searches for the body again: the next frame is not the one after the last, as after a jump in a recording.
    /// The person's shape and the floor stay known.
    pub fn forget_pose(&mut self) {
        self.phase = Phase::Searching { since: None, last_try: None, last_seen: None };
    }

    /// Finds or follows the body in the next frame.
    pub fn process(&mut self, clean: Arc<CleanFrame>) -> RegisteredFrame {
        if let Some(moved) = self.world.observe(clean.floor.as_ref()) {
            self.follow_world(moved);
        }
        let tracking = self.track(&clean);
        RegisteredFrame { world_from_camera: self.world.world_from_camera(), tracking, clean }
    }

    fn track(&mut self, clean: &CleanFrame) -> Tracking {
        let now = clean.timestamp;
        let Some(observation) = self.observe(clean) else {
            return self.lose(now);
        };
        let cut_off = self.is_cut_off(clean, &observation.extent);
        if cut_off && !self.bridges_cut(now) {
            let since = self.give_up_following(now);
            return Tracking::Partial { since };
        }
        match std::mem::replace(&mut self.phase, Phase::nowhere()) {
            Phase::Following(mut following) => {
                following.whole = !cut_off;
                self.follow(following, &observation, clean)
            }
            Phase::Searching { since, last_try, last_seen } => {
                let since = since.unwrap_or(now);
                self.phase = Phase::Searching { since: Some(since), last_try, last_seen };
                self.search(clean, &observation)
            }
        }
    }

    /// Whether a cut-off body is still followed: for a moment, its unseen limbs go on as they were.
    fn bridges_cut(&mut self, now: Timestamp) -> bool {
        let patience_secs = self.config.patience_secs;
        let Phase::Following(following) = &mut self.phase else {
            return false;
        };
        (now - following.last_whole) as f32 <= patience_secs
    }

    fn observe(&self, clean: &CleanFrame) -> Option<Observation> {
        let config = ObserveConfig {
            points: self.config.points,
            cell_m: 0.01,
            min_px: self.config.min_person_px,
        };
        if clean.visibility == PersonVisibility::Nobody {
            return None;
        }
        Observation::new(clean, &self.camera, self.world.world_from_camera(), &config)
    }

    /// Whether so much of the body is outside the picture that a fit would be a guess.
    fn is_cut_off(&self, clean: &CleanFrame, extent: &Extent) -> bool {
        /// Legs cut above this leave nothing to stand on: just below the knees.
        const LEGS_CUT_M: f32 = 0.45;
        /// Nobody upright is shorter in view, unless cut.
        const SHORTEST_M: f32 = 1.0;
        if clean.visibility != PersonVisibility::Partial {
            return false;
        }
        if self.world.is_grounded() {
            extent.low_y > LEGS_CUT_M
        } else {
            extent.high_y - extent.low_y < SHORTEST_M
        }
    }

    fn follow(
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
                let aligned = self.advance(body, observation, step_secs, whole);
                body.error_sum_m += aligned.agreement.error_m;
                aligned
            })
            .collect();
        let best = following.decide(now, self.config.undecided_secs);
        let mut found = aligned[best].clone();
        if following.whole
            && following.wants_recovery(&found, now, &self.config)
            && let Some(better) = self.recover(&found, observation, clean)
        {
            // Jumping there was no movement to carry on.
            following.bodies[0].state = better.state;
            following.bodies[0].before = None;
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
            && (found.agreement.error_m > self.config.bad_error_m || !found.shows_whole_body());
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
    fn advance(
        &self,
        body: &mut Body,
        observation: &Observation,
        step_secs: f32,
        whole: bool,
    ) -> Aligned {
        let predicted = body.predict(step_secs);
        let context = Context { whole, ..self.context(Some(&predicted)) };
        let effort = Effort {
            rounds: self.config.rounds,
            every: 1,
            drawn_visibility: true,
            widen: 2.0,
            settled_from: 0.3,
        };
        let aligned = align(&self.shaped, &predicted, observation, &context, &effort);
        body.before = Some(body.state);
        body.state = aligned.state;
        body.frame_secs = step_secs;
        body.confidence = aligned.joint_confidence;
        aligned
    }

    fn context<'a>(&'a self, predicted: Option<&'a BodyState>) -> Context<'a> {
        Context {
            energy: &self.config.energy,
            predicted,
            grounded: self.world.is_grounded(),
            whole: true,
        }
    }

    fn learn_shape(
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
        let Some(betas) = self
            .shape
            .advance(&moment, &config.fit, &config.energy, grounded)
        else {
            return;
        };
        let old_pelvis = self.shaped.rest_joints[0];
        self.shaped = ShapedSurface::new(&self.surface, betas);
        let shift = old_pelvis - self.shaped.rest_joints[0];
        for body in &mut following.bodies {
            for state in std::iter::once(&mut body.state).chain(body.before.as_mut()) {
                state.betas = betas;
                state.trans += shift;
            }
            // The new shape settles in on the frame it was made in, so that the next one starts from rest.
            let context =
                Context { energy: &self.config.energy, predicted: None, grounded, whole: true };
            let effort = Effort {
                rounds: self.config.rounds,
                every: 2,
                drawn_visibility: true,
                widen: 1.0,
                settled_from: 0.3,
            };
            let settled = align(&self.shaped, &body.state, observation, &context, &effort);
            if let Some(before) = &mut body.before {
                before.trans += settled.state.trans - body.state.trans;
            }
            body.state = settled.state;
        }
    }

    fn search(&mut self, clean: &CleanFrame, observation: &Observation) -> Tracking {
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
        if best.agreement.error_m > self.config.found_error_m {
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
        self.shaped = ShapedSurface::new(&self.surface, fitted.betas);
        let effort = Effort {
            rounds: self.config.rounds,
            every: 1,
            drawn_visibility: true,
            widen: 1.0,
            settled_from: 0.3,
        };
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

    fn observe_coarsely(&self, clean: &CleanFrame) -> Option<Observation> {
        let config = ObserveConfig {
            points: self.config.search_points,
            cell_m: 0.03,
            min_px: self.config.min_person_px,
        };
        Observation::new(clean, &self.camera, self.world.world_from_camera(), &config)
    }

    fn search_shape(&self) -> ShapedSurface {
        ShapedSurface::new(&self.search_surface, self.shaped.betas)
    }

    fn searcher<'a>(&'a self, coarse: &'a ShapedSurface) -> Searcher<'a> {
        Searcher {
            coarse,
            fine: &self.shaped,
            energy: &self.config.energy,
            grounded: self.world.is_grounded(),
            config: &self.config.search,
        }
    }

    fn lose(&mut self, now: Timestamp) -> Tracking {
        Tracking::Lost { since: self.give_up_following(now) }
    }

    /// Goes back to searching; returns since when.
    fn give_up_following(&mut self, now: Timestamp) -> Timestamp {
        let (since, last_seen) = match &self.phase {
            Phase::Following(following) => (None, Some(following.bodies[0].state)),
            Phase::Searching { since, last_seen, .. } => (*since, *last_seen),
        };
        let since = since.unwrap_or(now);
        self.phase = Phase::Searching { since: Some(since), last_try: None, last_seen };
        since
    }

    fn follow_world(&mut self, new_from_old: Rigid3) {
        let pelvis = self.shaped.rest_joints[0];
        if let Phase::Following(following) = &mut self.phase {
            for body in &mut following.bodies {
                body.state = body.state.seen_from(new_from_old, pelvis);
                body.before = body.before.map(|b| b.seen_from(new_from_old, pelvis));
            }
        }
        self.shape.move_by(new_from_old, pelvis);
    }
}

impl Phase {
    fn nowhere() -> Self {
        Self::Searching { since: None, last_try: None, last_seen: None }
    }
}

impl Following {
    /// The best body found, and beside it the best one that looks the other way, if it is nearly as good.
    fn new(found: &[Aligned], now: Timestamp) -> Self {
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
    fn wants_recovery(&mut self, found: &Aligned, now: Timestamp, config: &TrackConfig) -> bool {
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
    fn decide(&mut self, now: Timestamp, undecided_secs: f32) -> usize {
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

impl Body {
    fn new(aligned: &Aligned) -> Self {
        Self {
            state: aligned.state,
            before: None,
            frame_secs: 0.0,
            confidence: aligned.joint_confidence,
            error_sum_m: aligned.agreement.error_m,
        }
    }

    /// Moves on as before: wholly for what was seen, less for what was not.
    fn predict(&self, step_secs: f32) -> BodyState {
        /// Accelerations are common; a velocity carried on in full overshoots.
        const CARRY: f32 = 0.8;
        /// A quick wave; faster is an error that must not feed itself.
        const FASTEST_RAD_PER_SEC: f32 = 8.0;
        let Some(before) = &self.before else {
            return self.state;
        };
        let ratio = if self.frame_secs > 1e-4 {
            (step_secs / self.frame_secs).min(2.0)
        } else {
            0.0
        };
        let carry = CARRY * ratio;
        let mut predicted = self.state;
        predicted.trans += (self.state.trans - before.trans) * carry;
        for joint in 0..JOINT_COUNT {
            let turn = self.state.rotations[joint] * before.rotations[joint].inverse();
            let trusted = carry * self.confidence[joint];
            let turn =
                (axis_angle(turn) * trusted).clamp_length_max(FASTEST_RAD_PER_SEC * step_secs);
            predicted.rotations[joint] =
                (Quat::from_scaled_axis(turn) * self.state.rotations[joint]).normalize();
        }
        predicted
    }
}

fn tracked(found: &Aligned) -> Tracking {
    Tracking::Tracked {
        params: found.state.to_params(),
        residual_rms_m: found.residual_rms_m,
        joint_confidence: found.joint_confidence,
    }
}
