//! Who is followed, doing what, seen by which sensor.

use effigy_registration::motion::Routine;
use effigy_sim_sensor::{MotionChoice, OutfitKind, Scenario, SensorPreset};

/// The people of the test split: nothing was ever tuned on them. Settings are tuned on people below 100.
const TEST_PEOPLE: [u64; 3] = [101, 102, 103];

/// Of movement that losses interrupt; it repeats.
const LOSS_SECS: f32 = 20.0;

/// Who and what is evaluated.
#[derive(Clone, Debug)]
pub(crate) struct Suite {
    pub(crate) people: Vec<u64>,
    pub(crate) sensors: Vec<SensorPreset>,
    pub(crate) outfits: Vec<OutfitKind>,
    pub(crate) motions: Vec<Routine>,
    /// Movements are cut after this.
    pub(crate) most_secs: f32,
    /// Long enough for the shape to settle and for jitter to be measured after it; 0 for no stand.
    pub(crate) stand_secs: f32,
    /// Losses of each person in each outfit before each sensor.
    pub(crate) losses: usize,
}

/// One person doing one thing.
#[derive(Clone, Debug)]
pub(crate) struct Case {
    pub(crate) suite: &'static str,
    pub(crate) scenario: Scenario,
    pub(crate) purpose: Purpose,
}

/// What a case is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Purpose {
    /// How near the body is.
    Accuracy,
    /// How still the body of a still person is; counts for accuracy too.
    Stillness,
    /// The person goes and comes back this often.
    Losses(usize),
}

impl Case {
    pub(crate) fn name(&self) -> String {
        let Scenario { sensor, outfit, seed, .. } = &self.scenario;
        format!(
            "{} {} {} person {seed}",
            sensor.name(),
            outfit_name(*outfit),
            self.motion_name()
        )
    }

    pub(crate) fn motion_name(&self) -> String {
        match (&self.scenario.motion, self.purpose) {
            (_, Purpose::Losses(_)) => "losses".to_owned(),
            (MotionChoice::Routine(routine), _) => routine.name().to_owned(),
            (MotionChoice::Bvh(path) | MotionChoice::File(path), _) => path.display().to_string(),
        }
    }
}

pub(crate) fn outfit_name(outfit: OutfitKind) -> &'static str {
    outfit.name()
}

impl Suite {
    /// Everybody, everything: 120 losses.
    pub(crate) fn full() -> Self {
        let movements = Routine::ALL
            .into_iter()
            .filter(|routine| !matches!(routine, Routine::Mixture | Routine::Stand));
        Self {
            people: TEST_PEOPLE.to_vec(),
            sensors: vec![SensorPreset::Azure, SensorPreset::D435],
            outfits: vec![
                OutfitKind::CloseFitting,
                OutfitKind::Demo,
                OutfitKind::Sport,
                OutfitKind::Loose,
            ],
            motions: movements.collect(),
            most_secs: 8.0,
            stand_secs: 7.0,
            losses: 5,
        }
    }

    /// One person, two outfits, the beginning of each movement: some two minutes on two cores.
    pub(crate) fn quick() -> Self {
        Self {
            people: TEST_PEOPLE[..1].to_vec(),
            outfits: vec![OutfitKind::CloseFitting, OutfitKind::Loose],
            most_secs: 2.5,
            stand_secs: 3.5,
            losses: 2,
            ..Self::full()
        }
    }

    /// Every person in every outfit before every sensor, doing everything.
    pub(crate) fn cases(&self) -> Vec<Case> {
        let mut cases = Vec::new();
        for &sensor in &self.sensors {
            for &outfit in &self.outfits {
                for &seed in &self.people {
                    let scenario = Scenario { seed, sensor, outfit, ..Scenario::default() };
                    self.perform(&scenario, &mut cases);
                }
            }
        }
        cases
    }

    /// One person's movements, a stand, and losses.
    fn perform(&self, scenario: &Scenario, cases: &mut Vec<Case>) {
        let case = |routine: Routine, seconds: f32, purpose: Purpose| Case {
            suite: "people",
            scenario: Scenario {
                motion: MotionChoice::Routine(routine),
                seconds,
                ..scenario.clone()
            },
            purpose,
        };
        for &routine in &self.motions {
            cases.push(case(routine, self.most_secs, Purpose::Accuracy));
        }
        if self.stand_secs > 0.0 {
            cases.push(case(Routine::Stand, self.stand_secs, Purpose::Stillness));
        }
        if self.losses > 0 {
            let purpose = Purpose::Losses(self.losses);
            cases.push(case(Routine::Mixture, LOSS_SECS, purpose));
        }
    }
}
