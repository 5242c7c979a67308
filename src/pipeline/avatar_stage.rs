//! From tracked bodies to a driven avatar: collects keyframes, has the avatar made, drives it.

use std::sync::Arc;

use effigy_avatar::{
    Avatar, AvatarMesh, DriveConfig, Driver, KeyframeSelector, fine_tune::FineTuneProgress,
};
use effigy_capture::{CameraModel, FrameId};
use effigy_registration::{BodyModel, RegisteredFrame};

use super::{
    avatar_job::{AvatarJob, FinishedAvatar, JobFigures},
    clock::{Clock, Timings},
    settings::Settings,
};
use crate::interrupt;

/// When a finished avatar takes over.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Swap {
    /// A fixed number of frames after it was asked for, waiting for it if need be: repeatable.
    AfterFrames(u64),
    /// As soon as it is there: live.
    WhenReady,
}

pub(crate) struct AvatarStage {
    body: Arc<BodyModel>,
    camera: CameraModel,
    settings: Settings,
    swap: Swap,
    clock: Clock,
    selector: KeyframeSelector,
    state: State,
    pub(crate) timings: Timings,
}

enum State {
    Collecting,
    Making {
        job: AvatarJob,
        frames_since_asked: u64,
    },
    Driving(Box<Made>),
    /// Asked to stop before there was an avatar, or none could be made.
    GaveUp,
}

struct Made {
    driver: Driver,
    figures: JobFigures,
}

impl AvatarStage {
    pub(crate) fn new(
        body: Arc<BodyModel>,
        camera: CameraModel,
        settings: &Settings,
        swap: Swap,
        clock: Clock,
    ) -> Self {
        Self {
            body,
            camera,
            settings: settings.clone(),
            swap,
            clock,
            selector: KeyframeSelector::new(settings.keyframes.clone()),
            state: State::Collecting,
            timings: Timings::default(),
        }
    }

    /// Looks at a frame for keyframes, starts fine-tuning, and takes over its result when due.
    /// Returns the keyframes' numbers when the avatar has just taken over.
    pub(crate) fn advance(&mut self, registered: &RegisteredFrame) -> anyhow::Result<bool> {
        match &mut self.state {
            State::Collecting => {
                let selector = &mut self.selector;
                self.timings
                    .time(&self.clock, "keyframes", || selector.consider(registered));
                if self.selector.is_full() {
                    self.start()?;
                }
                Ok(false)
            }
            State::Making { job, frames_since_asked } => {
                *frames_since_asked += 1;
                let finished = match self.swap {
                    Swap::AfterFrames(frames) if *frames_since_asked < frames => None,
                    Swap::AfterFrames(_) => Some(job.wait()),
                    Swap::WhenReady => job.poll(),
                };
                finished.map_or(Ok(false), |finished| self.take_over(finished))
            }
            State::Driving(_) | State::GaveUp => Ok(false),
        }
    }

    /// The avatar in the tracked pose, once there is one.
    pub(crate) fn drive(&mut self, registered: &RegisteredFrame) -> Option<AvatarMesh> {
        let State::Driving(made) = &mut self.state else {
            return None;
        };
        let params = registered.params()?;
        let id = registered.id();
        Some(
            self.timings
                .time(&self.clock, "drive", || made.driver.pose(params, id)),
        )
    }

    /// Waits for an avatar that is being made, at the end of a source; not if the user wants to stop.
    pub(crate) fn end(&mut self) -> anyhow::Result<bool> {
        if interrupt::requested() {
            self.cancel();
        }
        let State::Making { job, .. } = &mut self.state else {
            return Ok(false);
        };
        let finished = job.wait();
        self.take_over(finished)
    }

    /// Starts with the keyframes there are; `false` without any.
    pub(crate) fn start(&mut self) -> anyhow::Result<bool> {
        if self.selector.keyframes().is_empty() {
            return Ok(false);
        }
        let keyframes = self.selector.keyframes().to_vec();
        let job = AvatarJob::start(
            (keyframes, self.camera),
            &self.body,
            &self.settings,
            self.clock,
        )?;
        self.state = State::Making { job, frames_since_asked: 0 };
        Ok(true)
    }

    pub(crate) fn cancel(&mut self) {
        if matches!(self.state, State::Making { .. }) {
            self.state = State::GaveUp;
        }
    }

    pub(crate) fn start_over(&mut self) {
        self.selector.clear();
        self.state = State::Collecting;
    }

    pub(crate) fn keyframe_ids(&self) -> Vec<FrameId> {
        self.selector
            .keyframes()
            .iter()
            .map(|keyframe| keyframe.frame.id())
            .collect()
    }

    pub(crate) fn keyframe_count(&self) -> usize {
        self.selector.keyframes().len()
    }

    pub(crate) fn keyframes_wanted(&self) -> usize {
        self.settings.keyframes.count
    }

    pub(crate) fn avatar(&self) -> Option<&Arc<Avatar>> {
        match &self.state {
            State::Driving(made) => Some(made.driver.avatar()),
            State::Collecting | State::Making { .. } | State::GaveUp => None,
        }
    }

    pub(crate) fn figures(&self) -> Option<JobFigures> {
        match &self.state {
            State::Driving(made) => Some(made.figures),
            State::Collecting | State::Making { .. } | State::GaveUp => None,
        }
    }

    pub(crate) fn progress(&self) -> Option<FineTuneProgress> {
        match &self.state {
            State::Making { job, .. } => Some(job.progress()),
            State::Collecting | State::Driving(_) | State::GaveUp => None,
        }
    }

    /// What the stage is doing, for people.
    pub(crate) fn status(&self) -> String {
        match &self.state {
            State::Collecting => format!(
                "keyframes {}/{}",
                self.selector.keyframes().len(),
                self.settings.keyframes.count
            ),
            State::Making { job, .. } => {
                let now = job.progress();
                format!(
                    "fine-tuning {}/{}, {:.1} mm held out, {:.0} s left",
                    now.step,
                    now.steps,
                    now.held_out_residual_m * 1e3,
                    now.left_secs
                )
            }
            State::Driving(_) => "avatar live".to_owned(),
            State::GaveUp => "no avatar".to_owned(),
        }
    }

    pub(crate) fn is_making(&self) -> bool {
        matches!(self.state, State::Making { .. })
    }

    fn take_over(&mut self, finished: anyhow::Result<FinishedAvatar>) -> anyhow::Result<bool> {
        self.state = State::GaveUp;
        let FinishedAvatar { avatar, figures } = finished?;
        let driver = Driver::new(Arc::new(avatar), DriveConfig::default());
        self.state = State::Driving(Box::new(Made { driver, figures }));
        Ok(true)
    }
}
