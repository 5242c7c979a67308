//! What individuals claim: they are spread like the survey, no betas make them, and their flesh moves.

use effigy_registration::smpl::builtin;

use super::{anthropometry::mass_of, *};
use crate::cloth::rms_between_m;

fn individual(seed: u64) -> Person {
    Person::individual(builtin::body(), Outfit::BARE, seed)
}

fn mean_and_deviation(values: &[f32]) -> (f32, f32) {
    let n = values.len() as f32;
    let mean = values.iter().sum::<f32>() / n;
    let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f32>() / n;
    (mean, variance.sqrt())
}

#[test]
fn adults_are_spread_like_the_survey_and_have_the_measures_they_claim() {
    let body = builtin::body();
    let adults: Vec<Adult> = (0..160).map(|seed| Adult::sample(&body, seed)).collect();
    for (sex, stature_m, bmi) in [(Sex::Male, 1.756, 28.0), (Sex::Female, 1.629, 25.9)] {
        let of_sex: Vec<&Adult> = adults.iter().filter(|adult| adult.sex == sex).collect();
        assert!(of_sex.len() > 55, "about half: {}", of_sex.len());
        let statures: Vec<f32> = of_sex.iter().map(|adult| adult.stature_m).collect();
        let bmis: Vec<f32> = of_sex
            .iter()
            .map(|a| a.mass_kg / a.stature_m.powi(2))
            .collect();
        let (mean, deviation) = mean_and_deviation(&statures);
        // Three standard errors of 60 people; the cut at 1.50 m takes a centimetre off women.
        assert!((mean - stature_m).abs() < 0.03, "{sex:?}: {mean} m");
        assert!(
            (0.045..0.085).contains(&deviation),
            "{sex:?}: {deviation} m"
        );
        let (mean, deviation) = mean_and_deviation(&bmis);
        assert!((mean - bmi).abs() < 1.6, "{sex:?}: {mean} kg/m^2");
        assert!(
            (2.8..5.2).contains(&deviation),
            "{sex:?}: {deviation} kg/m^2"
        );
        assert!(
            bmis.iter().any(|b| *b < 22.5) && bmis.iter().any(|b| *b > 31.0),
            "thin and heavy"
        );
    }
    let mut missed = 0;
    for adult in &adults {
        assert!((1.50..=1.95).contains(&adult.stature_m));
        let shaped = body.shaped_vertices(&adult.betas);
        let height_m = identity::height_m(&shaped);
        assert!(
            (height_m - adult.stature_m).abs() < 0.005,
            "{adult:?} is {height_m} m"
        );
        let mass_kg = mass_of(&shaped, &body.triangles);
        missed += usize::from((mass_kg / adult.mass_kg - 1.0).abs() > 0.02);
    }
    assert!(
        missed <= 4,
        "{missed} of 160 would need betas beyond what the body bears"
    );
}

#[test]
fn no_betas_make_an_individual_but_the_best_ones_come_near() {
    for seed in 0..6 {
        let person = individual(seed);
        let zero = [Vec3::ZERO; JOINT_COUNT];
        let truth = person.minimal_zero_pose(&zero);
        let rms_to = |betas: &[f32; 10]| rms_between_m(&truth, &person.body.shaped_vertices(betas));
        let best_m = rms_to(&person.betas);
        // Faces, hands and feet, a third of the vertices, have hardly any offset of their own.
        assert!((0.0010..0.0060).contains(&best_m), "{seed}: {best_m} m off");
        let born_with = person.individual.as_ref().unwrap().adult.betas;
        assert!(
            best_m <= rms_to(&born_with) + 1e-6,
            "{seed}: better than those they were made from"
        );
        for beta in 0..10 {
            let mut other = person.betas;
            other[beta] += 0.1;
            assert!(rms_to(&other) > best_m, "{seed}: a minimum in beta {beta}");
        }
    }
}

#[test]
fn offsets_are_smooth() {
    let person = individual(3);
    let offsets = &person.individual.as_ref().unwrap().offsets;
    for &[a, b, _] in &person.body.triangles {
        let (a, b) = (a as usize, b as usize);
        let edge_m = person.minimal[a].distance(person.minimal[b]);
        let step_m = offsets[a].distance(offsets[b]);
        assert!(
            step_m < 0.001 + 0.25 * edge_m,
            "{step_m} m over an edge of {edge_m} m"
        );
    }
}

#[test]
fn flesh_moves_with_the_pose_and_not_without_one() {
    let person = individual(5);
    let flesh_in = |theta: &[Vec3; JOINT_COUNT]| -> Vec<f32> {
        let mut model = person.minimal.clone();
        person.body.add_pose_correctives(&mut model, theta);
        let moved = person.minimal_zero_pose(theta);
        moved
            .iter()
            .zip(&model)
            .map(|(a, b)| a.distance(*b))
            .collect()
    };
    let most = |values: &[f32]| values.iter().copied().fold(0.0, f32::max);
    assert!(
        most(&flesh_in(&[Vec3::ZERO; JOINT_COUNT])) < 1e-6,
        "nothing in the zero pose"
    );
    let mut bent = [Vec3::ZERO; JOINT_COUNT];
    bent[18] = Vec3::new(0.0, -2.0, 0.0);
    let biceps = most(&flesh_in(&bent));
    assert!(
        (0.002..0.02).contains(&biceps),
        "a bent elbow swells the arm by {biceps} m"
    );
    let mut bowed = [Vec3::ZERO; JOINT_COUNT];
    bowed[0] = Vec3::new(1.4, 0.0, 0.0);
    let belly = most(&flesh_in(&bowed));
    assert!(
        (0.002..0.04).contains(&belly),
        "a trunk that leans forward hangs by {belly} m"
    );
}
