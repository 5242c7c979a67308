//! What this machine is and how much of it we used.

use serde::Serialize;

/// Stands beside every measurement.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Machine {
    pub(crate) os: &'static str,
    pub(crate) arch: &'static str,
    pub(crate) cpu: Option<String>,
    pub(crate) threads: usize,
}

impl Machine {
    pub(crate) fn this() -> Self {
        Self {
            os: std::env::consts::OS,
            arch: std::env::consts::ARCH,
            cpu: proc_value("/proc/cpuinfo", "model name"),
            threads: std::thread::available_parallelism().map_or(1, usize::from),
        }
    }
}

/// The most memory this process ever held, where the system tells (Linux).
pub(crate) fn peak_memory_mb() -> Option<f64> {
    let value = proc_value("/proc/self/status", "VmHWM")?;
    let kib: f64 = value.split_whitespace().next()?.parse().ok()?;
    Some(kib / 1024.0)
}

/// The value of the first `key: value` line of a file under `/proc`.
fn proc_value(path: &str, key: &str) -> Option<String> {
    let text = std::fs::read_to_string(path).ok()?;
    let line = text.lines().find(|line| line.starts_with(key))?;
    Some(line.split_once(':')?.1.trim().to_owned())
}
