//! From a raw frame to a tracked body: cleaning, then tracking, each timed; one after the other or on threads of their own.

use std::{collections::VecDeque, sync::Arc, time::Duration};

use anyhow::Context as _;
use crossbeam::channel::{Receiver, Sender, TryRecvError, bounded, unbounded};
use effigy_capture::{Calibration, Frame};
use effigy_fusion::{CleanFrame, clean::Cleaner};
use effigy_registration::{BodyModel, RegisteredFrame, track::Tracker};
use glam::Vec3;

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
    /// Frames tracked so far.
    count: u64,
    handovers: Receiver<Handover>,
    next_handover: Option<Handover>,
}

/// What to follow from a frame on.
pub(crate) struct Handover {
    /// Counted as they are tracked, from 1.
    pub(crate) from: u64,
    pub(crate) whom: Followed,
}

/// Who is followed.
pub(crate) enum Followed {
    /// The avatar's surface: for each of the body's vertices how far it is from there, in canonical space.
    Avatar(Vec<Vec3>),
    /// Somebody of whom nothing is known yet.
    NewPerson,
}

/// A cleaned frame and what it took.
pub(crate) struct CleanedFrame {
    clean: CleanFrame,
    took: Duration,
}

/// A tracked frame and what it took.
pub(crate) struct TrackedFrame {
    pub(crate) registered: Arc<RegisteredFrame>,
    /// The how manieth it is, from 1.
    pub(crate) number: u64,
    pub(crate) clean_took: Duration,
    pub(crate) track_took: Duration,
}

/// Both stages of one source, and where surfaces to follow are handed in.
pub(crate) fn stages(
    calibration: &Calibration,
    body: Arc<BodyModel>,
    settings: &Settings,
    clock: Clock,
) -> (CleanStage, TrackStage, Sender<Handover>) {
    let (give_back, used) = bounded(RECENT);
    let (hand_over, handovers) = unbounded();
    let cleaner = Cleaner::new(calibration.clone(), settings.clean.clone());
    let camera = calibration.depth;
    let world_from_camera = calibration.world_from_camera;
    let tracker = Tracker::new(body, camera, settings.track.clone(), world_from_camera);
    (
        CleanStage { cleaner, clock, used },
        TrackStage {
            tracker,
            clock,
            recent: VecDeque::new(),
            give_back,
            count: 0,
            handovers,
            next_handover: None,
        },
        hand_over,
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
        self.count += 1;
        self.take_over();
        let start = self.clock.now();
        let registered = Arc::new(self.tracker.process(Arc::new(cleaned.clean)));
        self.recent.push_back(Arc::clone(&registered));
        TrackedFrame {
            registered,
            number: self.count,
            clean_took: cleaned.took,
            track_took: self.clock.now().saturating_sub(start),
        }
    }

    /// Follows another surface or another person if it is time to.
    fn take_over(&mut self) {
        self.next_handover = self
            .handovers
            .try_iter()
            .last()
            .or(self.next_handover.take());
        let due = |next: &mut Handover| next.from <= self.count;
        match self.next_handover.take_if(due).map(|next| next.whom) {
            Some(Followed::Avatar(offsets)) => {
                if let Err(error) = self.tracker.set_surface(&offsets) {
                    tracing::warn!(%error, "the avatar's surface is not followed");
                }
            }
            Some(Followed::NewPerson) => self.tracker.forget_person(),
            None => {}
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
