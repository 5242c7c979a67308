//! How well bodies are found and followed: simulated people of the test split, their truth, and the figures between.

mod cpu_time;
mod follow;
mod loss;
mod real;
mod score;
mod statistics;
mod strangers;
mod suite;
mod table;
mod variant;

pub(crate) use suite::{Case, Suite};
pub(crate) use table::Table;
pub(crate) use variant::Variant;

use std::{
    sync::{
        Arc,
        atomic::{AtomicUsize, Ordering},
    },
    thread,
};

use anyhow::Context as _;
use effigy_fusion::clean::CleanConfig;
use effigy_registration::{BodyModel, SmoothConfig, TrackConfig};

use score::CaseScores;

/// The settings that are evaluated.
#[derive(Clone, Debug, Default)]
pub(crate) struct Options {
    pub(crate) clean: CleanConfig,
    pub(crate) track: TrackConfig,
    /// How poses are calmed that are judged smoothed.
    pub(crate) smooth: SmoothConfig,
    /// Whether the tracker is told the surface that the last frame truly had.
    pub(crate) true_surface: bool,
}

/// How well people of real recordings are explained, who stand beside those of the suites.
pub(crate) fn explain_real_people(
    body: &Arc<BodyModel>,
    options: &Options,
) -> anyhow::Result<Table> {
    Ok(Table::of_real_people(real::rows(body, options)?))
}

/// Follows everybody of a suite, one person at a time on each core; `go_on` hears how many cases are done and may stop it.
pub(crate) fn evaluate(
    cases: &[Case],
    body: &Arc<BodyModel>,
    (variant, options): (Variant, &Options),
    go_on: &(dyn Fn(usize) -> bool + Sync),
) -> anyhow::Result<Table> {
    let options = &variant.of(options);
    let groups = together(cases);
    let next = AtomicUsize::new(0);
    let finished = AtomicUsize::new(0);
    let work = || -> anyhow::Result<Vec<(usize, CaseScores)>> {
        let alone = rayon::ThreadPoolBuilder::new()
            .num_threads(1)
            .build()
            .context("no thread to evaluate on")?;
        let mut scores = Vec::new();
        loop {
            let group = groups.get(next.fetch_add(1, Ordering::Relaxed));
            let Some(group) = group.filter(|_| go_on(finished.load(Ordering::Relaxed))) else {
                return Ok(scores);
            };
            let seen: Vec<&Case> = group.iter().map(|&index| &cases[index]).collect();
            let followed = alone
                .install(|| follow::follow(&seen, body, options))
                .with_context(|| seen[0].name())?;
            scores.extend(group.iter().copied().zip(followed));
            finished.fetch_add(group.len(), Ordering::Relaxed);
        }
    };
    let workers = thread::available_parallelism().map_or(1, usize::from);
    let mut scores = thread::scope(|scope| {
        let started: Vec<_> = (0..workers).map(|_| scope.spawn(work)).collect();
        let mut all = Vec::new();
        for worker in started {
            all.extend(worker.join().expect("a worker's panic is a bug")?);
        }
        anyhow::Ok(all)
    })?;
    scores.sort_by_key(|(index, _)| *index);
    let scored = scores
        .into_iter()
        .map(|(index, score)| (&cases[index], score));
    Ok(Table::new(variant, scored))
}

/// The numbers of the cases that are followed at once: one sensor at a time, and all at a time where clothes are simulated.
fn together(cases: &[Case]) -> Vec<Vec<usize>> {
    let mut groups: Vec<Vec<usize>> = Vec::new();
    for (index, case) in cases.iter().enumerate() {
        let group = groups
            .iter_mut()
            .find(|group| cases[group[0]].shares_clothes_with(case));
        match group {
            Some(group) => group.push(index),
            None => groups.push(vec![index]),
        }
    }
    groups
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_sensors_see_simulated_clothes_at_once_and_everybody_is_followed_once() {
        let suite = Suite::full();
        let cases = suite.cases();
        let groups = together(&cases);
        let mut all: Vec<usize> = groups.iter().flatten().copied().collect();
        all.sort_unstable();
        assert_eq!(all, (0..cases.len()).collect::<Vec<_>>());
        for group in &groups {
            let in_cloth = cases[group[0]].scenario.outfit.cloth().is_some();
            let expected = if in_cloth { suite.sensors.len() } else { 1 };
            assert_eq!(group.len(), expected, "{}", cases[group[0]].name());
        }
    }
}
