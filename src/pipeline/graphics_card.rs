//! A graphics card that drives avatars and learns them. Opening one takes tenths of a second, which the first frames need
//! not wait for.

use std::{
    sync::Arc,
    thread::{self, JoinHandle},
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

/// Open, being opened until the first avatar asks for it, or none.
#[derive(Default)]
pub(crate) struct GraphicsCard {
    opening: Option<JoinHandle<Option<Arc<Gpu>>>>,
    gpu: Option<Arc<Gpu>>,
    /// Whether it has shown what it drives like.
    has_driven: bool,
}

/// A card for somebody to learn with, or none.
#[derive(Clone, Default)]
pub(crate) struct LentCard {
    gpu: Option<Arc<Gpu>>,
    on_trial: bool,
}

impl LentCard {
    pub(crate) fn none() -> Self {
        Self::default()
    }

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
    pub(crate) fn open(window: Option<&SnapshotSlot>) -> anyhow::Result<Self> {
        let gpu = opener(window)().and_then(prepared).context(
            "drive.device or learn.device is \"gpu\" (\"auto\" would go on without one)",
        )?;
        Ok(Self { opening: None, gpu: Some(gpu), has_driven: false })
    }

    /// One that is worth it, if there is one.
    pub(crate) fn look_for(window: Option<&SnapshotSlot>) -> anyhow::Result<Self> {
        let open = opener(window);
        let thread = thread::Builder::new()
            .name("graphics card".to_owned())
            .spawn(move || worth_it(open()))
            .context("cannot start the thread that opens the graphics card")?;
        Ok(Self { opening: Some(thread), gpu: None, has_driven: false })
    }

    #[cfg(test)]
    pub(crate) fn is_none(&self) -> bool {
        self.opening.is_none() && self.gpu.is_none()
    }

    /// On the card, which the first time is on trial if nobody asked for it by name. Does not wait for a card that is
    /// still being opened: the next avatar can have it.
    pub(crate) fn driver(&mut self, cpu: Driver, on_trial: bool, clock: &Clock) -> LiveDriver {
        let Some(gpu) = self.opened() else {
            return LiveDriver::on_cpu(cpu);
        };
        let mut driver = LiveDriver::on_gpu(cpu, &gpu);
        if on_trial && !self.has_driven && driver.gave_up().is_none() {
            try_out(&mut driver, gpu.name(), clock);
            if driver.gave_up().is_some() {
                self.gpu = None;
            }
            self.has_driven = true;
        }
        driver
    }

    pub(crate) fn lent(&mut self, on_trial: bool) -> LentCard {
        LentCard { gpu: self.opened(), on_trial }
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

fn prepared(gpu: Gpu) -> Result<Arc<Gpu>, GpuError> {
    gpu.prepare(SirenConfig::LIVE.hidden)?;
    Ok(Arc::new(gpu))
}

/// What nobody asked for by name must be more than the processor in disguise.
fn worth_it(opened: Result<Gpu, GpuError>) -> Option<Arc<Gpu>> {
    let gpu = opened.and_then(|gpu| {
        if gpu.is_software() {
            tracing::info!(adapter = gpu.name(), "in software: the processor drives");
            return Ok(None);
        }
        prepared(gpu).map(Some)
    });
    gpu.inspect_err(|reason| tracing::info!(%reason, "the processor drives"))
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
        let open =
            || GraphicsCard { opening: None, gpu: Some(Arc::clone(&gpu)), has_driven: false };
        let by_card = format!("{}, full field", gpu.name());
        let asked_for = open().driver(driver(), false, &clock);
        assert_eq!(
            (asked_for.device(), asked_for.gave_up()),
            (by_card.clone(), None)
        );

        let mut card = open();
        let tried = card.driver(driver(), true, &clock);
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
        assert_eq!(card.driver(driver(), true, &clock).device(), tried.device());
    }
}
