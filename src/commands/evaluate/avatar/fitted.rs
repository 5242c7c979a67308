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
    /// Keyframes; those that were not tracked are left out.
    pub(super) keyframes: Vec<RegisteredFrame>,
    /// Of each, those of the ten frames before it that were tracked.
    pub(super) before: Vec<Vec<RegisteredFrame>>,
    /// Each one's true body, and where the camera truly stood.
    truths: Vec<(BodyParams, Rigid3)>,
}

impl Tracked {
    /// Where the keyframes have the pelvis, from where it is, in the pelvis' own axes: the mean.
    pub(super) fn pelvis_off_m(&self, body: &BodyModel) -> Vec3 {
        let pairs = self.keyframes.iter().zip(&self.truths);
        let off = pairs.map(|(keyframe, truth)| pelvis_off(body, keyframe, truth));
        off.sum::<Vec3>() / self.keyframes.len().max(1) as f32
    }

    /// Mean distance of the keyframes' joints to the true ones, compared in the camera.
    pub(super) fn joints_off_mm(&self, body: &BodyModel) -> f32 {
        let (mut sum, mut count) = (0.0, 0);
        for (keyframe, (truth, world_from_camera)) in self.keyframes.iter().zip(&self.truths) {
            let Some(params) = keyframe.params() else {
                continue;
            };
            let joints = |params: &BodyParams, world_from_camera: &Rigid3| {
                let camera_from_world = world_from_camera.inverse();
                body.pose(params)
                    .joints
                    .map(|joint| camera_from_world * joint)
            };
            let found = joints(params, &keyframe.world_from_camera);
            for (found, real) in found.iter().zip(joints(truth, world_from_camera)) {
                sum += found.distance(real) * 1e3;
                count += 1;
            }
        }
        sum / count.max(1) as f32
    }
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
    let (mut keyframes, mut before, mut truths) = (Vec::new(), Vec::new(), Vec::new());
    for ((frames, world_from_camera), lesson) in run_ups.iter().zip(lessons) {
        let mut followed = follower.follow(frames, views, SNIPPET + 1)?;
        if let Some(keyframe) = followed.pop().filter(|frame| frame.params().is_some()) {
            truths.push((lesson.sequence.params(lesson.frame), *world_from_camera));
            followed.retain(|frame| frame.params().is_some());
            keyframes.push(keyframe);
            before.push(followed);
        }
    }
    Ok(Tracked { betas: follower.tracker.betas(), keyframes, before, truths })
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
