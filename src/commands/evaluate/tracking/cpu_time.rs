//! What a piece of work cost this thread, whatever else the machine is busy with.

/// Runs some work; what it returned, and the milliseconds of processor time it took.
pub(super) fn timed<T>(work: impl FnOnce() -> T) -> (T, f32) {
    let start_ms = now_ms();
    let result = work();
    (result, (now_ms() - start_ms) as f32)
}

/// Processor time of this thread.
#[cfg(target_os = "linux")]
fn now_ms() -> f64 {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
    time.tv_sec as f64 * 1e3 + time.tv_nsec as f64 * 1e-6
}

/// Time of day stands in for processor time where the system does not tell it.
#[cfg(not(target_os = "linux"))]
fn now_ms() -> f64 {
    use crate::pipeline::clock::Clock;
    use std::sync::OnceLock;
    static CLOCK: OnceLock<Clock> = OnceLock::new();
    CLOCK.get_or_init(Clock::start).secs() * 1e3
}
