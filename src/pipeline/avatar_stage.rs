//! From tracked bodies to a driven avatar: collects keyframes, has the avatar made and made better, drives it.

use std::{collections::BTreeSet, sync::Arc};

use crossbeam::channel::Sender;
use effigy_avatar::{
    Avatar, AvatarMesh, KeyframeSelector, LiveDriver, fine_tune::FineTuneProgress,
    skinning::offsets_from_body,
};
use effigy_capture::{CameraModel, FrameId};
use effigy_registration::{BodyModel, RegisteredFrame, SmoothConfig, Smoother};

use super::{
    avatar_job::{AvatarJob, Beside, FinishedAvatar, JobFigures, Preview, PreviewFigures},
    clock::{Clock, Timings},
    devices::Devices,
    schedule::{Decision, Schedule},
    settings::Settings,
    track_stage::{Followed, Handover},
};

/// More frames than lie between tracking and driving: what one tells the other takes effect after as many, in a replay at
/// the same one.
const AHEAD: u64 = 8;

pub(crate) struct AvatarStage {
    body: Arc<BodyModel>,
    camera: CameraModel,
    settings: Settings,
    schedule: Schedule,
    clock: Clock,
    selector: KeyframeSelector,
    /// Of the poses that the avatar is driven with; keyframes are taken as they were tracked.
    smoother: Smoother,
    making: Option<Making>,
    made: Option<Made>,
    /// What was shown while the first avatar was still learned.
    preview: Option<(Arc<Avatar>, PreviewFigures)>,
    gave_up: bool,
    /// Frames to come that still show the last person's shape.
    of_last_person: u64,
    /// Whether the chain loses frames as it is.
    overloaded: bool,
    /// What the user asked for since the last frame.
    requests: Vec<Decision>,
    /// All frames that any avatar learned from.
    learned_from: BTreeSet<FrameId>,
    /// One entry an avatar, the first one first.
    figures: Vec<JobFigures>,
    pub(crate) timings: Timings,
    /// Last: whoever goes before it no longer uses a card.
    devices: Devices,
}

struct Making {
    job: AvatarJob,
    frames_since_begun: u64,
    keyframes: Vec<FrameId>,
    looked_for_preview: bool,
}

struct Made {
    driver: LiveDriver,
    /// Driven until the avatar itself is there.
    is_preview: bool,
    frames_driven: u64,
    keyframes: Vec<FrameId>,
}

impl AvatarStage {
    pub(crate) fn new(
        body: Arc<BodyModel>,
        camera: CameraModel,
        settings: &Settings,
        devices: Devices,
        schedule: Schedule,
        clock: Clock,
    ) -> Self {
        Self {
            body,
            camera,
            settings: settings.clone(),
            devices,
            schedule,
            clock,
            selector: KeyframeSelector::new(settings.keyframes.clone()),
            smoother: Smoother::new(settings.smooth.unwrap_or(SmoothConfig::Off)),
            making: None,
            made: None,
            preview: None,
            gave_up: false,
            of_last_person: 0,
            overloaded: false,
            requests: Vec::new(),
            learned_from: BTreeSet::new(),
            figures: Vec::new(),
            timings: Timings::default(),
        }
    }

    /// Looks at a frame for keyframes, begins avatars and lets finished ones take over. Returns what was decided.
    pub(crate) fn advance(
        &mut self,
        registered: &RegisteredFrame,
    ) -> anyhow::Result<Vec<Decision>> {
        let selector = &mut self.selector;
        if self.of_last_person == 0 {
            self.timings
                .time(&self.clock, "keyframes", || selector.consider(registered));
        } else {
            self.of_last_person -= 1;
        }
        if let Some(making) = &mut self.making {
            making.frames_since_begun += 1;
        }
        if let Some(made) = &mut self.made {
            made.frames_driven += 1;
        }
        let mut decided = self.schedule.due(registered.id());
        decided.append(&mut self.requests);
        for decision in &decided {
            self.perform(*decision)?;
        }
        if let Some(decision) = self.decide() {
            self.perform(decision)?;
            decided.push(decision);
        }
        Ok(decided)
    }

    /// Tells tracking that somebody else is there now, and has it follow a new avatar's surface if the settings want that.
    /// `number` is that of the frame that was decided at.
    pub(crate) fn hand_over(
        &self,
        decided: &[Decision],
        number: u64,
        hand_over: &Sender<Handover>,
    ) {
        let follows_avatar = self.settings.schedule.follow_avatar;
        let whom = |decision: &Decision| match (decision, &self.made) {
            (Decision::TakeOver, Some(made)) if follows_avatar && !made.is_preview => Some(
                Followed::Avatar(offsets_from_body(made.driver.avatar(), &self.body)),
            ),
            (Decision::StartOver, _) => Some(Followed::NewPerson),
            _ => None,
        };
        if let Some(whom) = decided.iter().rev().find_map(whom) {
            // Tracking that has ended follows nobody.
            drop(hand_over.send(Handover { from: number + AHEAD, whom }));
        }
    }

    /// Whether the chain loses frames as it is, without any fine-tuning.
    pub(crate) fn note_load(&mut self, overloaded: bool) {
        self.overloaded = overloaded;
    }

    /// Takes effect with the next frame.
    pub(crate) fn request(&mut self, decision: Decision) {
        self.requests.push(decision);
    }

    /// The avatar in the tracked pose, once there is one.
    pub(crate) fn drive(&mut self, registered: &RegisteredFrame) -> Option<AvatarMesh> {
        let params = self.smoother.params(registered);
        let (made, params) = (self.made.as_mut()?, params?);
        let id = registered.id();
        Some(
            self.timings
                .time(&self.clock, "drive", || made.driver.pose(&params, id)),
        )
    }

    /// Waits for an avatar that is being made, at the end of a source; not if the user wants to stop. `meanwhile`
    /// is called now and then.
    pub(crate) fn end(&mut self, mut meanwhile: impl FnMut(&Self)) -> anyhow::Result<()> {
        if let Some(making) = &self.making {
            making.job.wait_until_finished(|| meanwhile(self));
        }
        self.take_over()
    }

    /// What the avatar that is driven learned from, or what the first one will.
    pub(crate) fn keyframe_ids(&self) -> Vec<FrameId> {
        self.made
            .as_ref()
            .map_or_else(|| ids(&self.selector), |made| made.keyframes.clone())
    }

    pub(crate) fn learned_from(&self) -> &BTreeSet<FrameId> {
        &self.learned_from
    }

    pub(crate) fn keyframe_count(&self) -> usize {
        self.selector.keyframes().len()
    }

    pub(crate) fn keyframes_wanted(&self) -> usize {
        self.settings.keyframes.count
    }

    pub(crate) fn avatar(&self) -> Option<&Arc<Avatar>> {
        self.made.as_ref().map(|made| made.driver.avatar())
    }

    /// What drives, if there is anything to drive.
    pub(crate) fn driver(&self) -> Option<&LiveDriver> {
        self.made.as_ref().map(|made| &made.driver)
    }

    /// What was driven before the first avatar, and what it took.
    pub(crate) fn preview(&self) -> Option<&(Arc<Avatar>, PreviewFigures)> {
        self.preview.as_ref()
    }

    /// What making each avatar took, the first one first.
    pub(crate) fn figures(&self) -> &[JobFigures] {
        &self.figures
    }

    pub(crate) fn progress(&self) -> Option<FineTuneProgress> {
        self.making.as_ref().map(|making| making.job.progress())
    }

    /// What the stage is doing, for people.
    pub(crate) fn status(&self) -> String {
        let live = self.made.as_ref().map(|made| made.is_preview);
        if let Some(now) = self.progress() {
            let what = match live {
                None => "fine-tuning",
                Some(true) => "preview live, fine-tuning",
                Some(false) => "avatar live, improving",
            };
            return format!(
                "{what} {}/{}, {:.1} mm held out, {:.0} s left",
                now.step,
                now.steps,
                now.held_out_residual_m * 1e3,
                now.left_secs
            );
        }
        match (live, self.gave_up) {
            (Some(false), _) => "avatar live".to_owned(),
            (Some(true), _) => "preview live".to_owned(),
            (None, true) => "no avatar".to_owned(),
            (None, false) => format!(
                "keyframes {}/{}",
                self.keyframe_count(),
                self.keyframes_wanted()
            ),
        }
    }

    pub(crate) fn is_making(&self) -> bool {
        self.making.is_some()
    }

    /// What is due without anybody having asked for it.
    fn decide(&self) -> Option<Decision> {
        if let Some(making) = &self.making {
            let due = |after_frames: u64, is_ready: bool| match self.schedule {
                Schedule::AfterFrames => making.frames_since_begun >= after_frames,
                Schedule::WhenReady => is_ready,
                Schedule::AsRecorded(_) => false,
            };
            if due(
                self.settings.schedule.swap_after_frames,
                making.job.is_finished(),
            ) {
                return Some(Decision::TakeOver);
            }
            let previewed = self.made.is_some() || making.looked_for_preview;
            let frames = self.settings.schedule.preview_after_frames;
            return (!previewed && due(frames, making.job.has_preview()))
                .then_some(Decision::Preview);
        }
        let wanted = match &self.made {
            None => self.selector.is_full(),
            Some(made) => self.has_better_keyframes(made),
        };
        let by_record = matches!(self.schedule, Schedule::AsRecorded(_));
        (wanted && !self.gave_up && !by_record).then_some(Decision::Begin)
    }

    /// Whether the keyframes have changed so much that another avatar would be worth its time.
    fn has_better_keyframes(&self, made: &Made) -> bool {
        let config = &self.settings.schedule;
        let fresh = ids(&self.selector)
            .iter()
            .filter(|id| !made.keyframes.contains(id))
            .count();
        made.frames_driven >= config.improve_after_frames && fresh >= config.improve_new_keyframes
    }

    fn perform(&mut self, decision: Decision) -> anyhow::Result<()> {
        match decision {
            Decision::Begin => self.begin(),
            Decision::Preview => {
                self.show_preview();
                Ok(())
            }
            Decision::TakeOver => self.take_over(),
            Decision::Cancel => {
                self.gave_up |= self.making.take().is_some();
                Ok(())
            }
            Decision::StartOver => {
                self.selector.clear();
                (self.making, self.made, self.gave_up) = (None, None, false);
                self.of_last_person = AHEAD;
                self.preview = None;
                Ok(())
            }
        }
    }

    fn beside(&self) -> Beside {
        match (&self.schedule, self.overloaded) {
            (Schedule::AfterFrames | Schedule::AsRecorded(_), _) => Beside::Nothing,
            (Schedule::WhenReady, false) => Beside::LiveChain,
            (Schedule::WhenReady, true) => Beside::OverloadedChain,
        }
    }

    /// Starts with the keyframes there are, if there are any.
    fn begin(&mut self) -> anyhow::Result<()> {
        if self.selector.keyframes().is_empty() {
            return Ok(());
        }
        let keyframes = ids(&self.selector);
        let job = AvatarJob::start(
            (self.selector.keyframes().to_vec(), self.camera),
            &self.body,
            &self.settings,
            (self.beside(), self.clock),
            self.devices.card_to_learn_with(),
        )?;
        self.gave_up = false;
        self.making =
            Some(Making { job, frames_since_begun: 0, keyframes, looked_for_preview: false });
        Ok(())
    }

    /// Waits for the preview of the avatar that was begun, if there will be one.
    fn show_preview(&mut self) {
        let Some(making) = &mut self.making else {
            return;
        };
        making.looked_for_preview = true;
        if let Some(Preview { driver, figures }) = making.job.preview() {
            let keyframes = making.keyframes.clone();
            self.learned_from.extend(&keyframes);
            self.preview = Some((Arc::clone(driver.avatar()), figures));
            let driver = self.devices.driver(driver, &self.clock);
            self.made = Some(Made { driver, is_preview: true, frames_driven: 0, keyframes });
        }
    }

    /// Waits for the avatar that was begun, if it is not there yet, unless the user wants to stop.
    fn take_over(&mut self) -> anyhow::Result<()> {
        let Some(Making { job, keyframes, .. }) = self.making.take() else {
            return Ok(());
        };
        let Some(finished) = job.wait() else {
            self.gave_up = true;
            return Ok(());
        };
        let FinishedAvatar { driver, figures } = finished?;
        if figures.gave_up.is_some() {
            self.devices.learn_without_card();
        }
        self.learned_from.extend(&keyframes);
        self.figures.push(figures);
        let driver = self.devices.driver(driver, &self.clock);
        self.made = Some(Made { driver, is_preview: false, frames_driven: 0, keyframes });
        Ok(())
    }
}

fn ids(selector: &KeyframeSelector) -> Vec<FrameId> {
    let keyframes = selector.keyframes().iter();
    keyframes.map(|keyframe| keyframe.frame.id()).collect()
}
