//! Fine-tuning in the background: from keyframes to an avatar, on its own low-priority threads.

use std::{
    ops::ControlFlow,
    sync::{
        Arc, Mutex, PoisonError,
        atomic::{AtomicBool, Ordering},
    },
    thread::{self, JoinHandle},
    time::Duration,
};

use anyhow::{Context as _, anyhow};
use crossbeam::channel::{Receiver, RecvTimeoutError, Select, Sender, TryRecvError, bounded};
use effigy_avatar::{
    Avatar, AvatarError, CanonicalSamples, Canonicaliser, DriveConfig, Driver, MapConfig, ShapeMap,
    TopologyConfig,
    fine_tune::{FineTuneProgress, FineTuner},
    hyper::HyperNetwork,
    keyframes::Keyframe,
    nn::Threads,
};
use effigy_capture::CameraModel;
use effigy_registration::{
    BodyModel,
    motion::{Motion, RestBody, Routine},
};

use super::{
    clock::Clock,
    graphics_card::LentCard,
    refine::{OnStep, Refinement},
    settings::Settings,
};
use crate::{interrupt, machine::Machine};

/// How often somebody who waits for an avatar looks up.
const LOOK_EVERY: Duration = Duration::from_millis(100);

/// What else the machine has to do meanwhile.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Beside {
    /// A replay in lock-step, which waits for the avatar.
    Nothing,
    /// Frames that must not come late.
    LiveChain,
    /// Frames that come late anyhow.
    OverloadedChain,
}

/// What a map learns from beside the actions.
const MORE_ROUTINES: [Routine; 5] = [
    Routine::Squat,
    Routine::RaiseArms,
    Routine::WalkInPlace,
    Routine::Wave,
    Routine::Freestyle,
];

/// What a map of somebody's avatar learns from.
pub(crate) fn map_motions(rest: &RestBody) -> Vec<Motion> {
    const RATE_HZ: f32 = 15.0;
    const SEED: u64 = 1;
    let routines = Routine::ACTIONS.iter().chain(&MORE_ROUTINES);
    routines
        .map(|routine| routine.motion(rest, RATE_HZ, SEED))
        .collect()
}

/// A running job; dropping it cancels it.
pub(crate) struct AvatarJob {
    cancel: Arc<AtomicBool>,
    progress: Arc<Mutex<FineTuneProgress>>,
    preview: Receiver<Preview>,
    result: Receiver<anyhow::Result<FinishedAvatar>>,
    thread: JoinHandle<()>,
}

/// An avatar that has learned for a short time only.
pub(crate) struct Preview {
    pub(crate) driver: Driver,
    pub(crate) figures: PreviewFigures,
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct PreviewFigures {
    /// Steps that it has learned for.
    pub(crate) steps: usize,
    /// From the keyframes to something that can be driven.
    pub(crate) secs: f64,
    /// As [`JobFigures::map_p95_mm`].
    pub(crate) map_p95_mm: Option<f32>,
}

pub(crate) struct FinishedAvatar {
    pub(crate) driver: Driver,
    pub(crate) figures: JobFigures,
}

/// What making an avatar took and came to.
#[derive(Clone, Debug, Default)]
pub(crate) struct JobFigures {
    /// What computed the steps.
    pub(crate) device: String,
    /// Why a graphics card that was at hand did not.
    pub(crate) gave_up: Option<String>,
    pub(crate) steps: usize,
    pub(crate) loss: f32,
    pub(crate) held_out_mm: f32,
    pub(crate) fine_tune_secs: f64,
    /// How far the map that drives it is from the full field, p95 over poses it has not seen; `None` where the field
    /// drives it.
    pub(crate) map_p95_mm: Option<f32>,
    /// From the keyframes to an avatar that can be driven.
    pub(crate) total_secs: f64,
}

impl AvatarJob {
    pub(crate) fn start(
        (keyframes, camera): (Vec<Keyframe>, CameraModel),
        body: &Arc<BodyModel>,
        settings: &Settings,
        (beside, clock): (Beside, Clock),
        card: LentCard,
    ) -> anyhow::Result<Self> {
        let cancel = Arc::new(AtomicBool::new(false));
        let progress = Arc::new(Mutex::new(FineTuneProgress::default()));
        let (sender, result) = bounded(1);
        let (to_preview, preview) = bounded(1);
        let work = Work {
            keyframes,
            camera,
            body: Arc::clone(body),
            settings: settings.clone(),
            cancel: Arc::clone(&cancel),
            progress: Arc::clone(&progress),
            to_preview,
            beside,
            clock,
            card,
        };
        let thread = thread::Builder::new()
            .name("fine-tune".to_owned())
            .spawn(move || {
                beside.take_place();
                // Nobody listens any more after a cancellation.
                drop(sender.send(work.run()));
            })
            .context("cannot start the fine-tuning thread")?;
        Ok(Self { cancel, progress, preview, result, thread })
    }

    /// Whether the avatar is there.
    pub(crate) fn is_finished(&self) -> bool {
        !self.result.is_empty() || self.thread.is_finished()
    }

    /// Whether there is something to show before the avatar.
    pub(crate) fn has_preview(&self) -> bool {
        !self.preview.is_empty()
    }

    /// What there is to show before the avatar, waited for if need be; `None` if there will be nothing, or the user wants
    /// to stop.
    pub(crate) fn preview(&self) -> Option<Preview> {
        loop {
            match self.preview.recv_timeout(LOOK_EVERY) {
                Ok(preview) => return Some(preview),
                Err(RecvTimeoutError::Timeout) if !interrupt::requested() => {}
                Err(_) => return None,
            }
        }
    }

    /// Returns when the avatar is there or the user wants to stop; `meanwhile` is called now and then.
    pub(crate) fn wait_until_finished(&self, mut meanwhile: impl FnMut()) {
        let mut ready = Select::new();
        ready.recv(&self.result);
        while !interrupt::requested() && ready.ready_timeout(LOOK_EVERY).is_err() {
            meanwhile();
        }
    }

    /// The avatar, waited for if need be; `None` if the user wants to stop.
    pub(crate) fn wait(&self) -> Option<anyhow::Result<FinishedAvatar>> {
        self.wait_until_finished(|| {});
        match self.result.try_recv() {
            Ok(finished) => Some(finished),
            Err(TryRecvError::Disconnected) => Some(Err(died())),
            Err(TryRecvError::Empty) => None,
        }
    }

    pub(crate) fn progress(&self) -> FineTuneProgress {
        *self.progress.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Drop for AvatarJob {
    fn drop(&mut self) {
        self.cancel.store(true, Ordering::Relaxed);
    }
}

fn died() -> anyhow::Error {
    anyhow!("fine-tuning ended without a result; this is a defect of Effigy, please report it")
}

impl Beside {
    /// Threads of a job that was not told how many.
    fn threads(self) -> usize {
        let cores = Machine::this().threads;
        match self {
            Self::Nothing | Self::OverloadedChain => cores,
            // With all cores, the chain's slowest frames took half as long again.
            Self::LiveChain => cores.saturating_sub(1).max(1),
        }
    }

    /// The live chain goes first; the threads that this one starts inherit its place.
    fn take_place(self) {
        // A tenth of a busy core. Where everything is busy all the time, as beside a window that is drawn in
        // software, that would mean an avatar after five minutes.
        #[cfg(target_os = "linux")]
        if self == Self::LiveChain {
            const NICE: i32 = 10;
            let thread = rustix::thread::gettid();
            if let Err(error) = rustix::process::setpriority_process(Some(thread), NICE) {
                tracing::warn!(%error, "fine-tuning keeps the priority of everything else");
            }
        }
    }
}

struct Work {
    keyframes: Vec<Keyframe>,
    camera: CameraModel,
    body: Arc<BodyModel>,
    settings: Settings,
    cancel: Arc<AtomicBool>,
    progress: Arc<Mutex<FineTuneProgress>>,
    to_preview: Sender<Preview>,
    beside: Beside,
    clock: Clock,
    card: LentCard,
}

impl Work {
    /// All of it inside a pool of low priority: what ran in the pool that everybody shares would hold up the live stages.
    fn run(&self) -> anyhow::Result<FinishedAvatar> {
        let mut threads = self.settings.fine_tune.threads;
        if threads.count == 0 {
            threads.count = self.beside.threads();
        }
        let beside = self.beside;
        Threads::new(&threads, move || beside.take_place())?.run(|| self.make())
    }

    fn make(&self) -> anyhow::Result<FinishedAvatar> {
        let started = self.clock.secs();
        let newest = self
            .keyframes
            .iter()
            .max_by_key(|keyframe| keyframe.frame.id());
        let betas = newest
            .context("an avatar needs at least one keyframe")?
            .params
            .betas;
        let canonicaliser = Canonicaliser::new(
            Arc::clone(&self.body),
            &betas,
            self.settings.canonicalise.clone(),
        )?
        .with_camera(&self.camera);
        let prior = self.settings.prior_network(self.body.identity)?;
        let learning_started = self.clock.secs();
        let subject = canonicaliser.subject();
        let motions = map_motions(&RestBody::of(&self.body, &subject.betas));
        let driver_of = |network: HyperNetwork, map: &MapConfig| {
            let skinning = &**canonicaliser.skinning();
            let theta = self.keyframes[self.keyframes.len() / 2].params.theta;
            let topology = TopologyConfig::default();
            let avatar = Avatar::new(subject, Arc::new(network), skinning, &theta, &topology)?;
            self.driver_of(Arc::new(avatar), &motions, map)
        };
        let before = self.settings.refine.steps_in_all();
        let steps = before.saturating_add(self.settings.fine_tune.steps);
        let mut on_step = |now: &FineTuneProgress, network: &HyperNetwork| {
            let step = now.step;
            if step == self.settings.preview.steps && step < steps {
                let made = driver_of(network.clone(), &self.map_of_preview());
                self.show(made, started);
            }
            let elapsed_secs = self.clock.secs() - learning_started;
            let left_secs = elapsed_secs * f64::from(steps - step) / f64::from(step.max(1));
            self.report(&FineTuneProgress { steps, elapsed_secs, left_secs, ..*now })
        };
        let samples = self.samples(&canonicaliser, &prior, &mut on_step)?;
        let tuning_started = self.clock.secs();
        let mut last = FineTuneProgress::default();
        let mut tuner = FineTuner::new(
            prior,
            &samples,
            subject.unit_box.metres_per_unit(),
            &self.settings.fine_tune,
        )?;
        self.card.help(&mut tuner, &self.clock);
        tuner.run(&|| self.clock.secs(), &mut |now, network| {
            last = *now;
            on_step(
                &FineTuneProgress { step: before + now.step, ..*now },
                network,
            )
        })?;
        let device = tuner.device().to_owned();
        let gave_up = tuner.gave_up().map(str::to_owned);
        let fine_tune_secs = self.clock.secs() - tuning_started;
        let (driver, map_p95_mm) = driver_of(tuner.into_network(), &self.settings.map)?;
        let figures = JobFigures {
            device,
            gave_up,
            steps: last.step as usize,
            loss: last.loss.total() as f32,
            held_out_mm: last.held_out_residual_m * 1e3,
            fine_tune_secs,
            map_p95_mm,
            total_secs: self.clock.secs() - started,
        };
        Ok(FinishedAvatar { driver, figures })
    }

    /// What is learned from: the keyframes, looked at again with the clothes that they show, in canonical space.
    fn samples(
        &self,
        canonicaliser: &Canonicaliser,
        prior: &HyperNetwork,
        on_step: &mut OnStep<'_>,
    ) -> anyhow::Result<Vec<CanonicalSamples>> {
        let tracked: Vec<_> = self
            .keyframes
            .iter()
            .map(|keyframe| keyframe.frame.clone())
            .collect();
        let Self { body, camera, settings, .. } = self;
        let refined = Refinement { body, camera, canonicaliser, prior, settings }
            .refined(&tracked, on_step)?;
        let mut samples = Vec::with_capacity(refined.len());
        for (number, keyframe) in refined.iter().enumerate() {
            let Some((points, counts)) = canonicaliser.process(keyframe) else {
                continue;
            };
            if counts.kept == 0 {
                return Err(AvatarError::NothingCanonical { keyframe: number, counts }.into());
            }
            samples.push(points);
        }
        Ok(samples)
    }

    /// What drives an avatar, and how far its map is from the field if it has one: only what is near enough drives
    /// without the field.
    fn driver_of(
        &self,
        avatar: Arc<Avatar>,
        motions: &[Motion],
        map: &MapConfig,
    ) -> anyhow::Result<(Driver, Option<f32>)> {
        let mut driver = Driver::new(avatar, DriveConfig::default());
        let go_on = &mut || !self.cancel.load(Ordering::Relaxed);
        let learned = ShapeMap::learn(&mut driver, motions, map, go_on)?;
        let near = learned.filter(|learned| learned.error.p95_mm <= map.most_p95_mm);
        let p95_mm = near.as_ref().map(|near| near.error.p95_mm);
        let driver = match near {
            Some(near) => driver.with_map(near),
            None => driver,
        };
        Ok((driver, p95_mm))
    }

    /// A preview is driven by its map, whatever that is worth: the field would take the time that fine-tuning needs.
    fn map_of_preview(&self) -> MapConfig {
        let poses_a_motion = self.settings.preview.poses_a_motion;
        let whatever = f32::INFINITY;
        MapConfig { poses_a_motion, most_p95_mm: whatever, farthest: whatever, ..self.settings.map }
    }

    /// Without a preview one waits a little longer, no more.
    fn show(&self, made: anyhow::Result<(Driver, Option<f32>)>, started: f64) {
        match made {
            Ok((driver, map_p95_mm)) => {
                let figures = PreviewFigures {
                    steps: self.settings.preview.steps as usize,
                    secs: self.clock.secs() - started,
                    map_p95_mm,
                };
                // Nobody listens any more after a cancellation.
                drop(self.to_preview.send(Preview { driver, figures }));
            }
            Err(error) => tracing::warn!(%error, "no preview of the avatar"),
        }
    }

    fn report(&self, now: &FineTuneProgress) -> ControlFlow<()> {
        *self.progress.lock().unwrap_or_else(PoisonError::into_inner) = *now;
        if self.cancel.load(Ordering::Relaxed) {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    }
}
