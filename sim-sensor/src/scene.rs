//! One scenario made concrete: who, doing what, seen from where.

use std::sync::Arc;

use effigy_capture::{Calibration, FrameId, Rigid3, Timestamp};
use effigy_registration::{
    BodyModel,
    motion::{Motion, MotionPose},
};

use crate::{
    error::SimError,
    person::{Outfit, Person, sample_betas},
    random::Randomness,
    scenario::{MotionChoice, Scenario},
};

/// What sensor and truth share.
#[derive(Clone, Debug)]
pub(crate) struct Scene {
    pub(crate) scenario: Scenario,
    pub(crate) person: Person,
    pub(crate) calibration: Calibration,
    pub(crate) world_from_camera: Rigid3,
    motion: Motion,
}

impl Scene {
    pub(crate) fn new(scenario: &Scenario, body: Arc<BodyModel>) -> Result<Self, SimError> {
        let scenario = scenario.clone().checked()?;
        let betas = scenario
            .betas
            .unwrap_or_else(|| sample_betas(&body, scenario.seed));
        let outfit = Outfit::new(scenario.outfit, scenario.seed);
        let person = Person::new(body, betas, outfit, scenario.seed);
        let mut calibration = scenario.sensor.calibration();
        calibration.rate_hz = scenario.rate_hz();
        calibration.color = scenario.color.then_some(calibration.depth);
        let rest = person.rest_body();
        let motion = match &scenario.motion {
            MotionChoice::Routine(routine) => {
                routine.motion(&rest, scenario.rate_hz(), scenario.seed)
            }
            MotionChoice::Bvh(path) => Motion::from_bvh(path, &rest)?
                .in_place()
                .starting_at_origin(&rest),
        };
        let world_from_camera = calibration.world_from_camera.unwrap_or_default();
        Ok(Self { scenario, person, calibration, world_from_camera, motion })
    }

    pub(crate) fn motion_secs(&self) -> f32 {
        self.motion.duration_secs()
    }

    pub(crate) fn timestamp(&self, frame: FrameId) -> Timestamp {
        Timestamp::from_secs_f64(frame.0 as f64 / f64::from(self.scenario.rate_hz()))
    }

    /// Movements end as they begin, so they repeat for as long as the scenario lasts.
    pub(crate) fn pose(&self, frame: FrameId) -> MotionPose {
        let secs = self.timestamp(frame).as_secs_f64() as f32;
        let duration_secs = self.motion.duration_secs();
        let secs = if duration_secs > 0.0 {
            secs % duration_secs
        } else {
            0.0
        };
        self.motion
            .at(secs)
            .expect("routines and clips have at least one pose")
    }

    pub(crate) fn is_dropped(&self, frame: FrameId) -> bool {
        // The first frame always comes: a stream that starts with a gap helps nobody.
        let random = Randomness::new(self.scenario.seed, 0, 0xd0);
        frame.0 > 0 && random.uniform(frame.0) < self.scenario.dropped_share
    }
}
