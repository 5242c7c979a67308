//! What is compared: the avatar, and what it has to beat.

use std::{ops::ControlFlow, sync::Arc};

use anyhow::{Context as _, bail};
use effigy_avatar::{
    Avatar, AvatarError, CanonicalSamples, CanonicaliseConfig, Canonicaliser, PoseField, PoseInput,
    SignedDistanceField, TopologyConfig,
    baselines::{self, Architecture, BodyLabels, ConditionedField, PoseMap},
    extract_posed,
    fine_tune::{FineTuneConfig, fine_tune},
    hyper::{HyperNetwork, PRIOR_CONFIG, RateConfig},
    mesher,
};
use effigy_capture::CameraModel;
use effigy_fusion::{TriangleMesh, mesh::sample::sample_surface};
use effigy_registration::{BodyModel, BodyParams};
use glam::{Quat, Vec3};

use super::{
    fitted::{Tracked, track},
    plan::{Data, Job, Keyframes, Method, Poses},
    pretrain::Pretrained,
    subject::Subject,
    views::Views,
};
use crate::{
    interrupt,
    pipeline::{clock::Clock, evaluate::RESOLUTION, refine::Refinement, settings::Settings},
};

/// Points of a true surface that the oracle learns from.
const ORACLE_POINTS: usize = 5000;

/// The oracle may take its time.
const ORACLE_STEPS_FACTOR: u32 = 16;

/// With more keyframes than this, each step learns from so many of them.
const FRAMES_PER_STEP: usize = 8;

/// More frames are seen as often each as eight are, but no more steps are taken than this many times the live chain's.
const MOST_STEPS_FACTOR: u32 = 10;

/// Other people's ways take this many times our steps, each over half the keyframes.
const BASELINE_STEPS_FACTOR: u32 = 10;
const BASELINE_FRAMES_PER_STEP: usize = 4;
/// Adam's rates of networks that start from nothing, and of those that know people.
const BASELINE_RATE: f32 = 5e-4;
const ABLATION_RATE: f32 = 2e-4;

/// A method that has learned what it can of one person.
pub(super) struct Fitted {
    body: Arc<BodyModel>,
    betas: [f32; 10],
    /// Where the poses it learned from had the pelvis, in its own axes: whoever drives it has it there as well.
    pelvis_off_m: Vec3,
    surface: Surface,
}

enum Surface {
    Body,
    Avatar(Box<(Avatar, Canonicaliser)>),
    /// A field without a zero level: some baselines end there.
    Nothing,
}

impl Fitted {
    /// The surface in a true pose: the pelvis of the shape that is known lies on that of the true one, or where it was
    /// on average while it learned.
    pub(super) fn posed(&self, params: &BodyParams) -> TriangleMesh {
        let pelvis = |betas| self.body.joints(&self.body.shaped_vertices(betas))[0];
        let off = Quat::from_scaled_axis(params.theta[0]) * self.pelvis_off_m;
        let trans = params.trans + pelvis(&params.betas) - pelvis(&self.betas) + off;
        let params = BodyParams { betas: self.betas, trans, ..*params };
        match &self.surface {
            Surface::Body => {
                let vertices = self.body.pose(&params).vertices;
                let mut mesh = TriangleMesh::new(vertices, self.body.triangles.clone());
                mesh.compute_normals();
                mesh
            }
            Surface::Avatar(learned) => {
                let (avatar, canonicaliser) = &**learned;
                let resolution = resolution(avatar, &params);
                extract_posed(avatar, &**canonicaliser.skinning(), &params, resolution)
            }
            Surface::Nothing => TriangleMesh::default(),
        }
    }
}

/// The paper's grid, or a coarse one where a field is noise: on a fine one it would have millions of surfaces.
fn resolution(avatar: &Avatar, params: &BodyParams) -> usize {
    const COARSE: usize = 64;
    /// A body has some 3,300 vertices on the coarse grid.
    const MOST_VERTICES: usize = 20_000;
    let pose = avatar.subject.pose_input(&params.theta);
    let coarse = mesher::extract(&*avatar.field.field(&pose), COARSE);
    if coarse.vertices.len() > MOST_VERTICES {
        COARSE
    } else {
        RESOLUTION
    }
}

/// What all methods are given.
pub(super) struct Given<'a> {
    pub(super) subject: &'a Subject,
    pub(super) body: &'a Arc<BodyModel>,
    pub(super) settings: &'a Settings,
    /// What an ablation's network starts from.
    pub(super) pretrained: Option<Pretrained>,
    pub(super) clock: Clock,
}

/// A fitted method, how many frames it learned from and how long that took: canonicalising and learning count,
/// simulating, cleaning and tracking do not.
pub(super) struct Outcome {
    pub(super) fitted: Fitted,
    /// Frames that were to be learned from, and those that were: what is not tracked is not.
    pub(super) asked: usize,
    pub(super) learned_from: usize,
    pub(super) seconds: f64,
}

pub(super) fn fit(job: &Job, given: &Given<'_>) -> anyhow::Result<Outcome> {
    let (seen, seconds) = see(job, given)?;
    let Seen { asked, .. } = seen;
    let learned_from = seen.samples.len();
    let betas = seen.canonicaliser.subject().betas;
    let body = Arc::clone(given.body);
    let pelvis_off_m = seen.pelvis_off_m;
    if job.method == Method::BareBody {
        let fitted = Fitted { body, betas, pelvis_off_m, surface: Surface::Body };
        return Ok(Outcome { fitted, asked, learned_from, seconds: 0.0 });
    }
    let start = given.clock.secs();
    let avatar = learned(job, &seen, given)?;
    let seconds = seconds + given.clock.secs() - start;
    let surface = match avatar {
        Some(avatar) => Surface::Avatar(Box::new((avatar, seen.canonicaliser))),
        None => Surface::Nothing,
    };
    let fitted = Fitted { body, betas, pelvis_off_m, surface };
    Ok(Outcome { fitted, asked, learned_from, seconds })
}

/// What a method learns from.
struct Seen {
    canonicaliser: Canonicaliser,
    samples: Vec<CanonicalSamples>,
    asked: usize,
    pelvis_off_m: Vec3,
}

/// Looks at the frames a job learns from, and says how long canonicalising them took.
fn see(job: &Job, given: &Given<'_>) -> anyhow::Result<(Seen, f64)> {
    let Given { subject, body, settings, clock, .. } = given;
    let lessons = subject.lessons(job.data, settings.keyframes.count);
    let first = lessons.first().context("there are frames to learn from")?;
    let mut views = Views::new(job.camera, &settings.clean, job.seed);
    let mut tracked = match job.poses {
        Poses::True => None,
        Poses::Fitted => Some(track(&lessons, &mut views, body, &settings.track)?),
    };
    let betas = tracked
        .as_ref()
        .map_or(first.sequence.betas, |tracked| tracked.betas);
    let config = CanonicaliseConfig { seed: job.seed, ..settings.canonicalise.clone() };
    let canonicaliser =
        Canonicaliser::new(Arc::clone(body), &betas, config)?.with_camera(views.camera());
    if let Some(tracked) = &mut tracked {
        tracing::debug!(mm = tracked.joints_off_mm(body), "joints, as tracked");
        refine(tracked, views.camera(), &canonicaliser, given)?;
        tracing::debug!(mm = tracked.joints_off_mm(body), "joints, as learned from");
    }
    let pelvis_off_m = tracked
        .as_ref()
        .map_or(Vec3::ZERO, |tracked| tracked.pelvis_off_m(body));
    let (mut samples, mut seconds) = (Vec::new(), 0.0);
    let mut take = |keyframe, neighbours: &[_]| {
        let start = clock.secs();
        let seen = match job.keyframes {
            Keyframes::Single => canonicaliser.process(&keyframe),
            Keyframes::Snippet => canonicaliser.process_snippet(&keyframe, neighbours),
        };
        samples.extend(seen.map(|(samples, _)| samples));
        seconds += clock.secs() - start;
    };
    match (job.method, tracked) {
        (Method::Oracle, _) => samples = whole_surfaces(subject, &canonicaliser),
        (Method::BareBody, None) => {}
        (_, Some(tracked)) => {
            for (keyframe, before) in tracked.keyframes.into_iter().zip(&tracked.before) {
                take(keyframe, before);
            }
        }
        (_, None) => {
            for lesson in &lessons {
                let keyframe = views.keyframe(lesson)?;
                let neighbours = match job.keyframes {
                    Keyframes::Single => Vec::new(),
                    Keyframes::Snippet => views.neighbours(lesson)?,
                };
                take(keyframe, &neighbours);
            }
        }
    }
    let asked = lessons.len();
    Ok((
        Seen { canonicaliser, samples, asked, pelvis_off_m },
        seconds,
    ))
}

/// Looks at tracked keyframes again, if the settings want that.
fn refine(
    tracked: &mut Tracked,
    camera: &CameraModel,
    canonicaliser: &Canonicaliser,
    given: &Given<'_>,
) -> anyhow::Result<()> {
    let Given { body, settings, .. } = given;
    if settings.refine.passes > 0 {
        let prior = &settings.prior_network(body.identity)?;
        tracked.keyframes = Refinement { body, camera, canonicaliser, prior, settings }
            .refined(&tracked.keyframes, &mut |_, _| go_on())?;
    }
    Ok(())
}

/// The avatar, if what was learned has a surface.
fn learned(job: &Job, seen: &Seen, given: &Given<'_>) -> anyhow::Result<Option<Avatar>> {
    let Seen { canonicaliser, samples, .. } = seen;
    let theta = samples.first().context("no keyframe was tracked")?.theta;
    let avatar = Avatar::new(
        canonicaliser.subject(),
        field(job, seen, given)?,
        &**canonicaliser.skinning(),
        &theta,
        &TopologyConfig::default(),
    );
    match avatar {
        Ok(avatar) => Ok(Some(avatar)),
        Err(AvatarError::NoSurface { .. }) => Ok(None),
        Err(error) => Err(error.into()),
    }
}

/// The field that a method learns.
fn field(job: &Job, seen: &Seen, given: &Given<'_>) -> anyhow::Result<Arc<dyn PoseField>> {
    let Seen { canonicaliser, samples, .. } = seen;
    let tuning = tuning(job, samples.len(), &given.settings.fine_tune);
    let ours = |start: HyperNetwork, samples: &[CanonicalSamples]| {
        tuned(start, samples, canonicaliser, &tuning, given.clock)
    };
    let prior = || given.settings.prior_network(given.body.identity);
    Ok(match job.method {
        Method::BareBody | Method::Effigy | Method::Oracle => Arc::new(ours(prior()?, samples)?),
        Method::NoMetaLearning => {
            let untrained = HyperNetwork::untrained(PRIOR_CONFIG, tuning.seed);
            Arc::new(ours(untrained, samples)?)
        }
        Method::Static => {
            let pose = samples.first().context("there are samples")?.pose;
            let samples = samples.iter().cloned();
            let in_one_pose: Vec<_> = samples
                .map(|samples| CanonicalSamples { pose, ..samples })
                .collect();
            Arc::new(OnePose { network: ours(prior()?, &in_one_pose)?, pose })
        }
        Method::Occupancy | Method::Scanimate => Arc::new(baseline(job, seen, &tuning, given)?),
        Method::Mlp
        | Method::PositionalEncoding
        | Method::Siren
        | Method::HyperQuaternions
        | Method::HyperBones => {
            let start = given.pretrained.clone().context("the network was taught")?;
            match start {
                Pretrained::Hyper(network) => Arc::new(ours(*network, samples)?),
                Pretrained::Conditioned(mut field) => {
                    let rates = RateConfig { field: ABLATION_RATE, ..tuning.rates };
                    let tuning = FineTuneConfig { rates, ..tuning };
                    baselines::fit(&mut field, samples, &[], &tuning, &mut go_on)?;
                    Arc::new(field)
                }
            }
        }
    })
}

/// Other people's ways, fitted to this person alone.
fn baseline(
    job: &Job,
    seen: &Seen,
    tuning: &FineTuneConfig,
    given: &Given<'_>,
) -> anyhow::Result<ConditionedField> {
    let Seen { canonicaliser, samples, .. } = seen;
    let person = canonicaliser.subject();
    let tuning = FineTuneConfig {
        steps: tuning.steps * BASELINE_STEPS_FACTOR,
        frames_per_step: BASELINE_FRAMES_PER_STEP,
        rates: RateConfig { field: BASELINE_RATE, ..tuning.rates },
        ..*tuning
    };
    if job.method == Method::Occupancy {
        // As LEAP it knows people: from eight frames alone occupancy learns nothing that holds in a ninth.
        let Some(Pretrained::Conditioned(mut field)) = given.pretrained.clone() else {
            bail!("occupancy was not taught");
        };
        let labels = Arc::new(BodyLabels::new(given.body, person, job.seed)?);
        let labels = vec![labels; samples.len()];
        let rates = RateConfig { field: ABLATION_RATE, ..tuning.rates };
        let tuning = FineTuneConfig { rates, ..tuning };
        baselines::fit(&mut field, samples, &labels, &tuning, &mut go_on)?;
        return Ok(field);
    }
    let map = PoseMap::new(person, &**canonicaliser.skinning());
    let field = ConditionedField::new(Architecture::Scanimate, job.seed);
    let mut field = field.with_pose_map(Arc::new(map));
    baselines::fit(&mut field, samples, &[], &tuning, &mut go_on)?;
    Ok(field)
}

/// The live settings; with more frames more steps, each over as many frames as the live chain has keyframes.
fn tuning(job: &Job, frames: usize, live: &FineTuneConfig) -> FineTuneConfig {
    let live = match job.method {
        Method::BareBody | Method::Effigy => *live,
        // One surface for all poses is nearer without, too: who it is tells what poses do.
        Method::Static => live.without_code(),
        // Who does not know people has to be told which side is inside, and true surfaces have true normals.
        _ => FineTuneConfig { learns_normals: true, ..live.without_code() },
    };
    let mut tuning = FineTuneConfig { seed: job.seed, ..live };
    match (job.method, job.data) {
        (Method::Oracle, _) => {
            tuning.steps *= ORACLE_STEPS_FACTOR;
            tuning.rates = RateConfig { field: live.rates.field, ..RateConfig::everything() };
            tuning.frames_per_step = FRAMES_PER_STEP;
        }
        (_, Data::Percent(_)) if frames > FRAMES_PER_STEP => {
            tuning.steps *= MOST_STEPS_FACTOR.min((frames / FRAMES_PER_STEP) as u32);
            tuning.frames_per_step = FRAMES_PER_STEP;
            tuning.rates = RateConfig { field: live.rates.field, ..RateConfig::of_poses(frames) };
        }
        _ => {}
    }
    tuning
}

fn tuned(
    start: HyperNetwork,
    samples: &[CanonicalSamples],
    canonicaliser: &Canonicaliser,
    config: &FineTuneConfig,
    clock: Clock,
) -> anyhow::Result<HyperNetwork> {
    let metres_per_unit = canonicaliser.subject().unit_box.metres_per_unit();
    let secs = || clock.secs();
    Ok(fine_tune(
        start,
        samples,
        metres_per_unit,
        config,
        &secs,
        &mut |_, _| go_on(),
    )?)
}

pub(super) fn go_on() -> ControlFlow<()> {
    if interrupt::requested() {
        ControlFlow::Break(())
    } else {
        ControlFlow::Continue(())
    }
}

/// The true surfaces of the frames that are judged, brought to canonical space as keyframes are.
fn whole_surfaces(subject: &Subject, canonicaliser: &Canonicaliser) -> Vec<CanonicalSamples> {
    let tests = subject.tests.iter().zip(0..);
    tests
        .map(|(test, number)| {
            let points = sample_surface(&test.truth, ORACLE_POINTS, number);
            canonicaliser.process_surface(&test.params, &points).0
        })
        .collect()
}

/// A network that is always given the same pose.
struct OnePose {
    network: HyperNetwork,
    pose: PoseInput,
}

impl PoseField for OnePose {
    fn field(&self, _pose: &PoseInput) -> Box<dyn SignedDistanceField> {
        PoseField::field(&self.network, &self.pose)
    }

    fn kind(&self) -> &'static str {
        "one-pose"
    }

    fn to_bytes(&self) -> Vec<u8> {
        PoseField::to_bytes(&self.network)
    }
}
