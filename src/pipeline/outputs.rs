//! What a run writes while it runs and when it ends.

use std::{fs, path::PathBuf, sync::Arc};

use anyhow::Context as _;
use effigy_avatar::{
    Avatar, AvatarMesh, Bake, BakeConfig, BakeError, DriveConfig, Driver,
    export::{GlbOptions, write_glb, write_ply},
};
use effigy_capture::{Calibration, Frame};
use effigy_registration::{
    BodyModel, RegisteredFrame,
    motion::{Motion, MotionPose},
};
use effigy_sim_sensor::Truth;
use effigy_viewer::pictures;

use super::{
    avatar_stage::AvatarStage,
    pictures::{first_picture, save_sheet},
    poses::PoseLog,
    publish::Publisher,
    recorder::Recorder,
    run_log::{RunLog, TrackedSample},
    schedule::Decision,
};
use crate::{cli::ChainArgs, files, interrupt, progress::Progress};

/// How many moments a contact sheet shows.
const MOMENTS: u64 = 8;

/// Every so many frames, where nobody knows how many there will be.
const MOMENT_EVERY: u64 = 90;

/// Longer without a tracked body, and the movement ends.
const LONGEST_GAP_SECS: f64 = 10.0;

pub(crate) struct Outputs {
    out: PathBuf,
    poses: Option<(PathBuf, PoseLog)>,
    meshes: Option<PathBuf>,
    calibration: Calibration,
    body: Arc<BodyModel>,
    moment_every: u64,
    moments: Vec<RegisteredFrame>,
    first_picture_done: bool,
    progress: Progress,
    publisher: Option<Publisher>,
    recorder: Option<Recorder>,
    frames: u64,
    /// The newest frame: the pose an avatar takes that comes after the end.
    last: Option<Arc<RegisteredFrame>>,
}

impl Outputs {
    /// Makes the folders and tries the files, so that an unwritable place is known at once.
    pub(crate) fn new(
        args: &ChainArgs,
        calibration: &Calibration,
        frame_count: Option<u64>,
        body: &Arc<BodyModel>,
    ) -> anyhow::Result<Self> {
        for folder in std::iter::once(&args.out).chain(&args.meshes) {
            fs::create_dir_all(folder).with_context(|| {
                format!(
                    "{}: cannot make this folder; choose another",
                    folder.display()
                )
            })?;
        }
        for file in args.poses.iter().chain(&args.json) {
            files::check_writable(file)?;
        }
        Ok(Self {
            out: args.out.clone(),
            poses: args.poses.clone().map(|path| (path, PoseLog::default())),
            meshes: args.meshes.clone(),
            calibration: calibration.clone(),
            body: Arc::clone(body),
            moment_every: frame_count.map_or(MOMENT_EVERY, |count| (count / MOMENTS).max(1)),
            moments: Vec::new(),
            first_picture_done: false,
            progress: Progress::new("frames", frame_count),
            publisher: None,
            recorder: None,
            frames: 0,
            last: None,
        })
    }

    /// Shows every frame in a window too.
    pub(crate) fn publish(&mut self, publisher: Publisher) {
        self.publisher = Some(publisher);
    }

    /// Records every frame too.
    pub(crate) fn record_to(&mut self, recorder: Recorder) {
        self.recorder = Some(recorder);
    }

    /// A line for the person at the window.
    pub(crate) fn say(&self, line: &str) {
        if let Some(publisher) = &self.publisher {
            publisher.say(line);
        }
    }

    /// Tells the window whether the source is held.
    pub(crate) fn paused(&self, paused: bool) {
        if let Some(publisher) = &self.publisher {
            publisher.paused(paused);
        }
    }

    /// Keeps a frame that went through the chain, and what was decided at it, so that a replay repeats both.
    pub(crate) fn record(&self, frame: &Frame, decided: &[Decision]) -> anyhow::Result<()> {
        match &self.recorder {
            Some(recorder) => recorder.add(frame, decided),
            None => Ok(()),
        }
    }

    /// The avatar as it is now, when the person at the window asks for it.
    pub(crate) fn export_now(&self, avatar: Option<&Arc<Avatar>>) -> anyhow::Result<()> {
        let Some(avatar) = avatar else {
            self.say("no avatar yet");
            return Ok(());
        };
        let path = self.out.join("avatar.glb");
        write_glb(&path, avatar, &GlbOptions::default())?;
        self.say(&format!("avatar saved to {}", path.display()));
        Ok(())
    }

    pub(crate) fn frame(
        &mut self,
        frame: &Frame,
        registered: &Arc<RegisteredFrame>,
        mesh: Option<&AvatarMesh>,
        (avatar, log): (&AvatarStage, &RunLog),
    ) -> anyhow::Result<()> {
        if let Some(publisher) = &mut self.publisher {
            publisher.frame(frame, registered, mesh, avatar, log);
        }
        if let Some((_, poses)) = &mut self.poses {
            poses.add(registered, &self.body);
        }
        if let (Some(folder), Some(mesh)) = (&self.meshes, mesh) {
            let path = folder.join(format!("frame_{:06}.ply", frame.id.0));
            write_ply(&path, mesh, registered.world_from_camera.inverse())?;
        }
        let sensor = &self.calibration.depth.intrinsics;
        if !self.first_picture_done {
            let picture = first_picture(registered, sensor, &self.body);
            pictures::save(&picture, &self.out.join("first.png"))?;
            self.first_picture_done = true;
        }
        let due = frame.id.0 % self.moment_every == self.moment_every / 2;
        if due && registered.params().is_some() {
            self.moments.push(RegisteredFrame::clone(registered));
            self.thin_out_moments();
        }
        self.progress.say(avatar.status());
        self.frames += 1;
        self.progress.advance(self.frames);
        self.last = Some(Arc::clone(registered));
        Ok(())
    }

    /// Of a run without a known end: half as many, half as often, whenever there are too many.
    fn thin_out_moments(&mut self) {
        if self.moments.len() as u64 > 2 * MOMENTS {
            let mut number = 0;
            self.moments.retain(|_| {
                number += 1;
                number % 2 == 1
            });
            self.moment_every *= 2;
        }
    }

    /// Waits for the avatar that is still being made when the source has ended, and shows it.
    pub(crate) fn wait_for_avatar(&mut self, avatar: &mut AvatarStage) -> anyhow::Result<()> {
        avatar.end(|avatar| {
            self.progress.waiting(avatar.status());
            if let Some(publisher) = &mut self.publisher {
                publisher.waiting(avatar);
            }
        })?;
        if let (Some(publisher), Some(last)) = (&mut self.publisher, &self.last)
            && let Some(mesh) = avatar.drive(last)
        {
            publisher.avatar(&mesh, avatar);
        }
        Ok(())
    }

    /// Pictures, avatar file and GLB; the report is written by the command, last.
    pub(crate) fn finish(
        &mut self,
        log: &RunLog,
        avatar: Option<&Arc<Avatar>>,
        truth: Option<&Truth>,
    ) -> anyhow::Result<()> {
        self.progress.finish();
        if let Some(recorder) = self.recorder.take() {
            recorder.finish()?;
        }
        if let Some(publisher) = &self.publisher {
            publisher.finished();
        }
        if let Some((path, poses)) = &self.poses {
            poses.write(path)?;
        }
        let sheet = self.out.join("sheet.png");
        let sensor = &self.calibration.depth.intrinsics;
        save_sheet(&sheet, &self.moments, (sensor, &self.body), avatar, truth)?;
        if let Some(avatar) = avatar {
            avatar.save(&self.out.join("avatar.effigy"))?;
            let motion = self.tracked_motion(log);
            let bake = baked(avatar, &motion)?;
            let options =
                GlbOptions { motion: Some(&motion), bake: bake.as_ref(), ..GlbOptions::default() };
            write_glb(&self.out.join("avatar.glb"), avatar, &options)?;
        }
        Ok(())
    }

    /// What the person did, as the avatar shall do it in other programs.
    fn tracked_motion(&self, log: &RunLog) -> Motion {
        let rate_hz = self.calibration.rate_hz;
        Motion { name: "tracked".to_owned(), rate_hz, poses: evenly_timed(&log.tracked, rate_hz) }
    }
}

/// What the clothes do over a motion; not more keys than take some seconds. `None` where there is no motion, or nobody
/// wants to wait.
fn baked(avatar: &Arc<Avatar>, motion: &Motion) -> anyhow::Result<Option<Bake>> {
    const MOST_KEYS: f32 = 450.0;
    if motion.poses.is_empty() {
        return Ok(None);
    }
    let config = BakeConfig::default();
    let affordable = MOST_KEYS / motion.duration_secs().max(1.0);
    let config = BakeConfig { keys_per_sec: config.keys_per_sec.min(affordable), ..config };
    let mut driver = Driver::new(Arc::clone(avatar), DriveConfig::default());
    let bake = Bake::of_motion(&mut driver, motion, &config, &mut |_, _| {
        !interrupt::requested()
    })?;
    if let Some(bake) = &bake {
        let BakeError { rms_mm, p95_mm, .. } = bake.error;
        tracing::info!(
            rms_mm,
            p95_mm,
            modes = bake.modes_m.len(),
            "clothes baked into the GLB"
        );
    }
    Ok(bake)
}

/// Poses at a steady rate: what was not tracked, or not looked at, is bridged between its neighbours. A source that
/// goes back in time (a loop, a seek) ends it.
fn evenly_timed(tracked: &[TrackedSample], rate_hz: f32) -> Vec<MotionPose> {
    let pose = |sample: &TrackedSample| MotionPose {
        theta: sample.params.theta,
        trans: sample.params.trans,
    };
    let Some(first) = tracked.first() else {
        return Vec::new();
    };
    let secs = |sample: &TrackedSample| sample.timestamp - first.timestamp;
    let mut poses = vec![pose(first)];
    for pair in tracked.windows(2) {
        let (from, to) = (secs(&pair[0]), secs(&pair[1]));
        if to <= from || to - from > LONGEST_GAP_SECS {
            break;
        }
        loop {
            let due = poses.len() as f64 / f64::from(rate_hz);
            // A timestamp is some nanoseconds to either side of a multiple of the frame's time.
            if due > to + 1e-6 {
                break;
            }
            let share = ((due - from) / (to - from)).clamp(0.0, 1.0);
            poses.push(pose(&pair[0]).interpolate(&pose(&pair[1]), share as f32));
        }
    }
    poses
}

#[cfg(test)]
mod tests {
    use effigy_capture::{FrameId, Rigid3, Timestamp};
    use effigy_registration::BodyParams;
    use glam::Vec3;

    use super::*;

    #[test]
    fn frames_that_were_not_tracked_take_their_time_all_the_same() {
        let sample = |millis: u64| TrackedSample {
            id: FrameId(millis),
            timestamp: Timestamp(millis * 1_000_000),
            params: BodyParams { trans: Vec3::X * millis as f32, ..BodyParams::ZERO },
            world_from_camera: Rigid3::IDENTITY,
            points_in_camera: Vec::new(),
        };
        let tracked = [0, 100, 200, 600, 700].map(sample);
        let poses = evenly_timed(&tracked, 10.0);
        assert_eq!(poses.len(), 8, "0.7 s at 10 Hz");
        assert!(
            (poses[4].trans.x - 400.0).abs() < 0.1,
            "half-way between 200 and 600 ms"
        );
        let back_in_time = [0, 100, 50].map(sample);
        assert_eq!(evenly_timed(&back_in_time, 10.0).len(), 2);
    }
}
