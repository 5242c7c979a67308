//! What a run did, frame by frame: counts, times, and what evaluation needs afterwards.

use std::{
    collections::{BTreeMap, BTreeSet},
    time::Duration,
};

use effigy_capture::{Frame, FrameId, Rigid3, Timestamp};
use effigy_registration::{BodyParams, RegisteredFrame, Tracking};
use effigy_viewer::PlaybackView;
use glam::Vec3;

use super::{
    avatar_job::{JobFigures, PreviewFigures},
    avatar_stage::AvatarStage,
    clock::{Clock, Timings},
    track_stage::TrackedFrame,
};

/// Points kept of each tracked frame to measure distances with.
const POINTS_PER_FRAME: usize = 1500;

/// Why a frame was not looked at.
pub(crate) const TOO_LATE: &str = "tracking was busy";

/// Why a frame never came: its number is missing.
const MISSING: &str = "missing in the source";

/// What capture counts.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Captured {
    pub(crate) delivered: u64,
    /// Frames that made way for newer ones.
    pub(crate) too_late: u64,
    /// Frames that the source never had.
    missing: u64,
    before: Option<FrameId>,
}

impl Captured {
    /// A frame came; after a jump, the numbers between say nothing.
    pub(crate) fn count(&mut self, frame: &Frame, jumped: bool) {
        self.delivered += 1;
        if let Some(before) = self.before
            && !jumped
        {
            self.missing += frame.id.0.saturating_sub(before.0 + 1);
        }
        self.before = Some(frame.id);
    }
}

/// A tracked frame, reduced to what evaluation needs.
#[derive(Clone, Debug)]
pub(crate) struct TrackedSample {
    pub(crate) id: FrameId,
    pub(crate) timestamp: Timestamp,
    pub(crate) params: BodyParams,
    pub(crate) world_from_camera: Rigid3,
    /// Cleaned depth points of the person.
    pub(crate) points_in_camera: Vec<Vec3>,
}

/// From delivery to result, and what ran beside it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FrameLatency {
    pub(crate) milliseconds: f32,
    pub(crate) fine_tuning: bool,
    pub(crate) driving: bool,
}

/// The record of one run.
pub(crate) struct RunLog {
    pub(crate) delivered: u64,
    pub(crate) tracked: Vec<TrackedSample>,
    pub(crate) partial: u64,
    pub(crate) lost: u64,
    pub(crate) dropped: BTreeMap<String, u64>,
    /// Of those that came too late.
    pub(crate) dropped_while_fine_tuning: u64,
    pub(crate) keyframes: Vec<FrameId>,
    /// What making each avatar took, the first one first.
    pub(crate) jobs: Vec<JobFigures>,
    pub(crate) preview: Option<PreviewFigures>,
    pub(crate) timings: Timings,
    pub(crate) latencies: Vec<FrameLatency>,
    /// Frames that came too late to be looked at.
    pub(crate) dropped_so_far: u64,
    /// Where a recording stands.
    pub(crate) playback: Option<PlaybackView>,
    pub(crate) clock: Clock,
    /// When the first body was there.
    pub(crate) start_up_secs: Option<f64>,
    learned_from: BTreeSet<FrameId>,
    first_frame: Option<Timestamp>,
    first_track: Option<Timestamp>,
    frames_since_first_track: u64,
}

impl RunLog {
    pub(crate) fn new(clock: Clock) -> Self {
        Self {
            delivered: 0,
            tracked: Vec::new(),
            partial: 0,
            lost: 0,
            dropped: BTreeMap::new(),
            dropped_while_fine_tuning: 0,
            keyframes: Vec::new(),
            jobs: Vec::new(),
            preview: None,
            timings: Timings::default(),
            latencies: Vec::new(),
            dropped_so_far: 0,
            playback: None,
            clock,
            start_up_secs: None,
            learned_from: BTreeSet::new(),
            first_frame: None,
            first_track: None,
            frames_since_first_track: 0,
        }
    }

    /// Notes when the first frame came.
    pub(crate) fn delivered(&mut self, frame: &Frame) {
        self.first_frame.get_or_insert(frame.timestamp);
    }

    pub(crate) fn latency(&mut self, latency: Duration, (fine_tuning, driving): (bool, bool)) {
        let milliseconds = latency.as_secs_f32() * 1e3;
        self.latencies
            .push(FrameLatency { milliseconds, fine_tuning, driving });
    }

    pub(crate) fn registered(&mut self, tracked: &TrackedFrame) {
        self.timings.add("clean", tracked.clean_took);
        self.timings.add("track", tracked.track_took);
        let registered = &tracked.registered;
        match registered.tracking {
            Tracking::Tracked { .. } => {}
            Tracking::Partial { .. } => self.partial += 1,
            Tracking::Lost { .. } => self.lost += 1,
        }
        if let Some(params) = registered.params() {
            self.start_up_secs.get_or_insert_with(|| self.clock.secs());
            self.first_track.get_or_insert(registered.clean.timestamp);
            self.tracked.push(TrackedSample {
                id: registered.id(),
                timestamp: registered.clean.timestamp,
                params: *params,
                world_from_camera: registered.world_from_camera,
                points_in_camera: person_points(registered),
            });
        }
        self.frames_since_first_track += u64::from(self.first_track.is_some());
    }

    /// Takes over what capture counted.
    pub(crate) fn captured(&mut self, captured: &Captured) {
        self.delivered = captured.delivered;
        self.dropped_so_far = captured.too_late;
        for (cause, count) in [(TOO_LATE, captured.too_late), (MISSING, captured.missing)] {
            if count > 0 {
                self.dropped.insert(cause.to_owned(), count);
            }
        }
    }

    /// Takes over what the avatar stage knows at the end.
    pub(crate) fn avatar_made(&mut self, avatar: &mut AvatarStage) {
        self.keyframes = avatar.keyframe_ids();
        self.jobs = avatar.figures().to_vec();
        self.preview = avatar.preview().map(|(_, figures)| *figures);
        self.learned_from.clone_from(avatar.learned_from());
        self.timings.merge(std::mem::take(&mut avatar.timings));
    }

    /// On the source's clock.
    pub(crate) fn time_to_first_track_secs(&self) -> Option<f64> {
        Some(self.first_track? - self.first_frame?)
    }

    /// Of the frames from the first tracked one on.
    pub(crate) fn tracked_fraction(&self) -> Option<f64> {
        let frames = self.frames_since_first_track;
        (frames > 0).then(|| self.tracked.len() as f64 / frames as f64)
    }

    /// Tracked frames that no avatar learned from.
    pub(crate) fn unseen(&self) -> impl Iterator<Item = &TrackedSample> {
        self.tracked
            .iter()
            .filter(|sample| !self.learned_from.contains(&sample.id))
    }
}

/// An even share of the person's points.
fn person_points(registered: &RegisteredFrame) -> Vec<Vec3> {
    let clean = &registered.clean;
    let seen = || {
        clean
            .vertices
            .points
            .iter()
            .zip(&clean.person)
            .filter(|(point, person)| **person && point.is_finite())
            .map(|(point, _)| *point)
    };
    let step = (seen().count() / POINTS_PER_FRAME).max(1);
    seen().step_by(step).collect()
}
