//! Who is followed, doing what, seen by which sensor.

use std::path::PathBuf;

use effigy_registration::motion::Routine;
use effigy_sim_sensor::{MotionChoice, Mount, OutfitKind, Scenario, SensorPreset, StrangerChoice};

/// The people of the test split: nothing was ever tuned on them. Settings are tuned on 104 to 106.
const TEST_PEOPLE: [u64; 3] = [101, 102, 103];

/// The sensor stands 2 m before the person, where a D435 just sees raised hands.
const MOUNT: Mount = Mount { height_m: 1.1, distance_m: 2.0, down_rad: 0.0 };

/// Strangers are watched for as long as this.
const STRANGER_SECS: f32 = 5.0;
/// Of movement that losses interrupt; it repeats.
const LOSS_SECS: f32 = 20.0;

/// Seen from the repository.
pub(super) const DATA: &str = "../shared/data";
/// Characters that know nothing of SMPL: whose they are, and their files. Nothing was ever tuned on them.
const STRANGERS: [(&str, &[&str]); 2] = [
    (
        "rocketbox",
        &[
            "rocketbox/glb/Male_Adult_01.glb",
            "rocketbox/glb/Female_Adult_05.glb",
        ],
    ),
    (
        "quaternius",
        &[
            "quaternius-animated/Smooth_Male_Casual.glb",
            "quaternius-animated/Smooth_Female_Casual.glb",
        ],
    ),
];
/// What strangers do: recorded people, and clips that some files bring along.
const STRANGERS_BVH: [&str; 3] = [
    "mocap-cmu/02_01_walk.bvh",
    "mocap-cmu/jumping_jacks.bvh",
    "mocap-animated-drawings/wave_hello.bvh",
];
const STRANGERS_CLIPS: [(&str, &[&str]); 2] = [
    ("Smooth_Male", &["Man_Walk", "Man_Clapping"]),
    ("Smooth_Female", &["Female_Walk", "Female_Punch"]),
];

/// Who and what is evaluated.
#[derive(Clone, Debug)]
pub(crate) struct Suite {
    pub(crate) people: Vec<u64>,
    pub(crate) sensors: Vec<SensorPreset>,
    pub(crate) outfits: Vec<OutfitKind>,
    /// Simulated clothes, which take their time: in these nobody is lost and nobody stands still.
    pub(crate) in_cloth: Vec<OutfitKind>,
    pub(crate) motions: Vec<Routine>,
    /// Movements are cut after this.
    pub(crate) most_secs: f32,
    pub(crate) most_secs_in_cloth: f32,
    /// Long enough for the shape to settle and for jitter to be measured after it; 0 for no stand.
    pub(crate) stand_secs: f32,
    /// Losses of each person in each outfit before each sensor.
    pub(crate) losses: usize,
    /// Where the data sets are that strangers and their movements come from.
    pub(crate) data: PathBuf,
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
        let Scenario { sensor, seed, .. } = &self.scenario;
        format!(
            "{} {} {} person {seed}",
            sensor.name(),
            self.wears(),
            self.motion_name()
        )
    }

    /// The outfit, or whose character it is.
    pub(crate) fn wears(&self) -> &'static str {
        match &self.scenario.stranger {
            None => self.scenario.outfit.name(),
            Some(stranger) => {
                let named = |name: &&&str| stranger.path.to_string_lossy().contains(**name);
                STRANGERS
                    .iter()
                    .map(|(name, _)| name)
                    .find(named)
                    .unwrap_or(&"stranger")
            }
        }
    }

    pub(crate) fn motion_name(&self) -> String {
        match (&self.scenario.motion, self.purpose) {
            (_, Purpose::Losses(_)) => "losses".to_owned(),
            _ if self.clip().is_some() => self.clip().unwrap_or_default().to_owned(),
            (MotionChoice::Routine(routine), _) => routine.name().to_owned(),
            (MotionChoice::Bvh(path) | MotionChoice::File(path), _) => path
                .file_stem()
                .map_or_else(String::new, |stem| stem.to_string_lossy().into_owned()),
        }
    }

    /// Whether it shows the same simulated clothes, by another sensor.
    pub(super) fn shares_clothes_with(&self, other: &Self) -> bool {
        let seen_alike = || {
            Scenario { sensor: other.scenario.sensor, ..self.scenario.clone() } == other.scenario
        };
        self.scenario.outfit.cloth().is_some() && self.purpose == other.purpose && seen_alike()
    }

    fn clip(&self) -> Option<&str> {
        self.scenario.stranger.as_ref()?.clip.as_deref()
    }
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
            in_cloth: vec![
                OutfitKind::TshirtTrousers,
                OutfitKind::LongsleeveWideTrousers,
                OutfitKind::HoodieTrousers,
                OutfitKind::Skirt,
            ],
            motions: movements.collect(),
            most_secs: 8.0,
            most_secs_in_cloth: 4.0,
            stand_secs: 7.0,
            losses: 5,
            data: PathBuf::from(DATA),
        }
    }

    /// One person, two outfits, the beginning of each movement: some two minutes on two cores.
    pub(crate) fn quick() -> Self {
        Self {
            people: TEST_PEOPLE[..1].to_vec(),
            outfits: vec![OutfitKind::CloseFitting, OutfitKind::Loose],
            in_cloth: Vec::new(),
            most_secs: 2.5,
            stand_secs: 3.5,
            losses: 2,
            ..Self::full()
        }
    }

    /// Every person in every outfit before every sensor, doing everything; then strangers.
    pub(crate) fn cases(&self) -> Vec<Case> {
        let mut cases = Vec::new();
        for &sensor in &self.sensors {
            for &outfit in self.outfits.iter().chain(&self.in_cloth) {
                for &seed in &self.people {
                    let scenario = Scenario {
                        seed,
                        sensor,
                        outfit,
                        mount: Some(MOUNT),
                        ..Scenario::default()
                    };
                    self.perform(&scenario, &mut cases);
                }
            }
        }
        // Whoever tunes on other people has no business with strangers.
        if self
            .people
            .iter()
            .all(|person| TEST_PEOPLE.contains(person))
        {
            self.strangers(&mut cases);
        }
        cases
    }

    /// Characters of other makers, moved by recordings and by clips of their own; none without the data sets.
    fn strangers(&self, cases: &mut Vec<Case>) {
        for &sensor in &self.sensors {
            for (_, files) in STRANGERS {
                for file in files
                    .iter()
                    .map(|file| self.data.join(file))
                    .filter(|file| file.exists())
                {
                    let mut case = |motion: MotionChoice, clip: Option<&str>| {
                        let clip = clip.map(str::to_owned);
                        let stranger = StrangerChoice { path: file.clone(), clip, height_m: None };
                        let scenario = Scenario {
                            sensor,
                            mount: Some(MOUNT),
                            motion,
                            seconds: self.most_secs.min(STRANGER_SECS),
                            stranger: Some(stranger),
                            ..Scenario::default()
                        };
                        cases.push(Case {
                            suite: "strangers",
                            scenario,
                            purpose: Purpose::Accuracy,
                        });
                    };
                    for bvh in STRANGERS_BVH.map(|bvh| self.data.join(bvh)) {
                        case(MotionChoice::Bvh(bvh), None);
                    }
                    let name = file.to_string_lossy();
                    let own = STRANGERS_CLIPS
                        .iter()
                        .find(|(start, _)| name.contains(start));
                    for clip in own.iter().flat_map(|(_, clips)| *clips) {
                        case(MotionChoice::Routine(Routine::Stand), Some(*clip));
                    }
                }
            }
        }
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
        let in_cloth = scenario.outfit.cloth().is_some();
        let most_secs = if in_cloth {
            self.most_secs.min(self.most_secs_in_cloth)
        } else {
            self.most_secs
        };
        for &routine in &self.motions {
            cases.push(case(routine, most_secs, Purpose::Accuracy));
        }
        if in_cloth {
            return;
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
