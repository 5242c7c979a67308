//! Nobody is judged on what was learned from: people, outfits and motions of the tests are none of the training's.

use anyhow::ensure;
use effigy_avatar::hyper::Provenance;
use effigy_sim_sensor::dataset::{DatasetPlan, DatasetPreset, Manifest, Role, SequencePlan, Split};

/// Refuses a data set whose test people were learned from, by its own training split or by the prior, or do in extrapolation
/// what their avatar learned from.
pub(super) fn check(manifest: &Manifest, prior: &Provenance) -> anyhow::Result<()> {
    let plans: Vec<&SequencePlan> = manifest.sequences.iter().map(|entry| &entry.plan).collect();
    let learned = learned_from(&prior.training);
    check_plans(&plans, &learned.iter().collect::<Vec<_>>())
}

/// What the prior learned from, if it was a data set: its provenance names preset and seed.
fn learned_from(training: &str) -> Vec<SequencePlan> {
    let of_preset = |(words, preset): (&str, DatasetPreset)| {
        let (_, rest) = training.split_once(words)?;
        let digits = rest.split(|c: char| !c.is_ascii_digit()).next()?;
        Some(DatasetPlan::new(preset, digits.parse().ok()?).sequences)
    };
    let presets = [
        ("data set Prior of seed ", DatasetPreset::Prior),
        (
            "data set PriorActions of seed ",
            DatasetPreset::PriorActions,
        ),
        ("data set CapeLike of seed ", DatasetPreset::CapeLike),
        ("data set Dev of seed ", DatasetPreset::Dev),
        ("data set Small of seed ", DatasetPreset::Small),
    ];
    let plans = presets.into_iter().filter_map(of_preset).flatten();
    // Of any data set only training people are learned from.
    plans.filter(|plan| plan.split == Split::Train).collect()
}

/// No test person is a training person, here or in `learned`, and no action of extrapolation was learned from that person.
fn check_plans(plans: &[&SequencePlan], learned: &[&SequencePlan]) -> anyhow::Result<()> {
    for test in plans.iter().filter(|plan| plan.split == Split::Test) {
        let trained = plans.iter().filter(|plan| plan.split == Split::Train);
        if let Some(other) = trained
            .chain(learned)
            .find(|plan| is_same_person(plan, test))
        {
            anyhow::bail!(
                "{} and {} are the same person, who was learned from",
                test.name,
                other.name
            );
        }
        if test.role == Role::FineTune {
            continue;
        }
        let own = plans.iter().filter(|plan| {
            (plan.split, plan.role) == (Split::Test, Role::FineTune) && is_same_person(plan, test)
        });
        for teacher in own {
            ensure!(
                teacher.action != test.action,
                "{} tests an action that {} teaches",
                test.name,
                teacher.name
            );
        }
    }
    Ok(())
}

/// Simulated people are their scenario's seed; those of a foreign data set, their number there.
fn is_same_person(one: &SequencePlan, other: &SequencePlan) -> bool {
    match (&one.scenario, &other.scenario) {
        (Some(one), Some(other)) => one.seed == other.seed,
        (None, None) => one.subject == other.subject,
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    use effigy_avatar::hyper;
    use effigy_sim_sensor::OutfitKind;

    use super::*;

    fn plans(preset: DatasetPreset) -> Vec<SequencePlan> {
        DatasetPlan::new(preset, 1).sequences
    }

    #[test]
    fn no_test_person_was_learned_from_by_data_set_or_shipped_prior() {
        let learned = learned_from(&hyper::prior().provenance.training);
        for preset in [
            DatasetPreset::CapeLike,
            DatasetPreset::Dev,
            DatasetPreset::Small,
        ] {
            let plans = plans(preset);
            check_plans(
                &plans.iter().collect::<Vec<_>>(),
                &learned.iter().collect::<Vec<_>>(),
            )
            .unwrap();
        }
    }

    #[test]
    fn people_and_extrapolated_actions_of_the_tests_and_the_blazer_are_unknown_to_a_prior() {
        let mut prior = plans(DatasetPreset::Prior);
        prior.extend(plans(DatasetPreset::PriorActions));
        let tests = plans(DatasetPreset::CapeLike);
        for test in tests.iter().filter(|plan| plan.split == Split::Test) {
            assert!(
                prior.iter().all(|plan| !is_same_person(plan, test)),
                "{}",
                test.name
            );
            let is_new = prior.iter().all(|plan| plan.action != test.action);
            assert!(test.role == Role::FineTune || is_new, "{}", test.name);
        }
        let worn = |outfit: OutfitKind| prior.iter().any(|plan| plan.outfit == outfit);
        assert!(!worn(OutfitKind::BlazerTrousers) && worn(OutfitKind::Skirt));
    }

    #[test]
    fn a_test_person_among_those_learned_from_is_refused() {
        let mut plans = plans(DatasetPreset::Small);
        plans[0].scenario = plans[1].scenario.clone();
        assert!(check_plans(&plans.iter().collect::<Vec<_>>(), &[]).is_err());
        let own = DatasetPlan::new(DatasetPreset::Small, 1).sequences;
        let all: Vec<&SequencePlan> = own.iter().collect();
        assert!(check_plans(&all, &all[1..2]).is_err());
    }

    #[test]
    fn a_provenance_brings_back_the_people_learned_from() {
        for (words, preset) in [
            ("Prior of seed 3", DatasetPreset::Prior),
            ("PriorActions of seed 3", DatasetPreset::PriorActions),
        ] {
            let learned = learned_from(&format!("effigy train hyper, --seed 4, data set {words}"));
            assert_eq!(learned, DatasetPlan::new(preset, 3).sequences);
        }
        assert!(learned_from("effigy train prior --seed 1").is_empty());
    }
}
