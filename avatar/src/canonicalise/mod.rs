//! From a registered depth frame to canonical samples: points on the person's surface and in the empty
//! space around it, moved to star pose and unit space.

mod contact;
mod free_space;
mod snippet;
mod unpose;

use std::{path::PathBuf, sync::Arc};

use effigy_capture::CameraModel;
use effigy_fusion::{CleanFrame, maps::Rays, mesh::sample::SurfaceSample};
use effigy_registration::{BodyModel, BodyParams, PosedBody, RegisteredFrame};
use glam::Vec3;
use rand::{RngExt as _, SeedableRng as _, rngs::StdRng};
use serde::{Deserialize, Serialize};

use crate::{
    error::AvatarError,
    model::Subject,
    samples::CanonicalSamples,
    skinning::{
        ClosestBodyPoint, ClosestBodyPointConfig, NetworkSkinning, Skinning, SkinningNetworks, Warp,
    },
};
use contact::Contacts;
pub use snippet::SnippetConfig;
use unpose::Unposer;
pub use unpose::canonical_places;

/// What gives points their bone weights.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SkinningChoice {
    /// No training: the closest point of the minimal body.
    #[default]
    ClosestBodyPoint,
    /// The networks that ship with the program, for the built-in body.
    Shipped,
    /// Networks in a file that `effigy train skinning` wrote.
    Network(PathBuf),
}

/// Which points are taken from a frame, and which of them are believed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct CanonicaliseConfig {
    /// Surface points a frame gives at most (MetaAvatar: 5000).
    pub points: usize,
    /// Empty points a frame gives at most, half in front of the surface and half beside it.
    pub free_points: usize,
    /// Points farther from the posed minimal body belong to something else: skirts stay within.
    pub max_distance_to_body_m: f32,
    /// Points that inverse and forward skinning do not bring back to within this are dropped.
    pub max_return_m: f32,
    /// Within this of a forearm and of the rest of the body, a point's side is in doubt...
    pub contact_reach_m: f32,
    /// ...unless it is nearer to one by at least this much.
    pub contact_margin_m: f32,
    /// Corrections of a canonical point by forward skinning: each makes driving reproduce it better.
    pub refine_steps: usize,
    /// Grazing rays see little and err much: no say below this cosine of ray and normal.
    pub min_view_cosine: f32,
    /// Depth noise that still gives full weight; the weight falls with the square beyond.
    pub full_weight_sigma_m: f32,
    /// Empty points lie between these distances in front of the observed surface.
    pub free_in_front_m: [f32; 2],
    /// Empty points are kept this near the body, where canonical space is unambiguous.
    pub max_free_distance_to_body_m: f32,
    /// Background pixels between these distances from the person's outline give empty points: farther than
    /// the mask can err, nearer than clothes can matter.
    pub beside_outline_px: [u32; 2],
    /// How a keyframe's neighbours in time are averaged with it, where there are any.
    pub snippet: SnippetConfig,
    pub skinning: SkinningChoice,
    /// Of [`SkinningChoice::ClosestBodyPoint`]; networks look at the body as they did in training.
    pub closest_body_point: ClosestBodyPointConfig,
    pub seed: u64,
}

impl Default for CanonicaliseConfig {
    fn default() -> Self {
        Self {
            points: 5000,
            free_points: 2500,
            max_distance_to_body_m: 0.15,
            max_return_m: 0.02,
            contact_reach_m: 0.10,
            contact_margin_m: 0.04,
            refine_steps: 3,
            min_view_cosine: 0.15,
            full_weight_sigma_m: 0.003,
            free_in_front_m: [0.02, 0.15],
            max_free_distance_to_body_m: 0.06,
            beside_outline_px: [3, 14],
            snippet: SnippetConfig::default(),
            skinning: SkinningChoice::default(),
            closest_body_point: ClosestBodyPointConfig::default(),
            seed: 0,
        }
    }
}

impl CanonicaliseConfig {
    /// The chosen skinning for one person. Networks that were trained with another body are refused.
    pub fn skinning_of(
        &self,
        model: &Arc<BodyModel>,
        betas: &[f32; 10],
    ) -> Result<Arc<dyn Skinning>, AvatarError> {
        let networks = match &self.skinning {
            SkinningChoice::ClosestBodyPoint => {
                let config = self.closest_body_point.clone();
                return Ok(Arc::new(ClosestBodyPoint::new(
                    Arc::clone(model),
                    betas,
                    config,
                )));
            }
            SkinningChoice::Shipped => SkinningNetworks::shipped(model.identity)?,
            SkinningChoice::Network(path) => SkinningNetworks::load(path, model.identity)?,
        };
        Ok(Arc::new(NetworkSkinning::new(
            Arc::new(networks),
            Arc::clone(model),
            betas,
        )))
    }
}

/// What became of a frame's points.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct CanonicaliseCounts {
    pub observed: usize,
    pub kept: usize,
    pub far_from_body: usize,
    /// Where a hand is near something else.
    pub in_contact: usize,
    pub not_returned: usize,
    pub outside_box: usize,
    pub free: usize,
}

/// Canonicalises frames of one person.
pub struct Canonicaliser {
    model: Arc<BodyModel>,
    subject: Subject,
    skinning: Arc<dyn Skinning>,
    config: CanonicaliseConfig,
    rays: Option<Rays>,
}

/// Points in world space with what is known of them.
#[derive(Default)]
struct Observed {
    points: Vec<Vec3>,
    normals: Vec<Vec3>,
    weights: Vec<f32>,
}

impl Canonicaliser {
    /// With the skinning that the configuration chooses.
    pub fn new(
        model: Arc<BodyModel>,
        betas: &[f32; 10],
        config: CanonicaliseConfig,
    ) -> Result<Self, AvatarError> {
        let skinning = config.skinning_of(&model, betas)?;
        Self::with_skinning(model, betas, skinning, config)
    }

    pub fn with_skinning(
        model: Arc<BodyModel>,
        betas: &[f32; 10],
        skinning: Arc<dyn Skinning>,
        config: CanonicaliseConfig,
    ) -> Result<Self, AvatarError> {
        let subject = Subject::new(&model, betas)?;
        Ok(Self { model, subject, skinning, config, rays: None })
    }

    /// Tells where background pixels look, which gives empty points beside the person too.
    pub fn with_camera(mut self, camera: &CameraModel) -> Self {
        self.rays = Some(Rays::new(camera));
        self
    }

    pub fn subject(&self) -> &Subject {
        &self.subject
    }

    pub fn skinning(&self) -> &Arc<dyn Skinning> {
        &self.skinning
    }

    /// The frame's samples, if a body was tracked in it. The shape is this person's, whatever the frame's
    /// `betas` say.
    pub fn process(
        &self,
        frame: &RegisteredFrame,
    ) -> Option<(CanonicalSamples, CanonicaliseCounts)> {
        let params = BodyParams { betas: self.subject.betas, ..*frame.params()? };
        let posed = self.model.pose(&params);
        let warp = Warp::new(&params, &self.subject.rest_joints);
        let mut rng = StdRng::seed_from_u64(self.config.seed ^ frame.id().0.rotate_left(32));

        let seen = self.observed(frame);
        let mut counts = CanonicaliseCounts { observed: seen.points.len(), ..Default::default() };
        // A quarter more than wanted, since some will be dropped.
        let seen = seen.pick(self.config.points * 5 / 4, &mut rng);
        let unposer = self.unposer(&posed, &warp);
        let mut samples = self.surface(&seen, &params, &unposer, &mut counts);

        let free = free_space::points_in_world(frame, self.rays.as_ref(), &self.config, &mut rng);
        samples.free_in_unit = self.free(&free, &unposer);
        counts.free = samples.free_in_unit.len();
        Some((samples, counts))
    }

    /// Points of a surface that is known, not seen, in the pose of `params`: in world space, with unit normals. They
    /// pass the tests of [`Self::process`] and all have weight one; there are no empty points.
    pub fn process_surface(
        &self,
        params: &BodyParams,
        surface: &[SurfaceSample],
    ) -> (CanonicalSamples, CanonicaliseCounts) {
        let params = BodyParams { betas: self.subject.betas, ..*params };
        let posed = self.model.pose(&params);
        let warp = Warp::new(&params, &self.subject.rest_joints);
        let known = Observed {
            points: surface.iter().map(|sample| sample.point).collect(),
            normals: surface.iter().map(|sample| sample.normal).collect(),
            weights: vec![1.0; surface.len()],
        };
        let mut counts = CanonicaliseCounts { observed: surface.len(), ..Default::default() };
        let unposer = self.unposer(&posed, &warp);
        let samples = self.surface(&known, &params, &unposer, &mut counts);
        (samples, counts)
    }

    fn unposer<'a>(&'a self, posed: &'a PosedBody, warp: &'a Warp) -> Unposer<'a> {
        let refine_steps = self.config.refine_steps;
        Unposer { skinning: &*self.skinning, posed, warp, refine_steps }
    }

    /// As [`Self::process`], with the noise averaged over frames just before and after, each in its own pose.
    pub fn process_snippet(
        &self,
        keyframe: &RegisteredFrame,
        neighbours: &[RegisteredFrame],
    ) -> Option<(CanonicalSamples, CanonicaliseCounts)> {
        let (samples, counts) = self.process(keyframe)?;
        let others: Vec<CanonicalSamples> = neighbours
            .iter()
            .filter_map(|frame| Some(self.process(frame)?.0))
            .collect();
        let metres_per_unit = self.subject.unit_box.metres_per_unit();
        let fused = snippet::fused(samples, &others, metres_per_unit, self.config.snippet);
        Some((fused, counts))
    }

    /// The person's pixels that have a say, as world points.
    fn observed(&self, frame: &RegisteredFrame) -> Observed {
        let clean: &CleanFrame = &frame.clean;
        let mut observed = Observed::default();
        for pixel in (0..clean.person.len()).filter(|&pixel| clean.person[pixel]) {
            let point = clean.vertices.points[pixel];
            if !point.is_finite() {
                continue;
            }
            let normal = Some(clean.normals.normals[pixel])
                .filter(|normal| normal.is_finite())
                .unwrap_or(Vec3::ZERO);
            let weight = self.weight(point, normal, clean.sigma_m[pixel]);
            if weight > 0.0 {
                observed.points.push(frame.world_from_camera * point);
                observed
                    .normals
                    .push(frame.world_from_camera.rotate(normal));
                observed.weights.push(weight);
            }
        }
        observed
    }

    /// Say by sensor noise and by how squarely the ray meets the surface; points without a normal are
    /// edges and holes, and get the say of a slanted one.
    fn weight(&self, point: Vec3, normal: Vec3, sigma_m: f32) -> f32 {
        const WITHOUT_NORMAL: f32 = 0.3;
        /// From this cosine on, the view is as good as square.
        const SQUARE: f32 = 0.6;
        let by_sigma = (self.config.full_weight_sigma_m / sigma_m.max(1e-6))
            .powi(2)
            .min(1.0);
        let by_angle = if normal == Vec3::ZERO {
            WITHOUT_NORMAL
        } else {
            let cosine = -normal.dot(point.normalize_or_zero());
            let grazing = self.config.min_view_cosine;
            ((cosine - grazing) / (SQUARE - grazing).max(1e-3)).clamp(0.0, 1.0)
        };
        if by_sigma.is_finite() {
            by_sigma * by_angle
        } else {
            0.0
        }
    }

    /// Samples of what passes all tests, without empty points.
    fn surface(
        &self,
        seen: &Observed,
        params: &BodyParams,
        unposer: &Unposer<'_>,
        counts: &mut CanonicaliseCounts,
    ) -> CanonicalSamples {
        let (reach_m, margin_m) = (self.config.contact_reach_m, self.config.contact_margin_m);
        let contacts = Contacts::new(&self.model, &unposer.posed.vertices, reach_m, margin_m);
        let undecided = contacts.are_undecided(&seen.points);
        let limit_m = self.config.max_distance_to_body_m;
        let returned = unposer.unpose(&seen.points, &seen.normals, limit_m);
        let mut samples = CanonicalSamples {
            theta: params.theta,
            pose: self.subject.pose_input(&params.theta),
            points_in_unit: Vec::new(),
            normals: Vec::new(),
            weights: Vec::new(),
            free_in_unit: Vec::new(),
        };
        let judged = returned.iter().zip(&seen.weights).zip(undecided);
        for ((point, &weight), undecided) in judged {
            let in_unit = self.subject.unit_box.unit_from_canonical(point.canonical);
            if point.distance_to_body_m > limit_m {
                counts.far_from_body += 1;
            } else if undecided {
                counts.in_contact += 1;
            } else if point.miss_m.is_nan() || point.miss_m > self.config.max_return_m {
                counts.not_returned += 1;
            } else if !in_unit_box(in_unit) {
                counts.outside_box += 1;
            } else if samples.points_in_unit.len() < self.config.points {
                samples.points_in_unit.push(in_unit);
                samples.normals.push(point.normal);
                samples.weights.push(weight);
            }
        }
        counts.kept = samples.points_in_unit.len();
        samples
    }

    /// Unit-space places of empty points near the body.
    fn free(&self, points: &[Vec3], unposer: &Unposer<'_>) -> Vec<Vec3> {
        /// Empty points must return well: a wrong one would carve the body.
        const MAX_MISS_M: f32 = 0.005;
        let limit_m = self.config.max_free_distance_to_body_m;
        unposer
            .unpose(points, &[], limit_m)
            .iter()
            .filter(|point| point.distance_to_body_m <= limit_m && point.miss_m <= MAX_MISS_M)
            .map(|point| self.subject.unit_box.unit_from_canonical(point.canonical))
            .filter(|&point| in_unit_box(point))
            .take(self.config.free_points)
            .collect()
    }
}

impl Observed {
    /// At most `count` of the points, evenly by chance, in random order.
    fn pick(mut self, count: usize, rng: &mut StdRng) -> Self {
        let total = self.points.len();
        let count = count.min(total);
        for index in 0..count {
            let other = rng.random_range(index..total);
            self.points.swap(index, other);
            self.normals.swap(index, other);
            self.weights.swap(index, other);
        }
        self.points.truncate(count);
        self.normals.truncate(count);
        self.weights.truncate(count);
        self
    }
}

fn in_unit_box(point: Vec3) -> bool {
    // Also false for NaN.
    point.abs().max_element() <= 1.0
}

#[cfg(test)]
mod tests;
