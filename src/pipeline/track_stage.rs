//! From a raw frame to a tracked body: cleaning and tracking, timed.

use std::sync::Arc;

use anyhow::Context as _;
use effigy_capture::{Calibration, Frame};
use effigy_fusion::clean::Cleaner;
use effigy_registration::{BodyModel, RegisteredFrame, track::Tracker};

use super::{
    clock::{Clock, Timings},
    settings::Settings,
};

pub(crate) struct TrackStage {
    cleaner: Cleaner,
    tracker: Tracker,
    clock: Clock,
    pub(crate) timings: Timings,
}

impl TrackStage {
    pub(crate) fn new(
        calibration: &Calibration,
        body: Arc<BodyModel>,
        settings: &Settings,
        clock: Clock,
    ) -> Self {
        let camera = calibration.depth;
        let world_from_camera = calibration.world_from_camera;
        Self {
            cleaner: Cleaner::new(calibration.clone(), settings.clean.clone()),
            tracker: Tracker::new(body, camera, settings.track.clone(), world_from_camera),
            clock,
            timings: Timings::default(),
        }
    }

    pub(crate) fn process(&mut self, frame: &Frame) -> anyhow::Result<Arc<RegisteredFrame>> {
        let clean = self
            .timings
            .time(&self.clock, "clean", || self.cleaner.process(frame))
            .with_context(|| format!("frame {}", frame.id.0))?;
        let registered = self.timings.time(&self.clock, "track", || {
            self.tracker.process(Arc::new(clean))
        });
        Ok(Arc::new(registered))
    }
}
