//! Rounds of matching and moving: brings a posed body onto one observation.

use effigy_capture::Rigid3;
use glam::Vec3;
use serde::{Deserialize, Serialize};

use crate::{
    correspond::{
        Agreement, Contradictions, MatchConfig, Matcher, Renderer, Visibility, contradictions,
    },
    observe::{DataPoint, Observation},
    prior::surprise,
    residual::{
        ClothSide, DepthPush, FloorTerm, JointLimits, LegContact, LegsApart, Match, PointToPlane,
        PosePrior, Prediction, Silhouette, Standing, Temporal, Term, leg_contacts,
        sole_of_lower_foot,
    },
    smpl::JOINT_COUNT,
    solve::{Damping, Termination, take_step},
    state::BodyState,
    surface::{PosedSurface, REGION_COUNT, ShapedSurface, Surface},
};

/// How the terms weigh against each other. Each weight counts independent measurements: neighbouring pixels share
/// their errors (cloth, calibration), so all of a body's depth points together are worth a few hundred.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct EnergyConfig {
    /// What all depth points together are worth.
    pub data_weight: f32,
    /// Where people wear clothes, depth is expected this far off the skin. A shape that only stays inside
    /// the clothes would grow into them: girth explains an even layer as well as cloth does.
    pub cloth_standoff_m: f32,
    /// How many times that it is on the trunk, on upper arms, forearms, thighs and shins.
    pub cloth_by_region: [f32; REGION_COUNT],
    /// Hair stands off the skull by this.
    pub hair_m: f32,
    /// Shoes lift bare feet off the floor by this.
    pub sole_m: f32,
    /// A depth point this far outside the body costs one: clothes stand off the skin by this order.
    pub cloth_outside_m: f32,
    /// A depth point this far inside the body costs one: clothes are never there, noise and model errors are.
    pub cloth_inside_m: f32,
    /// What a depth point outside of the body says where clothes span a hollow: crotch and inner thighs.
    pub say_in_hollows: f32,
    /// Whether depth is matched with what the camera can see of the body only; otherwise with all that faces alike.
    pub visible_only: bool,
    /// Farther points belong to something else.
    pub outlier_m: f32,
    /// How far matches reach.
    pub reach_m: f32,
    /// A radian between the normals counts like this much distance in matching.
    pub direction_m: f32,
    /// Normals whose cosine is this or less do not match.
    pub oblique: f32,
    /// What all vertices together are worth if they contradict the silhouette or the depth.
    pub contradiction_weight: f32,
    /// A vertex this far outside the silhouette, or in front of the depth, costs one.
    pub contradiction_m: f32,
    /// How far the mask's rim is worn, so that less than this outside is no contradiction.
    pub silhouette_slack_m: f32,
    /// What it is worth that the pose is one that people take.
    pub pose_prior_weight: f32,
    /// What it is worth that the body goes on as it did.
    pub temporal_weight: f32,
    /// Depth noise that doubles the weight for a joint at rest: the noisier a frame, the less it tells of its own.
    pub still_noise_m: f32,
    /// A joint's turn against the prediction that costs one.
    pub temporal_rotation_rad: f32,
    /// A root's way against the prediction that costs one.
    pub temporal_trans_m: f32,
    /// A vertex this far under the floor costs one.
    pub floor_m: f32,
    /// What each of the feet's vertices is worth that is under the floor.
    pub floor_weight: f32,
    /// What the lower foot's standing on the floor is worth, and how exactly it does.
    pub standing_weight: f32,
    pub standing_m: f32,
    /// A joint this far beyond its limit costs one.
    pub joint_limit_rad: f32,
    /// What it is worth that no leg is inside the other, and how exactly that is known.
    pub contact_weight: f32,
    pub contact_m: f32,
}

impl Default for EnergyConfig {
    fn default() -> Self {
        Self {
            data_weight: 400.0,
            cloth_standoff_m: 0.010,
            cloth_by_region: [1.0; REGION_COUNT],
            hair_m: 0.008,
            sole_m: 0.012,
            cloth_outside_m: 0.020,
            cloth_inside_m: 0.008,
            say_in_hollows: 0.05,
            visible_only: true,
            outlier_m: 0.08,
            reach_m: 0.12,
            direction_m: 0.08,
            oblique: 0.3,
            contradiction_weight: 150.0,
            contradiction_m: 0.02,
            silhouette_slack_m: 0.012,
            pose_prior_weight: 1.0,
            temporal_weight: 1.0,
            still_noise_m: 0.0055,
            temporal_rotation_rad: 0.12,
            temporal_trans_m: 0.02,
            floor_m: 0.01,
            floor_weight: 0.05,
            standing_weight: 1.0,
            standing_m: 0.01,
            joint_limit_rad: 0.05,
            contact_weight: 20.0,
            contact_m: 0.02,
        }
    }
}

impl EnergyConfig {
    /// For clothes that stand off by so much on average in each region.
    pub(crate) fn with_clothes(&self, thickness_m: &[f32; REGION_COUNT]) -> Self {
        let standoff_m = self.cloth_standoff_m.max(1e-4);
        Self {
            cloth_standoff_m: standoff_m,
            cloth_by_region: thickness_m.map(|thickness_m| thickness_m / standoff_m),
            ..*self
        }
    }

    /// How far outside of the expected clothes a point costs one: the thicker they are, the less is known of them.
    fn cloth_outside_m(&self, times: f32) -> f32 {
        /// Cloth of any kind has folds, and none is known worse; unless the configuration says so.
        const KNOWN_TO_M: [f32; 2] = [0.010, 0.040];
        let configured_m = self.cloth_outside_m;
        let [best_m, worst_m] = KNOWN_TO_M;
        (configured_m * times).clamp(best_m.min(configured_m), worst_m.max(configured_m))
    }
}

/// What is known besides the picture.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Context<'a> {
    pub(crate) energy: &'a EnergyConfig,
    pub(crate) predicted: Option<&'a Prediction>,
    pub(crate) grounded: bool,
    /// Whether all of the body should be in the mask: not where it is cut off.
    pub(crate) whole: bool,
}

/// How long to try, and how carefully to look.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Effort {
    pub(crate) rounds: usize,
    /// Of each round, with the same matches.
    pub(crate) steps: usize,
    /// Use only every n-th depth point.
    pub(crate) every: usize,
    /// Self-occlusion by drawing, or only by facing.
    pub(crate) drawn_visibility: bool,
    /// Factor on the outlier scale in the first round; it falls to one in the last.
    pub(crate) widen: f32,
    /// From this share of the rounds on a step that gains nothing ends the alignment.
    pub(crate) settled_from: f32,
}

/// A step that lowers the energy by less than this share is the last.
const SMALLEST_DESCENT: f64 = 0.004;

/// A body brought onto an observation.
#[derive(Clone, Debug)]
pub(crate) struct Aligned {
    pub(crate) state: BodyState,
    pub(crate) agreement: Agreement,
    /// Of the inlier points to the surface.
    pub(crate) residual_rms_m: f32,
    /// Share of the depth points that no visible part of the body is near: a limb gone astray leaves them behind.
    pub(crate) stray: f32,
    pub(crate) joint_confidence: [f32; JOINT_COUNT],
    pub(crate) termination: Termination,
    pub(crate) rounds: usize,
}

impl Aligned {
    /// How well this body explains the picture, less being better: the drawing's error, points left behind, and
    /// how unusual the pose is, so weighted that between two bodies that look alike the ordinary one wins.
    pub(crate) fn score_m(&self) -> f32 {
        const STRAY_M: f32 = 0.05;
        const SURPRISE_M: f32 = 2e-4;
        self.agreement.error_m + STRAY_M * self.stray + SURPRISE_M * surprise(&self.state)
    }

    /// Whether enough is seen to call it a body: an end above the shoulders and a leg down to the knee.
    pub(crate) fn shows_whole_body(&self) -> bool {
        const SEEN: f32 = 0.3;
        let any = |joints: &[usize]| joints.iter().any(|&j| self.joint_confidence[j] > SEEN);
        any(&[12, 15]) && any(&[4, 5])
    }
}

/// Everything that a round's terms borrow.
#[derive(Clone, Debug, Default)]
pub(crate) struct Evidence {
    pub(crate) matches: Vec<Match>,
    matcher: Matcher,
    contradictions: Contradictions,
    floor_vertices: Vec<u32>,
    soles: Vec<u32>,
    leg_contacts: Vec<LegContact>,
    point_count: usize,
    widen: f32,
}

/// Moves the body from `start` towards the observation.
pub(crate) fn align(
    shaped: &ShapedSurface,
    start: &BodyState,
    observation: &Observation,
    context: &Context<'_>,
    effort: &Effort,
) -> Aligned {
    let mut renderer = Renderer::new(&observation.view);
    let mut evidence = Evidence::default();
    let mut body = PosedSurface::new(shaped, start);
    let mut damping = Damping::default();
    let mut termination = Termination::Singular;
    let mut visibility = Visibility::default();
    let points = thinned(&observation.points, effort.every);
    let mut rounds = 0;
    while rounds < effort.rounds {
        // What is hidden changes little from round to round, and drawing costs as much as matching.
        if rounds % 2 == 0 {
            visibility = if !context.energy.visible_only {
                Visibility::everything(&body)
            } else if effort.drawn_visibility {
                renderer.visibility(&body, &observation.view)
            } else {
                Visibility::by_facing(&body, camera_in_world(observation).translation)
            };
        }
        let progress = rounds as f32 / (effort.rounds - 1).max(1) as f32;
        evidence.widen = effort.widen + (1.0 - effort.widen) * progress;
        evidence.gather(&body, &visibility, observation, &points, context);
        for _ in 0..effort.steps {
            let outcome = evidence.with_terms(observation, context, |terms| {
                take_step(body, terms, &mut damping)
            });
            (body, termination) = outcome;
            if !termination.may_go_on(SMALLEST_DESCENT) {
                break;
            }
        }
        rounds += 1;
        if !termination.may_go_on(SMALLEST_DESCENT) && progress >= effort.settled_from {
            break;
        }
    }
    Aligned {
        state: body.state,
        agreement: renderer.agreement(&body, &observation.view),
        residual_rms_m: rms_m(&body, &evidence.matches, context.energy.outlier_m),
        stray: stray(&body, &evidence.matches, points.len()),
        joint_confidence: joint_confidence(&shaped.surface, &evidence.matches, points.len()),
        termination,
        rounds,
    }
}

impl Evidence {
    /// Looks for matches and contradictions of the body as it stands.
    pub(crate) fn gather(
        &mut self,
        body: &PosedSurface<'_>,
        visibility: &Visibility,
        observation: &Observation,
        points: &[DataPoint],
        context: &Context<'_>,
    ) {
        let energy = context.energy;
        let matching = MatchConfig {
            reach_m: energy.reach_m * self.widen.clamp(1.0, 3.0),
            direction_m: energy.direction_m,
            oblique: energy.oblique,
        };
        self.point_count = points.len();
        self.matcher
            .match_points(points, body, visibility, matching, &mut self.matches);
        let slack_cells = slack_cells(observation, energy);
        contradictions(
            body,
            visibility,
            &observation.view,
            slack_cells,
            &mut self.contradictions,
        );
        leg_contacts(body, &mut self.leg_contacts);
        if self.floor_vertices.is_empty() && context.grounded {
            self.floor_vertices = foot_vertices(&body.shaped.surface);
        }
        if context.grounded {
            sole_of_lower_foot(body, &self.floor_vertices, &mut self.soles);
        }
    }

    pub(crate) fn matches(&self) -> &[Match] {
        &self.matches
    }

    /// Hands all terms over what was gathered to `use_terms`.
    pub(crate) fn with_terms<R>(
        &self,
        observation: &Observation,
        context: &Context<'_>,
        use_terms: impl FnOnce(&[&dyn Term]) -> R,
    ) -> R {
        let energy = context.energy;
        let widen = self.widen.max(1.0);
        let data = PointToPlane {
            matches: &self.matches,
            cloth: energy.cloth_by_region.map(|times| ClothSide {
                outside: energy.cloth_outside_m(times),
                inside: energy.cloth_inside_m,
                outlier: energy.outlier_m * widen,
            }),
            standoff_m: energy
                .cloth_by_region
                .map(|times| energy.cloth_standoff_m * times),
            hair_m: energy.hair_m,
            say_in_hollows: energy.say_in_hollows,
            weight: energy.data_weight / self.point_count.max(1) as f32,
        };
        let per_vertex = energy.contradiction_weight / 1000.0;
        let camera = camera_in_world(observation);
        let silhouette = Silhouette {
            pulls: &self.contradictions.pulls,
            view: &observation.view,
            slack_cells: slack_cells(observation, energy),
            sigma_m: energy.contradiction_m,
            outlier_m: 0.15 * widen,
            weight: per_vertex,
        };
        let push = DepthPush {
            pushes: &self.contradictions.pushes,
            axis_in_world: camera.rotate(Vec3::Z),
            camera_in_world: camera.translation,
            sigma_m: energy.contradiction_m,
            outlier_m: 0.3,
            weight: 0.5 * per_vertex,
        };
        let floor = FloorTerm {
            vertices: &self.floor_vertices,
            sole_m: energy.sole_m,
            sigma_m: energy.floor_m,
            weight: energy.floor_weight,
        };
        let standing = Standing {
            vertices: &self.soles,
            sole_m: energy.sole_m,
            sigma_m: energy.standing_m,
            outlier_m: 0.04,
            weight: energy.standing_weight,
        };
        let prior = PosePrior { weight: energy.pose_prior_weight };
        let limits = JointLimits { sigma_rad: energy.joint_limit_rad };
        let temporal = context.predicted.map(|predicted| Temporal {
            predicted,
            rotation_sigma_rad: energy.temporal_rotation_rad,
            trans_sigma_m: energy.temporal_trans_m,
            weight: energy.temporal_weight,
            still_weight: energy.temporal_weight
                * (observation.view.noise_m / energy.still_noise_m).powi(2),
        });
        let legs = LegsApart {
            contacts: &self.leg_contacts,
            sigma_m: energy.contact_m,
            weight: energy.contact_weight,
        };
        let mut terms: Vec<&dyn Term> = vec![&data, &push, &prior, &limits, &legs];
        if context.whole {
            terms.push(&silhouette);
        }
        if context.grounded {
            terms.push(&floor);
            terms.push(&standing);
        }
        if let Some(temporal) = &temporal {
            terms.push(temporal);
        }
        use_terms(&terms)
    }
}

pub(crate) fn thinned(points: &[DataPoint], every: usize) -> Vec<DataPoint> {
    points.iter().step_by(every.max(1)).copied().collect()
}

pub(crate) fn camera_in_world(observation: &Observation) -> Rigid3 {
    observation.view.camera_from_world.inverse()
}

fn slack_cells(observation: &Observation, energy: &EnergyConfig) -> f32 {
    let depth_m = (observation.view.camera_from_world * observation.extent.center).z;
    (energy.silhouette_slack_m / observation.view.metres_per_cell(depth_m.max(0.1))).max(0.75)
}

/// Vertices carried by ankles and feet.
fn foot_vertices(surface: &Surface) -> Vec<u32> {
    (0..surface.vertices.len())
        .filter(|&v| matches!(surface.main_bone(v), 7 | 8 | 10 | 11))
        .map(|v| v as u32)
        .collect()
}

fn rms_m(body: &PosedSurface<'_>, matches: &[Match], outlier_m: f32) -> f32 {
    let (mut sum, mut count) = (0.0_f64, 0_u32);
    for found in matches {
        let distance_m = found
            .normal
            .dot(found.point - body.vertices[found.vertex as usize]);
        if distance_m.abs() < outlier_m {
            sum += f64::from(distance_m * distance_m);
            count += 1;
        }
    }
    (sum / f64::from(count.max(1))).sqrt() as f32
}

fn stray(body: &PosedSurface<'_>, matches: &[Match], points: usize) -> f32 {
    /// Loose clothes stand off less than this.
    const NEAR_M: f32 = 0.09;
    let near = matches
        .iter()
        .filter(|m| m.point.distance(body.vertices[m.vertex as usize]) < NEAR_M)
        .count();
    1.0 - near as f32 / points.max(1) as f32
}

/// From how much of each bone is matched: a thousandth of all points on a bone shows it somewhat, a hundredth well.
fn joint_confidence(surface: &Surface, matches: &[Match], points: usize) -> [f32; JOINT_COUNT] {
    let mut on_bone = [0.0_f32; JOINT_COUNT];
    for found in matches {
        let weights = &surface.skinning[found.vertex as usize];
        for (&bone, &weight) in weights.bones.iter().zip(&weights.weights) {
            on_bone[bone as usize] += weight * found.trust;
        }
    }
    let enough = 0.005 * points.max(1) as f32;
    on_bone.map(|seen| 1.0 - (-seen / enough).exp())
}
