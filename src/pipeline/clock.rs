//! The only place that reads a clock, and what it learned.

use std::{
    collections::BTreeMap,
    time::{Duration, Instant},
};

use crate::report::StageTime;

/// Time since the program's work began.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Clock {
    started: Instant,
}

impl Clock {
    #[expect(
        clippy::disallowed_methods,
        reason = "this is the clock everything else is given"
    )]
    pub(crate) fn start() -> Self {
        Self { started: Instant::now() }
    }

    pub(crate) fn now(&self) -> Duration {
        self.started.elapsed()
    }

    pub(crate) fn secs(&self) -> f64 {
        self.now().as_secs_f64()
    }
}

/// Milliseconds spent in each stage, by name.
#[derive(Clone, Debug, Default)]
pub(crate) struct Timings {
    by_stage: BTreeMap<&'static str, Vec<f32>>,
}

impl Timings {
    /// Runs a step and remembers how long it took.
    pub(crate) fn time<T>(
        &mut self,
        clock: &Clock,
        stage: &'static str,
        step: impl FnOnce() -> T,
    ) -> T {
        let start = clock.now();
        let result = step();
        self.add(stage, clock.now().saturating_sub(start));
        result
    }

    pub(crate) fn add(&mut self, stage: &'static str, spent: Duration) {
        self.by_stage
            .entry(stage)
            .or_default()
            .push(spent.as_secs_f32() * 1e3);
    }

    /// The median and the 95th percentile of a stage's latest times, in milliseconds.
    pub(crate) fn recent(&self, stage: &str, count: usize) -> Option<(f32, f32)> {
        let times = self.by_stage.get(stage)?;
        let recent = &times[times.len().saturating_sub(count)..];
        Some((
            percentile(recent, 0.5)? as f32,
            percentile(recent, 0.95)? as f32,
        ))
    }

    /// Takes over what another thread measured.
    pub(crate) fn merge(&mut self, other: Self) {
        for (stage, times) in other.by_stage {
            self.by_stage.entry(stage).or_default().extend(times);
        }
    }

    pub(crate) fn summary(&self) -> BTreeMap<String, StageTime> {
        self.by_stage
            .iter()
            .map(|(stage, times)| {
                let mean = times.iter().sum::<f32>() / times.len() as f32;
                let time = StageTime {
                    mean: f64::from(mean),
                    p50: percentile(times, 0.5).unwrap_or(0.0),
                    p95: percentile(times, 0.95).unwrap_or(0.0),
                };
                ((*stage).to_owned(), time)
            })
            .collect()
    }
}

/// The value that a share of all values does not exceed; `None` of none.
pub(crate) fn percentile(values: &[f32], share: f64) -> Option<f64> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f32::total_cmp);
    let last = sorted.len().checked_sub(1)?;
    let rank = (share * sorted.len() as f64).ceil() as usize;
    Some(f64::from(sorted[rank.saturating_sub(1).min(last)]))
}

#[cfg(test)]
mod tests {
    use super::percentile;

    #[test]
    fn percentiles_are_values_that_occurred() {
        let values: Vec<f32> = (1..=100).map(|v| v as f32).collect();
        assert_eq!(percentile(&values, 0.5), Some(50.0));
        assert_eq!(percentile(&values, 0.95), Some(95.0));
        assert_eq!(percentile(&values, 1.0), Some(100.0));
        assert_eq!(percentile(&[], 0.5), None);
    }
}
