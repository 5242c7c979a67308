//! What the avatar is worth: against observed depth always, against the truth where a simulator left it.

use std::sync::Arc;

use anyhow::Context as _;
use effigy_avatar::{
    Avatar, CanonicaliseConfig, DriveConfig, Driver, extract_posed, metrics, skinning::Skinning,
};
use effigy_capture::Rigid3;
use effigy_fusion::{TriangleMesh, mesh::normals::vertex_normals};
use effigy_registration::{BodyModel, BodyParams};
use effigy_sim_sensor::{GroundTruth, Truth};
use glam::Vec3;

use super::{
    avatar_stage::AvatarStage,
    poses::transformed,
    run_log::{RunLog, TrackedSample},
};
use crate::report::{BodyScores, Report, SurfaceScores};

/// Frames, evenly spread, whose observed points are compared with posed surfaces.
const OBSERVED_FRAMES: usize = 60;

/// Frames, evenly spread, whose true surface is compared with surfaces extracted in full.
const TRUTH_FRAMES: usize = 10;

/// MetaAvatar's grid: its `D_p` means nothing at another density.
pub(crate) const RESOLUTION: usize = 256;

/// Fills in the report's scores.
pub(crate) fn evaluate(
    report: &mut Report,
    log: &RunLog,
    body: &Arc<BodyModel>,
    (stage, canonicalise): (&AvatarStage, &CanonicaliseConfig),
    truth: Option<&Truth>,
) -> anyhow::Result<()> {
    let avatar = stage.avatar();
    let unseen: Vec<&TrackedSample> = log.unseen().collect();
    let observed = evenly(&unseen, OBSERVED_FRAMES);
    let bare_mesh = |params: &BodyParams| mesh(body.pose(params).vertices, &body.triangles);
    let bare_observed = mean_observed(&observed, |sample| bare_mesh(&sample.params))?;
    let mut bare = SurfaceScores::default().with_observed(bare_observed);
    if let Some(truth) = truth {
        report.body = body_scores(log, body, truth);
        report.truth = Some(SurfaceScores {
            observed_mm: mean_observed(&observed, |sample| true_surface_in_world(truth, sample))?,
            ..SurfaceScores::default()
        });
        let frames = evenly(&unseen, TRUTH_FRAMES).into_iter();
        let frames = frames.map(|sample| Compared::new(sample, truth, body));
        let judge = Judge { body, frames: frames.collect() };
        bare = judge
            .scores(Poses::True, &bare_mesh)?
            .with_observed(bare.observed_mm);
        let tracked = judge.scores(Poses::Tracked, &bare_mesh)?;
        report.bare_body_tracked = Some(tracked.with_observed(bare.observed_mm));
        let in_full = |avatar| FullSurface::new(avatar, body, canonicalise);
        if let (Some((avatar, _)), Some(preview)) = (stage.preview(), &mut report.preview) {
            let surface = in_full(avatar)?;
            preview.scores = judge.scores(Poses::True, &|params| surface.posed(params))?;
        }
        if let Some(avatar) = avatar {
            let surface = in_full(avatar)?;
            let avatar_mesh = |params: &BodyParams| surface.posed(params);
            report.avatar = Some(judge.scores(Poses::True, &avatar_mesh)?);
            report.avatar_tracked = Some(judge.scores(Poses::Tracked, &avatar_mesh)?);
        }
    }
    if let Some(avatar) = avatar {
        let mut driver = Driver::new(Arc::clone(avatar), DriveConfig::default());
        let seen = mean_observed(&observed, |sample| {
            driver.pose(&sample.params, sample.id).to_mesh()
        })?;
        report.avatar = Some(report.avatar.unwrap_or_default().with_observed(seen));
        report.avatar_tracked = report
            .avatar_tracked
            .map(|scores| scores.with_observed(seen));
    }
    report.bare_body = Some(bare);
    Ok(())
}

impl SurfaceScores {
    fn with_observed(self, observed_mm: Option<f64>) -> Self {
        Self { observed_mm, ..self }
    }
}

/// Whose poses a surface is put into before it is compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Poses {
    True,
    Tracked,
}

/// Sums of MetaAvatar's measures and the symmetric one over frames.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct ScoreSum {
    sums: [f64; 4],
    pub(crate) frames: usize,
}

/// Means over frames.
#[derive(Clone, Copy, Debug)]
pub(crate) struct MeanScores {
    pub(crate) d_p_cm: f64,
    pub(crate) d_f_cm: f64,
    pub(crate) nc: f64,
    pub(crate) p2s_mm: f64,
}

impl ScoreSum {
    /// Adds a frame, unless nothing of it can be measured; both surfaces in one space.
    pub(crate) fn add(
        &mut self,
        truth: &TriangleMesh,
        measured: &[bool],
        predicted: &TriangleMesh,
    ) -> anyhow::Result<()> {
        let Some(scores) = metrics::surface_metrics(truth, measured, predicted)? else {
            return Ok(());
        };
        let p2s_mm = metrics::p2s_mm(truth, predicted)?;
        let values = [scores.d_p_cm, scores.d_f_cm, scores.nc, p2s_mm];
        for (sum, value) in self.sums.iter_mut().zip(values) {
            *sum += f64::from(value);
        }
        self.frames += 1;
        Ok(())
    }

    /// `None` of no frame.
    pub(crate) fn mean(&self) -> Option<MeanScores> {
        let [d_p_cm, d_f_cm, nc, p2s_mm] = self.sums.map(|sum| sum / self.frames as f64);
        (self.frames > 0).then_some(MeanScores { d_p_cm, d_f_cm, nc, p2s_mm })
    }
}

/// A frame and its truth, in the depth camera's space.
struct Compared<'a> {
    sample: &'a TrackedSample,
    truth: GroundTruth,
    surface: TriangleMesh,
    measured: Vec<bool>,
}

impl<'a> Compared<'a> {
    fn new(sample: &'a TrackedSample, truth: &Truth, body: &BodyModel) -> Self {
        let truth = truth.at(sample.id);
        let camera_from_sim = truth.world_from_camera.inverse();
        let surface = moved(&truth.clothed_in_world, camera_from_sim);
        let weights = match &truth.in_cloth {
            Some(cloth) => &cloth.weights,
            None => &body.skinning,
        };
        let measured = metrics::measured_vertices(weights, &surface.triangles);
        Self { sample, truth, surface, measured }
    }
}

/// Compares surfaces with the true one.
struct Judge<'a> {
    body: &'a BodyModel,
    frames: Vec<Compared<'a>>,
}

impl Judge<'_> {
    fn scores(
        &self,
        poses: Poses,
        surface_in_own_space: &dyn Fn(&BodyParams) -> TriangleMesh,
    ) -> anyhow::Result<SurfaceScores> {
        let mut sum = ScoreSum::default();
        for frame in &self.frames {
            let params = self.params_in_camera(frame.sample, &frame.truth, poses);
            let predicted = surface_in_own_space(&params);
            sum.add(&frame.surface, &frame.measured, &predicted)?;
        }
        let mean = sum.mean();
        Ok(SurfaceScores {
            observed_mm: None,
            d_p_cm: mean.map(|mean| mean.d_p_cm),
            d_f_cm: mean.map(|mean| mean.d_f_cm),
            nc: mean.map(|mean| mean.nc),
            p2s_mm: mean.map(|mean| mean.p2s_mm),
        })
    }

    /// The pose in camera space, with the fitted shape: two shapes' pelvises are laid on each other.
    fn params_in_camera(
        &self,
        sample: &TrackedSample,
        true_frame: &GroundTruth,
        poses: Poses,
    ) -> BodyParams {
        let pelvis = |betas| self.body.joints(&self.body.shaped_vertices(betas))[0];
        let fitted_pelvis = pelvis(&sample.params.betas);
        match poses {
            Poses::Tracked => transformed(
                &sample.params,
                sample.world_from_camera.inverse(),
                fitted_pelvis,
            ),
            Poses::True => {
                let true_pelvis = pelvis(&true_frame.params.betas);
                let camera_from_sim = true_frame.world_from_camera.inverse();
                let mut params = transformed(&true_frame.params, camera_from_sim, true_pelvis);
                params.trans += true_pelvis - fitted_pelvis;
                BodyParams { betas: sample.params.betas, ..params }
            }
        }
    }
}

/// The avatar extracted at full resolution for each pose.
struct FullSurface<'a> {
    avatar: &'a Avatar,
    /// As the avatar's own.
    skinning: Arc<dyn Skinning>,
}

impl<'a> FullSurface<'a> {
    fn new(
        avatar: &'a Avatar,
        body: &Arc<BodyModel>,
        canonicalise: &CanonicaliseConfig,
    ) -> anyhow::Result<Self> {
        let skinning = canonicalise.skinning_of(body, &avatar.subject.betas)?;
        Ok(Self { avatar, skinning })
    }

    fn posed(&self, params: &BodyParams) -> TriangleMesh {
        extract_posed(self.avatar, &*self.skinning, params, RESOLUTION)
    }
}

/// Joints and vertices of the tracked body against the true one, over all tracked frames.
fn body_scores(log: &RunLog, body: &BodyModel, truth: &Truth) -> Option<BodyScores> {
    let mut sums = [0.0_f64; 2];
    for sample in &log.tracked {
        let (minimal, world_from_camera) = truth.minimal(sample.id);
        let tracked = body.pose(&sample.params);
        let to_camera = |b_from_a: Rigid3, points: &[Vec3]| -> Vec<Vec3> {
            points.iter().map(|&point| b_from_a * point).collect()
        };
        let from_tracked = sample.world_from_camera.inverse();
        let from_true = world_from_camera.inverse();
        sums[0] += f64::from(metrics::v2v_mm(
            &to_camera(from_true, &minimal.joints),
            &to_camera(from_tracked, &tracked.joints),
        ));
        sums[1] += f64::from(metrics::v2v_mm(
            &to_camera(from_true, &minimal.vertices),
            &to_camera(from_tracked, &tracked.vertices),
        ));
    }
    let count = log.tracked.len() as f64;
    (count > 0.0).then(|| BodyScores { mpjpe_mm: sums[0] / count, v2v_mm: sums[1] / count })
}

/// Mean over frames of the mean distance from observed points to a surface in the sample's world.
fn mean_observed(
    samples: &[&TrackedSample],
    mut surface: impl FnMut(&TrackedSample) -> TriangleMesh,
) -> anyhow::Result<Option<f64>> {
    let mut sum = 0.0;
    for sample in samples {
        let points: Vec<Vec3> = sample
            .points_in_camera
            .iter()
            .map(|&point| sample.world_from_camera * point)
            .collect();
        let distance_mm = metrics::observed_mm(&points, &surface(sample))
            .with_context(|| format!("frame {}", sample.id.0))?;
        sum += f64::from(distance_mm);
    }
    Ok((!samples.is_empty()).then(|| sum / samples.len() as f64))
}

/// The true surface in the world that tracking found for itself.
fn true_surface_in_world(truth: &Truth, sample: &TrackedSample) -> TriangleMesh {
    let true_frame = truth.at(sample.id);
    let world_from_sim = sample.world_from_camera * true_frame.world_from_camera.inverse();
    moved(&true_frame.clothed_in_world, world_from_sim)
}

fn moved(mesh_in_a: &TriangleMesh, b_from_a: Rigid3) -> TriangleMesh {
    let vertices = mesh_in_a
        .vertices
        .iter()
        .map(|&vertex| b_from_a * vertex)
        .collect();
    mesh(vertices, &mesh_in_a.triangles)
}

fn mesh(vertices: Vec<Vec3>, triangles: &[[u32; 3]]) -> TriangleMesh {
    let normals = vertex_normals(&vertices, triangles);
    TriangleMesh { vertices, normals, triangles: triangles.to_vec(), colors: Vec::new() }
}

/// At most `count` items, evenly spread.
fn evenly<T: Copy>(items: &[T], count: usize) -> Vec<T> {
    let places = evenly_placed(items.len(), count).into_iter();
    places.map(|place| items[place]).collect()
}

/// At most `count` of the places below `length`, evenly spread, in order.
pub(crate) fn evenly_placed(length: usize, count: usize) -> Vec<usize> {
    let taken = count.min(length);
    (0..taken)
        .map(|index| (2 * index + 1) * length / (2 * taken))
        .collect()
}
