//! Keyframes whose poses our own tracker found.
//!
//! Before each keyframe the tracker meets the person half a second early, knowing nothing of the pose, and follows at
//! the sensor's rate. It sees all keyframes' half seconds twice: the first time it learns the person's shape, the second
//! time it follows with it, as the live chain does once the shape is known.

use std::sync::Arc;

use effigy_capture::{Frame, FrameId, Timestamp};
use effigy_registration::{BodyModel, RegisteredFrame, Tracker, track::TrackConfig};

use super::{
    subject::Lesson,
    views::{RATE_HZ, Views},
};

/// Frames before a keyframe.
const RUN_UP: usize = 15;
/// Of those, how many make a snippet with it.
const SNIPPET: usize = 10;

/// What was tracked.
pub(super) struct Tracked {
    pub(super) betas: [f32; 10],
    /// Each keyframe, and those of the ten frames before it that were tracked; keyframes that were not are left out.
    pub(super) keyframes: Vec<(RegisteredFrame, Vec<RegisteredFrame>)>,
}

pub(super) fn track(
    lessons: &[Lesson<'_>],
    views: &mut Views,
    body: &Arc<BodyModel>,
    config: &TrackConfig,
) -> anyhow::Result<Tracked> {
    let run_ups = lessons
        .iter()
        .map(|lesson| run_up(lesson, views))
        .collect::<Vec<_>>();
    let camera = *views.camera();
    let tracker = Tracker::new(Arc::clone(body), camera, config.clone(), None);
    let mut follower = Follower { tracker, slot: 0 };
    for frames in &run_ups {
        follower.follow(frames, views, 0)?;
    }
    let mut keyframes = Vec::with_capacity(lessons.len());
    for frames in &run_ups {
        let mut followed = follower.follow(frames, views, SNIPPET + 1)?;
        if let Some(keyframe) = followed.pop().filter(|frame| frame.params().is_some()) {
            followed.retain(|frame| frame.params().is_some());
            keyframes.push((keyframe, followed));
        }
    }
    Ok(Tracked { betas: follower.tracker.betas(), keyframes })
}

/// The frames that lead to a keyframe, and itself.
fn run_up(lesson: &Lesson<'_>, views: &mut Views) -> Vec<Frame> {
    (0..=RUN_UP)
        .map(|number| {
            let before_secs = (RUN_UP - number) as f32 / RATE_HZ;
            let sequence = lesson.moved_by(-before_secs);
            views.expose(&sequence, 0, lesson.yaw_rad).0
        })
        .collect()
}

/// The tracker, and the sensor's clock.
struct Follower {
    tracker: Tracker,
    slot: u64,
}

impl Follower {
    /// Meets the person in the first frame, a second after the last one that was looked at, and follows; keeps the last
    /// `kept`.
    fn follow(
        &mut self,
        frames: &[Frame],
        views: &mut Views,
        kept: usize,
    ) -> anyhow::Result<Vec<RegisteredFrame>> {
        self.tracker.forget_pose();
        self.slot += RATE_HZ as u64;
        let mut followed = Vec::with_capacity(kept);
        for (number, frame) in frames.iter().enumerate() {
            let timestamp = Timestamp::from_secs_f64(self.slot as f64 / f64::from(RATE_HZ));
            let frame = Frame { id: FrameId(self.slot), timestamp, ..frame.clone() };
            self.slot += 1;
            let clean = Arc::new(views.cleaner().process(&frame)?);
            let registered = self.tracker.process(clean);
            if number + kept >= frames.len() {
                followed.push(registered);
            }
        }
        Ok(followed)
    }
}
