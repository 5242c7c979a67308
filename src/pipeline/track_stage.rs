//! From a raw frame to a tracked body: cleaning, then tracking, each timed; one after the other or on threads of their own.

use std::{collections::VecDeque, sync::Arc, time::Duration};

use anyhow::Context as _;
use crossbeam::channel::{Receiver, Sender, TryRecvError, bounded};
use effigy_capture::{Calibration, Frame};
use effigy_fusion::{CleanFrame, clean::Cleaner};
use effigy_registration::{BodyModel, RegisteredFrame, track::Tracker};

use super::{clock::Clock, settings::Settings};

/// By then drivers and windows are done with a frame.
const RECENT: usize = 3;

pub(crate) struct CleanStage {
    cleaner: Cleaner,
    clock: Clock,
    /// Frames whose memory serves the next one.
    used: Receiver<CleanFrame>,
}

pub(crate) struct TrackStage {
    tracker: Tracker,
    clock: Clock,
    /// The latest frames: once nobody else holds one, its memory goes back.
    recent: VecDeque<Arc<RegisteredFrame>>,
    give_back: Sender<CleanFrame>,
}

/// A cleaned frame and what it took.
pub(crate) struct CleanedFrame {
    clean: CleanFrame,
    took: Duration,
}

/// A tracked frame and what it took.
pub(crate) struct TrackedFrame {
    pub(crate) registered: Arc<RegisteredFrame>,
    pub(crate) clean_took: Duration,
    pub(crate) track_took: Duration,
}

/// Both stages of one source.
pub(crate) fn stages(
    calibration: &Calibration,
    body: Arc<BodyModel>,
    settings: &Settings,
    clock: Clock,
) -> (CleanStage, TrackStage) {
    let (give_back, used) = bounded(RECENT);
    let cleaner = Cleaner::new(calibration.clone(), settings.clean.clone());
    let camera = calibration.depth;
    let world_from_camera = calibration.world_from_camera;
    let tracker = Tracker::new(body, camera, settings.track.clone(), world_from_camera);
    (
        CleanStage { cleaner, clock, used },
        TrackStage { tracker, clock, recent: VecDeque::new(), give_back },
    )
}

impl CleanStage {
    pub(crate) fn process(&mut self, frame: &Frame) -> anyhow::Result<CleanedFrame> {
        // The latest is enough: the cleaner keeps memory for one frame.
        match self.used.try_recv() {
            Ok(used) => self.cleaner.recycle(used),
            Err(TryRecvError::Empty | TryRecvError::Disconnected) => {}
        }
        let start = self.clock.now();
        let clean = self
            .cleaner
            .process(frame)
            .with_context(|| format!("frame {}", frame.id.0))?;
        Ok(CleanedFrame { clean, took: self.clock.now().saturating_sub(start) })
    }
}

impl TrackStage {
    /// The next frame is not the one after the last: a recording was taken up elsewhere.
    pub(crate) fn jumped(&mut self) {
        self.tracker.forget_pose();
    }

    pub(crate) fn process(&mut self, cleaned: CleanedFrame) -> TrackedFrame {
        self.give_back();
        let start = self.clock.now();
        let registered = Arc::new(self.tracker.process(Arc::new(cleaned.clean)));
        self.recent.push_back(Arc::clone(&registered));
        TrackedFrame {
            registered,
            clean_took: cleaned.took,
            track_took: self.clock.now().saturating_sub(start),
        }
    }

    fn give_back(&mut self) {
        while self.recent.len() >= RECENT {
            let frame = self.recent.pop_front().map(Arc::try_unwrap);
            if let Some(Ok(frame)) = frame
                && let Ok(clean) = Arc::try_unwrap(frame.clean)
            {
                // Memory that nobody wants is freed.
                drop(self.give_back.try_send(clean));
            }
        }
    }
}
