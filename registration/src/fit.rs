//! Shape from several frames: one set of betas and a pose a frame, fitted together, inside the clothes.

use std::sync::Arc;

use glam::Vec3;
use serde::{Deserialize, Serialize};

use crate::{
    align::{Context, EnergyConfig, Evidence, thinned},
    correspond::{Renderer, Visibility},
    observe::Observation,
    residual::{ShapePrior, Term as _},
    solve::{Eliminated, NormalEquations, shorten},
    state::{ALL_UNKNOWNS, BETA_COUNT, BodyState, POSE_UNKNOWNS},
    surface::{PosedSurface, REGION_COUNT, ShapedSurface, Surface},
    thickness::Scatter,
};

/// When and from what the shape is estimated.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct FitConfig {
    /// Frames fitted together.
    pub frames: usize,
    /// Time after the first track at which the betas are estimated (again); after the last they are frozen.
    pub moments_secs: Vec<f32>,
    /// Frames kept for fitting are at least this far apart.
    pub spacing_secs: f32,
    /// Rounds of each estimate.
    pub rounds: usize,
    /// Frames of a round that are looked at in each call of the tracker: all at once would make it late.
    pub frames_a_call: usize,
    /// Use only every n-th depth point of the stored frames.
    pub every: usize,
    /// How much the betas' standard normal prior counts, in independent measurements.
    pub shape_prior_weight: f32,
    /// Whether the clothes' thickness is learned as well; otherwise it stays as the energy has it.
    pub learns_thickness: bool,
}

impl Default for FitConfig {
    fn default() -> Self {
        Self {
            frames: 8,
            moments_secs: vec![0.35, 1.2, 2.5, 4.5],
            spacing_secs: 0.12,
            rounds: 6,
            frames_a_call: 4,
            every: 3,
            shape_prior_weight: 2.0,
            learns_thickness: true,
        }
    }
}

/// The frames stored, and the estimate in progress.
#[derive(Clone, Debug)]
pub(crate) struct ShapeFit {
    surface: Arc<Surface>,
    views: Vec<StoredView>,
    last_stored_secs: f32,
    next_moment: usize,
    running: Option<Estimate>,
    confidence: [f32; BETA_COUNT],
}

#[derive(Clone, Debug)]
struct StoredView {
    observation: Observation,
    state: BodyState,
}

#[derive(Clone, Debug)]
struct Estimate {
    betas: [f32; BETA_COUNT],
    rounds_done: usize,
    /// Of the round's frames so far.
    parts: Vec<Option<Eliminated>>,
    scatter: Scatter,
}

/// What the frames say about the person.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Learned {
    pub(crate) betas: [f32; BETA_COUNT],
    /// How far their clothes stand off in each region on average, where that can be told.
    pub(crate) thickness_m: Option<[f32; REGION_COUNT]>,
}

/// What [`ShapeFit::advance`] needs to know of the frame it is called in.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Moment<'a> {
    /// Since the first track.
    pub(crate) secs: f32,
    pub(crate) observation: &'a Observation,
    pub(crate) state: &'a BodyState,
    /// Whether the frame is tracked well enough to learn from.
    pub(crate) good: bool,
}

impl ShapeFit {
    pub(crate) fn new(surface: Arc<Surface>) -> Self {
        Self {
            surface,
            views: Vec::new(),
            last_stored_secs: f32::MIN,
            next_moment: 0,
            running: None,
            confidence: [0.0; BETA_COUNT],
        }
    }

    /// For each beta how much of the population's variance the frames have ruled out: 0 is a guess, 1 is certain.
    pub(crate) fn confidence(&self) -> [f32; BETA_COUNT] {
        self.confidence
    }

    /// Whether the betas stay as they are from now on.
    pub(crate) fn is_frozen(&self, config: &FitConfig) -> bool {
        self.next_moment >= config.moments_secs.len() && self.running.is_none()
    }

    /// Stores the frame if it is worth it and works on the estimate; returns what was learned when an estimate is ready.
    pub(crate) fn advance(
        &mut self,
        moment: &Moment<'_>,
        config: &FitConfig,
        energy: &EnergyConfig,
        grounded: bool,
    ) -> Option<Learned> {
        if self.is_frozen(config) {
            self.views = Vec::new();
            return None;
        }
        if self.running.is_none() {
            self.store(moment, config);
            let due = moment.secs >= config.moments_secs[self.next_moment];
            if due && self.views.len() >= 3.min(config.frames) {
                self.next_moment += 1;
                let betas = moment.state.betas;
                self.running = Some(Estimate {
                    betas,
                    rounds_done: 0,
                    parts: Vec::new(),
                    scatter: Scatter::default(),
                });
            }
            return None;
        }
        let context = Context { energy, predicted: None, grounded, whole: true };
        self.work(config, &context);
        let running = self
            .running
            .take_if(|running| running.rounds_done >= config.rounds)?;
        let Estimate { betas, scatter, .. } = running;
        Some(Learned { betas, thickness_m: scatter.thickness_m() })
    }

    /// Follows the world when it moves.
    pub(crate) fn move_by(&mut self, new_from_old: effigy_capture::Rigid3, pelvis: Vec3) {
        for view in &mut self.views {
            view.observation.move_by(new_from_old);
            view.state = view.state.seen_from(new_from_old, pelvis);
        }
        if let Some(running) = &mut self.running {
            running.parts.clear();
            running.scatter = Scatter::default();
        }
    }

    fn store(&mut self, moment: &Moment<'_>, config: &FitConfig) {
        if !moment.good || moment.secs < self.last_stored_secs + config.spacing_secs {
            return;
        }
        self.last_stored_secs = moment.secs;
        self.views
            .push(StoredView { observation: moment.observation.clone(), state: *moment.state });
        if self.views.len() > config.frames {
            let least_new = self.most_redundant();
            self.views.remove(least_new);
        }
    }

    /// The view whose pose is nearest to another one's: it teaches least.
    fn most_redundant(&self) -> usize {
        let mut found = (0, f32::MAX);
        for a in 0..self.views.len() {
            for b in 0..a {
                let distance = novelty(&self.views[a].state, &self.views[b].state);
                if distance < found.1 {
                    // The older of the two goes.
                    found = (b, distance);
                }
            }
        }
        found.0
    }

    /// A part of a round of the estimate in progress, or what is left of it.
    fn work(&mut self, config: &FitConfig, context: &Context<'_>) {
        let Some(running) = &mut self.running else {
            return;
        };
        let shaped = ShapedSurface::new(&self.surface, running.betas);
        if running.parts.is_empty() {
            running.scatter = Scatter::default();
        }
        let open = self.views.iter().skip(running.parts.len());
        for view in open.take(config.frames_a_call.max(1)) {
            let part = eliminated(view, &shaped, config, context, &mut running.scatter);
            running.parts.push(part);
        }
        if running.parts.len() < self.views.len() {
            return;
        }
        let parts = std::mem::take(&mut running.parts);
        running.rounds_done += 1;
        let confidence = step(&shaped, &mut self.views, &parts, &mut running.betas, config);
        self.confidence = confidence.unwrap_or(self.confidence);
    }
}

/// A first idea of the shape from one frame, and the pose that goes with it.
pub(crate) fn fit_one(
    surface: &Arc<Surface>,
    observation: &Observation,
    state: &BodyState,
    config: &FitConfig,
    context: &Context<'_>,
) -> BodyState {
    let mut views = [StoredView { observation: observation.clone(), state: *state }];
    let mut betas = state.betas;
    for _ in 0..config.rounds {
        let shaped = ShapedSurface::new(surface, betas);
        let part = eliminated(&views[0], &shaped, config, context, &mut Scatter::default());
        step(&shaped, &mut views, &[part], &mut betas, config);
    }
    views[0].state
}

/// One frame's system without its pose; the clothes' scatter as a by-product.
fn eliminated(
    view: &StoredView,
    shaped: &ShapedSurface,
    config: &FitConfig,
    context: &Context<'_>,
    scatter: &mut Scatter,
) -> Option<Eliminated> {
    linearise(view, shaped, config, context, scatter).eliminate(
        POSE_UNKNOWNS,
        RELATIVE_DAMPING,
        1e-3,
    )
}

/// One Gauss-Newton step of all poses and the betas, from each frame's system without its pose. Returns how certain the
/// betas are then.
fn step(
    shaped: &ShapedSurface,
    views: &mut [StoredView],
    parts: &[Option<Eliminated>],
    betas: &mut [f32; BETA_COUNT],
    config: &FitConfig,
) -> Option<[f32; BETA_COUNT]> {
    let mut sum = NormalEquations::new(BETA_COUNT);
    for part in parts.iter().flatten() {
        sum.add(&part.rest);
    }
    sum.add(&prior(shaped, *betas, config));
    let mut betas_step = sum.solve(RELATIVE_DAMPING, 1e-6)?;
    shorten(&mut betas_step);
    for (beta, &step) in betas.iter_mut().zip(&betas_step) {
        *beta = (*beta + step as f32).clamp(-MOST_UNUSUAL, MOST_UNUSUAL);
    }
    for (view, part) in views.iter_mut().zip(parts) {
        if let Some(part) = part {
            let mut step = part.first_step(&betas_step);
            shorten(&mut step);
            view.state = view.state.moved_by(&step);
        }
        view.state.betas = *betas;
    }
    let variances = sum.variances()?;
    // The prior alone would leave a variance of one over its weight.
    let left = |beta: usize| variances[beta] as f32 * config.shape_prior_weight;
    Some(std::array::from_fn(|beta| {
        (1.0 - left(beta)).clamp(0.0, 1.0)
    }))
}

/// Betas, in standard deviations, beyond which the fit has gone wrong rather than met somebody rare.
const MOST_UNUSUAL: f32 = 4.0;
/// Keeps steps inside the region where matches still mean something.
const RELATIVE_DAMPING: f64 = 1e-2;

fn linearise(
    view: &StoredView,
    shaped: &ShapedSurface,
    config: &FitConfig,
    context: &Context<'_>,
    scatter: &mut Scatter,
) -> NormalEquations {
    let observation = &view.observation;
    let body = PosedSurface::new(shaped, &view.state).with_shape_derivatives();
    let visibility = if context.energy.visible_only {
        Renderer::new(&observation.view).visibility(&body, &observation.view)
    } else {
        Visibility::everything(&body)
    };
    let mut evidence = Evidence::default();
    let points = thinned(&observation.points, config.every);
    evidence.gather(&body, &visibility, observation, &points, context);
    scatter.add(&body, evidence.matches());
    evidence.with_terms(observation, context, |terms| {
        let mut system = NormalEquations::new(ALL_UNKNOWNS);
        for term in terms {
            term.emit(&body, &mut system);
        }
        system
    })
}

/// The shape prior as a system of the betas alone.
fn prior(shaped: &ShapedSurface, betas: [f32; BETA_COUNT], config: &FitConfig) -> NormalEquations {
    let term = ShapePrior { mean: [0.0; BETA_COUNT], weight: config.shape_prior_weight };
    let state = BodyState { betas, ..BodyState::REST };
    let mut whole = NormalEquations::new(ALL_UNKNOWNS);
    term.emit(&PosedSurface::new(shaped, &state), &mut whole);
    whole.tail(POSE_UNKNOWNS)
}

/// How differently two poses show a body: heading above all, then limbs.
fn novelty(a: &BodyState, b: &BodyState) -> f32 {
    let turn = |joint: usize| a.rotations[joint].angle_between(b.rotations[joint]);
    let limbs: f32 = [1, 2, 4, 5, 16, 17, 18, 19]
        .iter()
        .map(|&joint| turn(joint))
        .sum();
    2.0 * turn(0) + 0.25 * limbs
}
