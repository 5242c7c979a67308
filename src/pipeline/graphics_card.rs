//! A graphics card that drives avatars or learns them, each on a device of its own: what fails in learning does not stop
//! the drive, and a pose waits for no step. Opening one takes tenths of a second, which the first frames need not wait for.

use std::{
    sync::Arc,
    thread::{self, JoinHandle},
    time::Duration,
};

use anyhow::Context as _;
use effigy_avatar::{
    Driver, LiveDriver,
    fine_tune::FineTuner,
    gpu::{Gpu, GpuError},
    sdf::SirenConfig,
};
use effigy_capture::FrameId;
use effigy_registration::BodyParams;
use effigy_viewer::SnapshotSlot;

use super::clock::Clock;

/// What a card is wanted for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Purpose {
    Drive,
    Learn,
}

/// Open, being opened until the first avatar asks for it, or none.
#[derive(Default)]
pub(crate) struct GraphicsCard {
    opening: Option<JoinHandle<Option<Arc<Gpu>>>>,
    gpu: Option<Arc<Gpu>>,
    /// Whether nobody asked for it by name, so that it has to be worth it.
    on_trial: bool,
}

/// A card for somebody to learn with, or none.
pub(crate) struct LentCard {
    gpu: Option<Arc<Gpu>>,
    on_trial: bool,
}

impl LentCard {
    /// Has steps computed on the card, if there is one; one on trial only if it is right and faster than the processor.
    pub(crate) fn help(&self, tuner: &mut FineTuner, clock: &Clock) {
        if let Some(gpu) = &self.gpu {
            tuner.lend(gpu);
            if self.on_trial {
                tuner.try_out(&|| clock.secs());
            }
        }
    }
}

/// What two cores take for a pose in the full field: who is slower than that is of no help. A map is faster still, but it
/// is not the field.
const MOST_SECS_A_POSE: f64 = 0.008;

/// Poses of a trial at most, of which the fastest counts: the processor may be busy, and first ones find nothing in its
/// place.
const TRIED: u64 = 5;
/// A trial goes on for no longer: frames wait.
const LONGEST_TRIAL_SECS: f64 = 0.1;

/// A card whose vertices are farther from the processor's (p95) computes something else.
const FARTHEST_M: f32 = 0.005;

impl GraphicsCard {
    pub(crate) fn none() -> Self {
        Self::default()
    }

    /// Any adapter, opened here and now; it is an error if there is none.
    pub(crate) fn open(purpose: Purpose, window: Option<&SnapshotSlot>) -> anyhow::Result<Self> {
        let setting = match purpose {
            Purpose::Drive => "drive.device",
            Purpose::Learn => "learn.device",
        };
        let gpu = opener(window)()
            .and_then(|gpu| prepared(gpu, purpose))
            .with_context(|| format!("{setting} is \"gpu\" (\"auto\" would go on without one)"))?;
        Ok(Self { opening: None, gpu: Some(gpu), on_trial: false })
    }

    /// One that is worth it, if there is one.
    pub(crate) fn look_for(
        purpose: Purpose,
        window: Option<&SnapshotSlot>,
    ) -> anyhow::Result<Self> {
        let open = opener(window);
        let thread = thread::Builder::new()
            .name("graphics card".to_owned())
            .spawn(move || worth_it(open(), purpose))
            .context("cannot start the thread that opens the graphics card")?;
        Ok(Self { opening: Some(thread), gpu: None, on_trial: true })
    }

    #[cfg(test)]
    pub(crate) fn is_none(&self) -> bool {
        self.opening.is_none() && self.gpu.is_none()
    }

    /// Does not wait for a card that is still being opened: the next avatar can have it.
    pub(crate) fn driver(&mut self, cpu: Driver, clock: &Clock) -> LiveDriver {
        let Some(gpu) = self.opened() else {
            return LiveDriver::on_cpu(cpu);
        };
        let mut driver = LiveDriver::on_gpu(cpu, &gpu);
        if self.on_trial && driver.gave_up().is_none() {
            try_out(&mut driver, gpu.name(), clock);
            if driver.gave_up().is_some() {
                self.gpu = None;
            }
            self.on_trial = false;
        }
        driver
    }

    /// Nor does this. A card on trial is tried for each avatar: what the processor is busy with changes.
    pub(crate) fn lent(&mut self) -> LentCard {
        LentCard { gpu: self.opened(), on_trial: self.on_trial }
    }

    /// It was given up: nobody gets it any more.
    pub(crate) fn give_up(&mut self) {
        self.gpu = None;
    }

    /// Returns when nobody has the card any more whom it was lent to; whoever was told to stop does so after a step.
    pub(crate) fn wait_for_borrowers(&self) {
        const LOOK_EVERY: Duration = Duration::from_millis(2);
        /// One that hangs must not keep the program from ending.
        const MOST_LOOKS: usize = 1000;
        if let Some(gpu) = &self.gpu {
            for _ in 0..MOST_LOOKS {
                if Arc::strong_count(gpu) == 1 {
                    break;
                }
                thread::sleep(LOOK_EVERY);
            }
        }
    }

    fn opened(&mut self) -> Option<Arc<Gpu>> {
        if self.opening.as_ref().is_none_or(JoinHandle::is_finished) {
            self.wait();
        }
        self.gpu.clone()
    }

    fn wait(&mut self) {
        if let Some(thread) = self.opening.take() {
            // A panic inside a graphics driver costs the card, not the run.
            self.gpu = thread.join().unwrap_or_default();
        }
    }
}

/// Gives the card up if it computes something else than the processor, or takes too long.
fn try_out(driver: &mut LiveDriver, card: &str, clock: &Clock) {
    let theta = driver.avatar().topology_theta;
    let params = BodyParams { theta, ..BodyParams::ZERO };
    let Some(off_m) = driver.off_the_processor_m(&params) else {
        // It failed, and was given up for that.
        return;
    };
    if off_m > FARTHEST_M {
        let off_mm = off_m * 1e3;
        driver.give_up(&format_args!(
            "{card} places vertices {off_mm:.1} mm from where the processor does"
        ));
        return;
    }
    let begun = clock.secs();
    let mut fastest_secs = f64::INFINITY;
    for number in 0..TRIED {
        let started = clock.secs();
        driver.pose(&params, FrameId(number));
        let now = clock.secs();
        if driver.gave_up().is_some() {
            return;
        }
        fastest_secs = fastest_secs.min(now - started);
        if fastest_secs <= MOST_SECS_A_POSE || now - begun > LONGEST_TRIAL_SECS {
            break;
        }
    }
    if fastest_secs > MOST_SECS_A_POSE {
        let [took_ms, most_ms] = [fastest_secs, MOST_SECS_A_POSE].map(|secs| secs * 1e3);
        driver.give_up(&format_args!(
            "{card} takes {took_ms:.1} ms a pose, the processor no more than {most_ms:.0}"
        ));
    }
}

impl Drop for GraphicsCard {
    /// Nobody may be inside a graphics driver when the program ends.
    fn drop(&mut self) {
        self.wait();
    }
}

/// The window's adapter, or this machine's fastest.
#[cfg(feature = "window")]
fn opener(window: Option<&SnapshotSlot>) -> impl FnOnce() -> Result<Gpu, GpuError> + Send + use<> {
    let adapter = window.and_then(|slot| slot.adapter().cloned());
    move || match adapter {
        Some(adapter) => Gpu::open(&adapter),
        None => Gpu::of_this_machine(),
    }
}

#[cfg(not(feature = "window"))]
fn opener(_: Option<&SnapshotSlot>) -> fn() -> Result<Gpu, GpuError> {
    Gpu::of_this_machine
}

fn prepared(gpu: Gpu, purpose: Purpose) -> Result<Arc<Gpu>, GpuError> {
    let hidden = SirenConfig::LIVE.hidden;
    match purpose {
        Purpose::Drive => gpu.prepare_to_drive(hidden)?,
        Purpose::Learn => gpu.prepare_to_learn(hidden)?,
    }
    Ok(Arc::new(gpu))
}

/// What nobody asked for by name must be more than the processor in disguise.
fn worth_it(opened: Result<Gpu, GpuError>, purpose: Purpose) -> Option<Arc<Gpu>> {
    let gpu = opened.and_then(|gpu| {
        if gpu.is_software() {
            tracing::info!(?purpose, adapter = gpu.name(), "in software: left alone");
            return Ok(None);
        }
        prepared(gpu, purpose).map(Some)
    });
    gpu.inspect_err(|reason| tracing::info!(?purpose, %reason, "no graphics card"))
        .ok()
        .flatten()
}

#[cfg(test)]
mod tests {
    use effigy_avatar::{
        Avatar, DriveConfig, Subject, TopologyConfig, hyper,
        skinning::{ClosestBodyPoint, ClosestBodyPointConfig},
    };
    use effigy_registration::smpl::builtin;

    use super::*;

    fn driver() -> Driver {
        let body = builtin::body();
        let subject = Subject::new(&body, &[0.0; 10]).unwrap();
        let skinning = ClosestBodyPoint::new(body, &[0.0; 10], ClosestBodyPointConfig::default());
        let (field, theta) = (Arc::new(hyper::prior()), BodyParams::ZERO.theta);
        let topology = TopologyConfig { vertices: 4000, ..TopologyConfig::default() };
        let avatar = Avatar::new(&subject, field, &skinning, &theta, &topology).unwrap();
        Driver::new(Arc::new(avatar), DriveConfig::default())
    }

    #[test]
    fn a_card_on_trial_drives_if_it_is_fast_and_one_asked_for_by_name_in_any_case() {
        let gpu = match Gpu::of_this_machine() {
            Ok(gpu) => Arc::new(gpu),
            Err(reason) => {
                println!("skipped: {reason}");
                return;
            }
        };
        let clock = Clock::start();
        let named =
            |on_trial| GraphicsCard { opening: None, gpu: Some(Arc::clone(&gpu)), on_trial };
        let by_card = format!("{}, full field", gpu.name());
        let asked_for = named(false).driver(driver(), &clock);
        assert_eq!(
            (asked_for.device(), asked_for.gave_up()),
            (by_card.clone(), None)
        );

        let mut card = named(true);
        let tried = card.driver(driver(), &clock);
        println!("{}, {:?}", tried.device(), tried.gave_up());
        assert_eq!(tried.gave_up().is_some(), card.gpu.is_none());
        match tried.gave_up() {
            Some(reason) => {
                assert!(reason.contains("ms a pose"), "{reason}");
                assert_eq!(tried.device(), "CPU, full field");
            }
            None => assert_eq!(tried.device(), by_card),
        }
        // Four thousand vertices take the processor a tenth of a second if it has to play the card.
        assert!(!gpu.is_software() || tried.gave_up().is_some());
        assert_eq!(card.driver(driver(), &clock).device(), tried.device());
    }

    #[test]
    fn a_card_is_waited_for_until_whoever_learns_with_it_is_done() {
        let Ok(gpu) = Gpu::of_this_machine() else {
            return;
        };
        let mut card = GraphicsCard { opening: None, gpu: Some(Arc::new(gpu)), on_trial: false };
        let lent = card.lent();
        let clock = Clock::start();
        let work = Duration::from_millis(50);
        let job = thread::Builder::new()
            .name("learns".to_owned())
            .spawn(move || {
                thread::sleep(work);
                drop(lent);
            });
        card.wait_for_borrowers();
        assert!(clock.secs() >= work.as_secs_f64());
        job.unwrap().join().unwrap();
    }
}
