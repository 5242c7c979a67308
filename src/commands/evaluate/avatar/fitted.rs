//! Keyframes whose poses our own tracker found.
//!
//! Before each keyframe the tracker meets the person half a second early, knowing nothing of the pose, and follows at
//! the sensor's rate. It sees all keyframes' half seconds twice: the first time it learns the person's shape, the second
//! time it follows with it, as the live chain does once the shape is known.

use std::sync::Arc;

use effigy_capture::{Frame, FrameId, Rigid3, Timestamp};
use effigy_registration::{BodyModel, BodyParams, RegisteredFrame, Tracker, track::TrackConfig};
use glam::{Quat, Vec3};

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
    /// Where the tracker has the pelvis, from where it is, in the pelvis' own axes: the mean over the keyframes.
    pub(super) pelvis_off_m: Vec3,
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
    for (frames, _) in &run_ups {
        follower.follow(frames, views, 0)?;
    }
    let mut keyframes = Vec::with_capacity(lessons.len());
    let mut pelvis_off_m = Vec3::ZERO;
    for ((frames, world_from_camera), lesson) in run_ups.iter().zip(lessons) {
        let mut followed = follower.follow(frames, views, SNIPPET + 1)?;
        if let Some(keyframe) = followed.pop().filter(|frame| frame.params().is_some()) {
            let truth = (lesson.sequence.params(lesson.frame), *world_from_camera);
            pelvis_off_m += pelvis_off(body, &keyframe, &truth);
            followed.retain(|frame| frame.params().is_some());
            keyframes.push((keyframe, followed));
        }
    }
    pelvis_off_m /= keyframes.len().max(1) as f32;
    Ok(Tracked { betas: follower.tracker.betas(), keyframes, pelvis_off_m })
}

/// From the true pelvis to the tracked one, in the true one's axes; both worlds are compared in the camera.
fn pelvis_off(
    body: &BodyModel,
    tracked: &RegisteredFrame,
    (truth, world_from_camera): &(BodyParams, Rigid3),
) -> Vec3 {
    let Some(params) = tracked.params() else {
        return Vec3::ZERO;
    };
    let pelvis =
        |params: &BodyParams| params.trans + body.joints(&body.shaped_vertices(&params.betas))[0];
    let found = tracked.world_from_camera.inverse() * pelvis(params);
    let real = world_from_camera.inverse() * pelvis(truth);
    let off_in_world = world_from_camera.rotation * (found - real);
    Quat::from_scaled_axis(truth.theta[0]).inverse() * off_in_world
}

/// The frames that lead to a keyframe, and itself; and where the camera stands then in the data set's world.
fn run_up(lesson: &Lesson<'_>, views: &mut Views) -> (Vec<Frame>, Rigid3) {
    let mut camera = Rigid3::IDENTITY;
    let frames = (0..=RUN_UP)
        .map(|number| {
            let before_secs = (RUN_UP - number) as f32 / RATE_HZ;
            let sequence = lesson.moved_by(-before_secs);
            let (frame, world_from_camera) = views.expose(&sequence, 0, lesson.yaw_rad);
            camera = world_from_camera;
            frame
        })
        .collect();
    (frames, camera)
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
