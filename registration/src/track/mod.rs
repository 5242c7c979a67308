//! Following one body from frame to frame: finds it, follows it, and says when it is lost.

mod body;
mod config;
mod find;
mod follow;
mod learn_shape;
mod phase;
mod refine;
mod worn;

pub use config::TrackConfig;
pub use refine::Refiner;

use std::sync::Arc;

use effigy_capture::{CameraModel, Rigid3, Timestamp};
use effigy_fusion::{CleanFrame, clean::PersonVisibility};

use glam::Vec3;

use self::phase::Phase;
use crate::{
    align::{Aligned, Context, EnergyConfig},
    fit::ShapeFit,
    observe::{Extent, Observation},
    registered::{RegisteredFrame, Tracking},
    residual::Prediction,
    smpl::BodyModel,
    state::BETA_COUNT,
    surface::{ShapedSurface, Surface},
    world::World,
};

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
    /// For each of the model's vertices how far the surface that is followed is off it in the zero pose.
    worn: Option<Arc<[Vec3]>>,
    /// The configured energy, with this person's clothes as far as they are known.
    clothes: EnergyConfig,
    /// The same, or what it becomes for a surface that is known.
    energy: EnergyConfig,
    first_track: Option<Timestamp>,
    phase: Phase,
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
            worn: None,
            clothes: config.energy,
            energy: config.energy,
            first_track: None,
            phase: Phase::Searching { since: None, last_try: None, last_seen: None },
            config,
        }
    }

    /// The person's shape as known so far.
    pub fn betas(&self) -> [f32; BETA_COUNT] {
        self.shaped.betas
    }

    /// For each beta how much of the population's variance the frames have ruled out: 0 is a guess, 1 is certain.
    pub fn shape_confidence(&self) -> [f32; BETA_COUNT] {
        self.shape.confidence()
    }

    /// Whether the betas will not change any more.
    pub fn betas_are_frozen(&self) -> bool {
        self.shape.is_frozen(&self.config.fit)
    }

    /// Starts anew with another person, their shape and clothes unknown; what is known of the floor stays.
    pub fn forget_person(&mut self) {
        self.worn = None;
        self.clothes = self.config.energy;
        self.energy = self.clothes;
        self.shaped = self.dressed(&self.surface, [0.0; BETA_COUNT]);
        self.shape = ShapeFit::new(Arc::clone(&self.surface));
        self.shape_known = false;
        self.first_track = None;
        self.forget_pose();
    }

    /// Searches for the body again: the next frame is not the one after the last, as after a jump in a recording.
    /// The person's shape and the floor stay known.
    pub fn forget_pose(&mut self) {
        self.phase = Phase::nowhere();
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
        if clean.visibility == PersonVisibility::Nobody {
            return None;
        }
        Observation::new(
            clean,
            &self.camera,
            self.world.world_from_camera(),
            &self.config.looks(),
        )
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

    fn context<'a>(&'a self, predicted: Option<&'a Prediction>) -> Context<'a> {
        Context { energy: &self.energy, predicted, grounded: self.world.is_grounded(), whole: true }
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
                body.velocity = body.velocity.seen_from(new_from_old.rotation);
            }
        }
        self.shape.move_by(new_from_old, pelvis);
    }
}

fn tracked(found: &Aligned) -> Tracking {
    Tracking::Tracked {
        params: found.state.to_params(),
        residual_rms_m: found.residual_rms_m,
        joint_confidence: found.joint_confidence,
    }
}

/// How much the drawn body and the picture differ, less what the sensor's noise alone makes them differ.
fn beyond_noise_m(found: &Aligned, observation: &Observation) -> f32 {
    /// The mean of a normal error's size, in standard deviations.
    const MEAN_SIZE: f32 = 0.8;
    found.agreement.error_m - MEAN_SIZE * observation.view.noise_m
}
