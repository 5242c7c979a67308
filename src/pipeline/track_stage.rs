//! From a raw frame to a tracked body: cleaning and tracking, timed.

use std::{collections::VecDeque, sync::Arc, time::Duration};

use anyhow::Context as _;
use effigy_capture::{Calibration, Frame};
use effigy_fusion::clean::Cleaner;
use effigy_registration::{BodyModel, RegisteredFrame, track::Tracker};

use super::{clock::Clock, settings::Settings};

pub(crate) struct TrackStage {
    cleaner: Cleaner,
    tracker: Tracker,
    clock: Clock,
    /// The latest frames: once nobody else holds one, its memory serves the next.
    recent: VecDeque<Arc<RegisteredFrame>>,
}

/// By then drivers and windows are done with a frame.
const RECENT: usize = 3;

/// A tracked frame and what it took.
pub(crate) struct TrackedFrame {
    pub(crate) registered: Arc<RegisteredFrame>,
    pub(crate) clean_took: Duration,
    pub(crate) track_took: Duration,
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
            recent: VecDeque::new(),
        }
    }

    /// The next frame is not the one after the last: a recording was taken up elsewhere.
    pub(crate) fn jumped(&mut self) {
        self.tracker.forget_pose();
    }

    pub(crate) fn process(&mut self, frame: &Frame) -> anyhow::Result<TrackedFrame> {
        self.recycle();
        let start = self.clock.now();
        let clean = self
            .cleaner
            .process(frame)
            .with_context(|| format!("frame {}", frame.id.0))?;
        let cleaned = self.clock.now();
        let registered = Arc::new(self.tracker.process(Arc::new(clean)));
        self.recent.push_back(Arc::clone(&registered));
        Ok(TrackedFrame {
            registered,
            clean_took: cleaned.saturating_sub(start),
            track_took: self.clock.now().saturating_sub(cleaned),
        })
    }
    fn recycle(&mut self) {
        while self.recent.len() >= RECENT {
            let frame = self.recent.pop_front().map(Arc::try_unwrap);
            if let Some(Ok(frame)) = frame
                && let Ok(clean) = Arc::try_unwrap(frame.clean)
            {
                self.cleaner.recycle(clean);
            }
        }
    }
}
