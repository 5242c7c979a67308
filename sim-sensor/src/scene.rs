//! One scenario made concrete: who, doing what, seen from where.

use std::sync::{Arc, Mutex, PoisonError};

use effigy_capture::{FrameId, Rigid3};
use effigy_fusion::TriangleMesh;
use effigy_registration::{
    BodyModel,
    motion::{Motion, MotionPose},
    smpl::VertexWeights,
};

use crate::{
    cloth::{ClothConfig, ClothedSurface, Tape, Wear},
    error::SimError,
    person::{Outfit, Person},
    scenario::Scenario,
};

/// What sensor and truth share.
#[derive(Clone, Debug)]
pub(crate) struct Scene {
    pub(crate) scenario: Scenario,
    pub(crate) person: Person,
    pub(crate) world_from_camera: Rigid3,
    motion: Motion,
    /// Simulated clothes, shared by the clones of this scene.
    cloth: Option<Arc<Mutex<Tape>>>,
}

impl Scene {
    pub(crate) fn new(scenario: &Scenario, body: Arc<BodyModel>) -> Result<Self, SimError> {
        let scenario = scenario.clone().checked()?;
        if scenario.stranger.is_some() {
            return Err(SimError::Scenario {
                field: "stranger",
                got: "a character of its own".to_owned(),
                expected: "none here: a character has no body-model truth; ask StrangerTruth",
            });
        }
        let outfit = Outfit::new(scenario.outfit, scenario.seed);
        let mut person = scenario.person(body, outfit);
        let cloth = worn(&scenario, &mut person);
        let motion = scenario.motion(&person.rest_body())?;
        let world_from_camera = place(&scenario);
        Ok(Self { scenario, person, world_from_camera, motion, cloth })
    }

    /// The same person in the same clothes before another sensor.
    pub(crate) fn seen_as(&self, scenario: &Scenario) -> Self {
        Self { scenario: scenario.clone(), world_from_camera: place(scenario), ..self.clone() }
    }

    pub(crate) fn motion_secs(&self) -> f32 {
        self.motion.duration_secs()
    }

    /// Movements end as they begin (recorded ones go there and back), so they repeat for as long as the scenario lasts.
    pub(crate) fn pose(&self, frame: FrameId) -> MotionPose {
        let secs = self
            .scenario
            .looped_secs(frame, self.motion.duration_secs());
        self.motion
            .at(secs)
            .expect("routines and clips have at least one pose")
    }

    /// Between two frames the way of the shorter arcs.
    pub(crate) fn pose_between(&self, frames: f64) -> MotionPose {
        let before = frames.max(0.0).floor();
        let [from, to] = [before as u64, before as u64 + 1].map(|frame| self.pose(FrameId(frame)));
        from.interpolate(&to, (frames - before) as f32)
    }

    /// The clothes as they lie in a frame, to be moved on from there; `None` without simulated clothes.
    pub(crate) fn wear_after(&self, frame: FrameId) -> Option<Wear> {
        self.worn_at(frame, Wear::clone)
    }

    /// The person in simulated clothes in a frame; `None` for clothes that are part of the person's surface.
    pub(crate) fn in_cloth(&self, frame: FrameId) -> Option<ClothedSurface> {
        self.worn_at(frame, Wear::surface)
    }

    /// As [`Self::in_cloth`], only what a camera needs: the posed surface and its skinning weights.
    pub(crate) fn posed_in_cloth(
        &self,
        frame: FrameId,
    ) -> Option<(TriangleMesh, Vec<VertexWeights>)> {
        self.worn_at(frame, |wear| {
            let (posed, weights, _) = wear.posed_surface();
            (posed, weights)
        })
    }

    /// The clothes in a frame, looked at where they are.
    pub(crate) fn worn_at<T>(&self, frame: FrameId, look: impl FnOnce(&Wear) -> T) -> Option<T> {
        let tape = self.cloth.as_ref()?;
        // A panic elsewhere left the tape between frames at worst; it starts from a kept state again.
        let mut tape = tape.lock().unwrap_or_else(PoisonError::into_inner);
        Some(look(tape.at(frame.0, |frame| self.pose(FrameId(frame)))))
    }

    pub(crate) fn is_in_cloth(&self) -> bool {
        self.cloth.is_some()
    }
}

/// Where the scenario's sensor stands.
fn place(scenario: &Scenario) -> Rigid3 {
    scenario.calibration().world_from_camera.unwrap_or_default()
}

/// Cuts the simulated clothes a scenario asks for; the person's paint learns their colours.
fn worn(scenario: &Scenario, person: &mut Person) -> Option<Arc<Mutex<Tape>>> {
    let kind = scenario.outfit.cloth()?;
    let fit = scenario.cloth_fit();
    let under = Arc::new(person.clone());
    let wear = Wear::new(under, kind, fit, scenario.seed, ClothConfig::default());
    let garments = wear.garments().iter();
    let painted = garments.map(|g| (g.rest.points.len(), g.pattern.material));
    person.paint = person.paint.clone().with_garments(painted);
    Some(Arc::new(Mutex::new(Tape::new(wear, scenario.rate_hz()))))
}
