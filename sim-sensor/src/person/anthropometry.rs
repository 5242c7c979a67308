//! Adults as the surveys find them: both sexes, short and tall, thin and heavy.
//!
//! Stature and body mass index are drawn after ANSUR II (Gordon et al. 2014; means and deviations in
//! `docs/people.md`), then the betas are found that give the built-in body that stature and that volume.

use effigy_registration::BodyModel;
use glam::Vec3;

use super::identity::height_m;
use crate::random::Randomness;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sex {
    Male,
    Female,
}

/// Somebody's measures, and the body that has them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Adult {
    pub sex: Sex,
    pub stature_m: f32,
    pub mass_kg: f32,
    pub betas: [f32; 10],
}

/// What a survey says about one sex.
struct Survey {
    stature_m: [f32; 2],
    bmi: [f32; 2],
    /// Beta 2: from the build of men (0) to that of women (1.5).
    build: f32,
}

const MEN: Survey = Survey { stature_m: [1.756, 0.069], bmi: [27.7, 4.0], build: 0.0 };
const WOMEN: Survey = Survey { stature_m: [1.629, 0.064], bmi: [25.6, 3.9], build: 1.5 };
const STATURE_M: [f32; 2] = [1.50, 1.95];
/// Thin to heavy: below and above there are few.
const BMI: [f32; 2] = [17.0, 38.0];
/// Living tissue with some air in it.
const KG_PER_LITRE: f32 = 1.01;
/// Build, and what is left of the spread of lengths and breadths once stature and mass are known.
const REST_DEVIATION: f32 = 0.8;
const REST_LIMIT: f32 = 2.0;
/// Size and weight may go further than others: the tables above say how far.
const SOLVED_LIMIT: f32 = 4.0;
const MAX_DRAWS: u64 = 64;

impl Adult {
    /// Somebody by number.
    pub fn sample(body: &BodyModel, seed: u64) -> Self {
        let random = Randomness::new(seed, 0, 0xadu64);
        let sex = if random.uniform(0) < 0.5 {
            Sex::Male
        } else {
            Sex::Female
        };
        let survey = if sex == Sex::Male { MEN } else { WOMEN };
        let (stature_m, bmi) = survey.drawn(random);
        let rest =
            |i: u64| (REST_DEVIATION * random.gaussian(512 + i)).clamp(-REST_LIMIT, REST_LIMIT);
        let mut betas: [f32; 10] = std::array::from_fn(|i| rest(i as u64));
        betas[2] = survey.build + 0.45 * rest(2);
        let mass_kg = bmi * stature_m * stature_m;
        fit_stature_and_mass(body, &mut betas, stature_m, mass_kg);
        Self { sex, stature_m, mass_kg, betas }
    }
}

impl Survey {
    /// Stature and body mass index, drawn again while somebody is too small or too large.
    fn drawn(&self, random: Randomness) -> (f32, f32) {
        for draw in 0..MAX_DRAWS {
            let stature_m = self.stature_m[0] + self.stature_m[1] * random.gaussian(8 + 2 * draw);
            // More people are much too heavy than much too light: logarithms are normal.
            let bmi =
                self.bmi[0] * (self.bmi[1] / self.bmi[0] * random.gaussian(9 + 2 * draw)).exp();
            let known = (STATURE_M[0]..=STATURE_M[1]).contains(&stature_m);
            if known && (BMI[0]..=BMI[1]).contains(&bmi) {
                return (stature_m, bmi);
            }
        }
        (self.stature_m[0], self.bmi[0])
    }
}

/// Stature follows beta 0, volume beta 1: a few secant steps each.
fn fit_stature_and_mass(body: &BodyModel, betas: &mut [f32; 10], stature_m: f32, mass_kg: f32) {
    const ROUNDS: usize = 5;
    (betas[0], betas[1]) = (0.0, 0.0);
    let mut shaped = body.template.clone();
    for _ in 0..ROUNDS {
        for (beta, goal) in [(0, stature_m), (1, mass_kg)] {
            let mut measured = |value: f32| {
                let mut tried = *betas;
                tried[beta] = value;
                body.shape_into(&tried, &mut shaped);
                if beta == 0 {
                    height_m(&shaped)
                } else {
                    mass_of(&shaped, &body.triangles)
                }
            };
            let (now, ahead) = (measured(betas[beta]), measured(betas[beta] + 0.25));
            let slope = (ahead - now) / 0.25;
            betas[beta] = (betas[beta] + (goal - now) / slope).clamp(-SOLVED_LIMIT, SOLVED_LIMIT);
        }
    }
}

/// Of a closed surface full of tissue.
pub(super) fn mass_of(vertices: &[Vec3], triangles: &[[u32; 3]]) -> f32 {
    let volume_m3: f64 = triangles
        .iter()
        .map(|corners| {
            let [a, b, c] = corners.map(|v| vertices[v as usize]);
            f64::from(a.dot(b.cross(c))) / 6.0
        })
        .sum();
    volume_m3 as f32 * 1000.0 * KG_PER_LITRE
}
