//! One frame's tracked body against the true one, in the depth camera's space.

use effigy_capture::{Intrinsics, Rigid3, Timestamp};
use effigy_fusion::mesh::{
    TriangleMesh,
    z_buffer::{Faces, Raster, Rasterizer},
};
use effigy_registration::{
    BodyModel, BodyParams, RegisteredFrame, Tracking,
    smpl::{JOINT_COUNT, VertexWeights},
};
use effigy_sim_sensor::GroundTruth;
use glam::Vec3;

/// A root farther off than this is no track.
pub(super) const LOST_M: f32 = 0.3;
/// A joint is observed if the camera sees at least this share of the surface that its bone moves most.
const OBSERVED_SHARE: f32 = 0.15;
/// A vertex this far behind the drawn surface is still on it.
const ON_SURFACE_M: f32 = 0.01;

/// What came of one case.
#[derive(Clone, Debug, Default)]
pub(super) struct CaseScores {
    pub(super) frames: Vec<FrameScore>,
    /// Found minus true, once the shape is as good as it gets.
    pub(super) height_error_m: Option<f32>,
    pub(super) losses: Vec<LossScore>,
}

#[derive(Clone, Debug)]
pub(super) struct FrameScore {
    pub(super) timestamp: Timestamp,
    /// Processor time of cleaning and tracking.
    pub(super) milliseconds: f32,
    pub(super) present: bool,
    pub(super) state: State,
    /// The joints that there is a truth about, and those of them that the camera could see.
    pub(super) measured: [bool; JOINT_COUNT],
    pub(super) observed: [bool; JOINT_COUNT],
    /// Where a body was tracked.
    pub(super) errors: Option<BodyErrors>,
    /// The same after smoothing; of our own people only.
    pub(super) smooth_errors: Option<BodyErrors>,
}

/// What tracking said.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum State {
    Tracked,
    Partial,
    Lost,
}

#[derive(Clone, Debug)]
pub(super) struct BodyErrors {
    pub(super) joints_mm: [f32; JOINT_COUNT],
    /// `None` where the truth has another surface than SMPL's.
    pub(super) v2v_mm: Option<f32>,
    pub(super) root_m: f32,
    /// Found minus true.
    pub(super) wrists_mm: [Vec3; 2],
    /// Left and right fit better the other way around.
    pub(super) swapped: bool,
}

/// How one disappearance went.
#[derive(Clone, Copy, Debug)]
pub(super) struct LossScore {
    /// From going to the first frame that says so; `None` if none did before the person came back.
    pub(super) noticed_secs: Option<f32>,
    /// From reappearing to the first true track; `None` if there was none.
    pub(super) reacquired_secs: Option<f32>,
}

impl State {
    pub(super) fn of(tracking: &Tracking) -> Self {
        match tracking {
            Tracking::Tracked { .. } => Self::Tracked,
            Tracking::Partial { .. } => Self::Partial,
            Tracking::Lost { .. } => Self::Lost,
        }
    }
}

impl FrameScore {
    /// Whether tracking should have said that there is no track.
    pub(super) fn truly_lost(&self) -> bool {
        !self.present
            || self
                .errors
                .as_ref()
                .is_some_and(|errors| errors.root_m > LOST_M)
    }

    pub(super) fn truly_tracked(&self) -> bool {
        self.state == State::Tracked && !self.truly_lost()
    }
}

/// Compares frames; it keeps its buffers.
pub(super) struct Judge<'a> {
    body: &'a BodyModel,
    parts: Vec<u8>,
    camera: Intrinsics,
    rasterizer: Rasterizer,
}

impl<'a> Judge<'a> {
    pub(super) fn new(body: &'a BodyModel, camera: Intrinsics) -> Self {
        let rasterizer = Rasterizer::with_faces(camera, Faces::Front);
        Self { body, parts: body.part_labels(), camera, rasterizer }
    }

    /// For a surface whose vertices these bones move most.
    pub(super) fn with_parts(self, parts: Vec<u8>) -> Self {
        Self { parts, ..self }
    }

    pub(super) fn score(
        &mut self,
        registered: &RegisteredFrame,
        smooth: Option<&BodyParams>,
        truth: &GroundTruth,
        milliseconds: f32,
    ) -> FrameScore {
        let truth_from_found = truth.world_from_camera * registered.world_from_camera.inverse();
        if let Some(cloth) = &truth.in_cloth {
            self.parts = cloth.weights.iter().map(VertexWeights::main_bone).collect();
        }
        let observed = self.observed(&truth.clothed_in_world, truth.world_from_camera);
        let errors =
            |params: Option<&BodyParams>| Some(self.errors(params?, truth_from_found, truth));
        FrameScore {
            timestamp: registered.clean.timestamp,
            milliseconds,
            present: true,
            state: State::of(&registered.tracking),
            measured: [true; JOINT_COUNT],
            errors: errors(registered.params()),
            smooth_errors: errors(smooth),
            observed,
        }
    }

    /// Joints of the tracked body in its own world.
    pub(super) fn joints(&self, registered: &RegisteredFrame) -> Option<[Vec3; JOINT_COUNT]> {
        Some(self.body.pose(registered.params()?).joints)
    }

    fn errors(
        &self,
        params: &BodyParams,
        truth_from_found: Rigid3,
        truth: &GroundTruth,
    ) -> BodyErrors {
        let found = self.body.pose(params);
        let joints: Vec<Vec3> = found
            .joints
            .iter()
            .map(|&joint| truth_from_found * joint)
            .collect();
        let real = &truth.minimal.joints;
        let error_mm = |joint: usize| joints[joint].distance(real[joint]) * 1e3;
        let vertices = found.vertices.iter().zip(&truth.minimal.vertices);
        let v2v_sum_m: f32 = vertices
            .map(|(a, b)| (truth_from_found * *a).distance(*b))
            .sum();
        BodyErrors {
            joints_mm: std::array::from_fn(error_mm),
            v2v_mm: Some(1e3 * v2v_sum_m / found.vertices.len() as f32),
            root_m: joints[0].distance(real[0]),
            wrists_mm: [20, 21].map(|wrist| (joints[wrist] - real[wrist]) * 1e3),
            swapped: is_swapped(&joints, real),
        }
    }

    /// Which joints the camera could see: enough of the clothed surface that they move is in view.
    pub(super) fn observed(
        &mut self,
        surface: &TriangleMesh,
        world_from_camera: Rigid3,
    ) -> [bool; JOINT_COUNT] {
        let camera_from_world = world_from_camera.inverse();
        let in_camera: Vec<Vec3> = surface
            .vertices
            .iter()
            .map(|&vertex| camera_from_world * vertex)
            .collect();
        let raster = self.rasterizer.draw(&in_camera, &surface.triangles);
        let mut seen = [[0_u32; 2]; JOINT_COUNT];
        for (&part, &vertex) in self.parts.iter().zip(&in_camera) {
            let [visible, all] = &mut seen[part as usize];
            *all += 1;
            *visible += u32::from(is_visible(raster, &self.camera, vertex));
        }
        seen.map(|[visible, all]| visible as f32 >= OBSERVED_SHARE * all.max(1) as f32)
    }
}

fn is_visible(raster: &Raster, camera: &Intrinsics, in_camera: Vec3) -> bool {
    if in_camera.z <= ON_SURFACE_M {
        return false;
    }
    let place = camera.project(in_camera).round();
    let inside = place.x >= 0.0
        && place.y >= 0.0
        && place.x < raster.width as f32
        && place.y < raster.height as f32;
    inside && {
        let drawn_m = raster.depth[place.y as usize * raster.width + place.x as usize];
        drawn_m > 0.0 && in_camera.z < drawn_m + ON_SURFACE_M
    }
}

/// Whether hips, knees, shoulders and elbows would fit better with left and right exchanged.
pub(super) fn is_swapped(found: &[Vec3], real: &[Vec3]) -> bool {
    const PAIRS: [[usize; 2]; 4] = [[1, 2], [4, 5], [16, 17], [18, 19]];
    let distance = |a: usize, b: usize| found[a].distance(real[b]);
    let straight: f32 = PAIRS
        .iter()
        .map(|&[l, r]| distance(l, l) + distance(r, r))
        .sum();
    let crossed: f32 = PAIRS
        .iter()
        .map(|&[l, r]| distance(l, r) + distance(r, l))
        .sum();
    crossed < straight
}
