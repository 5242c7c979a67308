//! What a run did, frame by frame: counts, times, and what evaluation needs afterwards.

use std::collections::BTreeMap;

use effigy_capture::{Frame, FrameId, Rigid3, Timestamp};
use effigy_registration::{BodyParams, RegisteredFrame};
use glam::Vec3;

use super::{
    avatar_job::JobFigures,
    avatar_stage::AvatarStage,
    clock::{Clock, Timings},
};

/// Points kept of each tracked frame to measure distances with.
const POINTS_PER_FRAME: usize = 1500;

/// A tracked frame, reduced to what evaluation needs.
#[derive(Clone, Debug)]
pub(crate) struct TrackedSample {
    pub(crate) id: FrameId,
    pub(crate) params: BodyParams,
    pub(crate) world_from_camera: Rigid3,
    /// Cleaned depth points of the person.
    pub(crate) points_in_camera: Vec<Vec3>,
}

/// The record of one run.
pub(crate) struct RunLog {
    pub(crate) delivered: u64,
    pub(crate) tracked: Vec<TrackedSample>,
    pub(crate) dropped: BTreeMap<String, u64>,
    pub(crate) keyframes: Vec<FrameId>,
    pub(crate) job: Option<JobFigures>,
    pub(crate) timings: Timings,
    /// Milliseconds from delivery to result, and whether fine-tuning ran beside it.
    pub(crate) latencies_ms: Vec<(f32, bool)>,
    pub(crate) clock: Clock,
    first_frame: Option<Timestamp>,
    first_track: Option<Timestamp>,
    frames_since_first_track: u64,
}

impl RunLog {
    pub(crate) fn new(clock: Clock) -> Self {
        Self {
            delivered: 0,
            tracked: Vec::new(),
            dropped: BTreeMap::new(),
            keyframes: Vec::new(),
            job: None,
            timings: Timings::default(),
            latencies_ms: Vec::new(),
            clock,
            first_frame: None,
            first_track: None,
            frames_since_first_track: 0,
        }
    }

    pub(crate) fn delivered(&mut self, frame: &Frame) {
        self.delivered += 1;
        self.first_frame.get_or_insert(frame.timestamp);
    }

    pub(crate) fn registered(&mut self, registered: &RegisteredFrame) {
        if let Some(params) = registered.params() {
            self.first_track.get_or_insert(registered.clean.timestamp);
            self.tracked.push(TrackedSample {
                id: registered.id(),
                params: *params,
                world_from_camera: registered.world_from_camera,
                points_in_camera: person_points(registered),
            });
        }
        self.frames_since_first_track += u64::from(self.first_track.is_some());
    }

    pub(crate) fn drop_frames(&mut self, cause: &str, count: u64) {
        if count > 0 {
            *self.dropped.entry(cause.to_owned()).or_default() += count;
        }
    }

    /// Takes over what the avatar stage knows at the end.
    pub(crate) fn avatar_made(&mut self, avatar: &mut AvatarStage) {
        self.keyframes = avatar.keyframe_ids();
        self.job = avatar.figures();
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

    /// Tracked frames that fine-tuning did not learn from.
    pub(crate) fn unseen(&self) -> impl Iterator<Item = &TrackedSample> {
        self.tracked
            .iter()
            .filter(|sample| !self.keyframes.contains(&sample.id))
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
