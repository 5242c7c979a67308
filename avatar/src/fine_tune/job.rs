//! Fine-tuning in the background: a named thread, a pool of its own, progress to look at, a switch to stop.

use std::{
    ops::ControlFlow,
    sync::{
        Arc, Mutex,
        atomic::{AtomicBool, Ordering},
    },
    thread::JoinHandle,
};

use super::{FineTuneConfig, FineTuneProgress, fine_tune};
use crate::{CanonicalSamples, error::AvatarError, hyper::HyperNetwork, nn::Threads};

/// A fine-tuning under way.
#[derive(Debug)]
pub struct FineTuneJob {
    thread: JoinHandle<Result<HyperNetwork, AvatarError>>,
    progress: Arc<Mutex<FineTuneProgress>>,
    is_cancelled: Arc<AtomicBool>,
}

impl FineTuneJob {
    /// Starts it. `at_thread_start` runs on every thread of the job (the place to lower its priority);
    /// `clock` gives seconds from any origin.
    pub fn start(
        network: HyperNetwork,
        samples: Vec<CanonicalSamples>,
        metres_per_unit: f32,
        config: FineTuneConfig,
        clock: impl Fn() -> f64 + Send + Sync + 'static,
        at_thread_start: impl Fn() + Send + Sync + 'static,
    ) -> Result<Self, AvatarError> {
        let threads = Threads::new(&config.threads, at_thread_start)?;
        let progress = Arc::new(Mutex::new(FineTuneProgress {
            steps: config.steps,
            held_out_residual_m: f32::NAN,
            ..FineTuneProgress::default()
        }));
        let is_cancelled = Arc::new(AtomicBool::new(false));
        let (shared, stop) = (Arc::clone(&progress), Arc::clone(&is_cancelled));
        let work = move || {
            threads.run(|| {
                let mut report = |now: &FineTuneProgress| {
                    *shared.lock().expect("nobody panics holding the progress") = *now;
                    if stop.load(Ordering::Relaxed) {
                        ControlFlow::Break(())
                    } else {
                        ControlFlow::Continue(())
                    }
                };
                fine_tune(
                    network,
                    &samples,
                    metres_per_unit,
                    &config,
                    &clock,
                    &mut report,
                )
            })
        };
        let thread = std::thread::Builder::new()
            .name("fine-tune".to_owned())
            .spawn(work)
            .map_err(AvatarError::Thread)?;
        Ok(Self { thread, progress, is_cancelled })
    }

    /// The newest report.
    pub fn progress(&self) -> FineTuneProgress {
        *self
            .progress
            .lock()
            .expect("nobody panics holding the progress")
    }

    /// Asks it to stop after the step at hand; [`Self::finish`] then gives what was learned so far.
    pub fn cancel(&self) {
        self.is_cancelled.store(true, Ordering::Relaxed);
    }

    /// Whether [`Self::finish`] returns at once.
    pub fn is_finished(&self) -> bool {
        self.thread.is_finished()
    }

    /// Waits for the result.
    pub fn finish(self) -> Result<HyperNetwork, AvatarError> {
        self.thread
            .join()
            .unwrap_or(Err(AvatarError::FineTunePanicked))
    }
}
