//! Who is in a data set, what they wear and do.

use std::ops::Range;

use effigy_registration::motion::Routine;
use serde::{Deserialize, Serialize};

use super::outfit_name::OutfitName;
use crate::{
    person::OutfitKind,
    random::Randomness,
    scenario::{Likeness, MotionChoice, Noise, Scenario},
};

/// What a data set is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum DatasetPreset {
    /// To learn a prior from: many people, few frames each.
    Prior,
    /// To learn from what poses do to clothes: more people, more than half of them in two actions, all in whatever limbs can do.
    PriorActions,
    /// In the manner of CAPE: ten people to learn from, four to fine-tune and test on, actions split as in MetaAvatar.
    CapeLike,
    /// To choose settings by: four people whom neither training nor the tests ever meet.
    Dev,
    /// A miniature for tests.
    Small,
    /// Real CAPE, which is imported, not made.
    Cape,
}

/// Whether training may see a person.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Split {
    Train,
    Test,
}

impl Split {
    pub fn name(self) -> &'static str {
        match self {
            Self::Train => "train",
            Self::Test => "test",
        }
    }
}

/// What a test person's sequence is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Role {
    /// Fine-tuning draws its frames here; what it leaves tests interpolation.
    FineTune,
    /// Tests extrapolation: no frame of the action is learned from.
    Extrapolation,
}

/// One person in one outfit doing one thing.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SequencePlan {
    /// Also the file's name.
    pub name: String,
    pub split: Split,
    pub role: Role,
    pub subject: u32,
    /// An [`OutfitKind`], or what a foreign data set calls it.
    pub outfit: OutfitName,
    pub action: String,
    /// Who, wearing what, doing what; `rate_hz` is the rate of the kept frames. Only of simulated people.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scenario: Option<Scenario>,
    pub frames: u32,
    /// The [`GENERATOR`] that made it; zero for what is not simulated, and for what was made before there was a number.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub generator: u32,
}

/// A data set before it is made.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DatasetPlan {
    pub preset: DatasetPreset,
    pub seed: u64,
    /// Surfaces in star pose are rounded to this.
    pub offset_step_m: f32,
    pub sequences: Vec<SequencePlan>,
}

/// Goes up whenever the same plan comes to other people, movements or clothes: what an earlier one made is made again.
pub const GENERATOR: u32 = 6;

#[expect(
    clippy::trivially_copy_pass_by_ref,
    reason = "serde passes a reference"
)]
fn is_zero(number: &u32) -> bool {
    *number == 0
}

/// Finer than simulated cloth is true; half of it is the largest error of a coordinate.
pub(super) const STEP_M: f32 = 0.25e-3;

/// Kept frames a second: CAPE's 60 Hz, every fifth frame.
pub(super) const KEPT_RATE_HZ: f32 = 12.0;

/// Test people have seeds that no training person can have.
const TEST_SEEDS: u64 = 1 << 40;

/// What people do whom a prior learns from.
const LEARNED_ACTIONS: [Routine; 12] = [
    Routine::Squat,
    Routine::Twist,
    Routine::Punch,
    Routine::ShoulderMill,
    Routine::Hips,
    Routine::WalkInPlace,
    Routine::RaiseArms,
    Routine::Reach,
    Routine::SitDown,
    Routine::ChickenWings,
    Routine::FlyingEagle,
    Routine::Mixture,
];

/// What MetaAvatar's test people do in the frames they are learned from (CAPE 00122 shortlong, with a turn)...
const FINE_TUNE_ACTIONS: [Routine; 6] = [
    Routine::Squat,
    Routine::ChickenWings,
    Routine::TurnAround,
    Routine::Punch,
    Routine::ShoulderMill,
    Routine::Twist,
];

/// ...and what they do in those they are tested on.
const EXTRAPOLATED_ACTIONS: [Routine; 3] =
    [Routine::BallerinaSpin, Routine::SoccerKick, Routine::Bend];

impl DatasetPlan {
    pub fn new(preset: DatasetPreset, seed: u64) -> Self {
        let sequences = match preset {
            DatasetPreset::Prior => learned_from(seed, 0..60, (&[0], 40), 0),
            DatasetPreset::PriorActions => {
                // Whoever does two actions as well costs twice as much, and a freestyle shows more.
                let mut both = learned_from(seed, 0..81, (&[0, 1], 32), FREESTYLE_FRAMES);
                both.extend(learned_from(seed, 81..144, (&[], 0), FREESTYLE_FRAMES));
                both
            }
            DatasetPreset::CapeLike => cape_like(seed),
            DatasetPreset::Dev => dev(seed),
            DatasetPreset::Small => small(seed),
            DatasetPreset::Cape => Vec::new(),
        };
        Self { preset, seed, offset_step_m: STEP_M, sequences }
    }

    /// Leaves out the sequences whose name contains none of these.
    pub fn keep_only(&mut self, parts: &[String]) {
        let wanted = |name: &str| parts.iter().any(|part| name.contains(part));
        self.sequences.retain(|sequence| wanted(&sequence.name));
    }

    pub fn frame_count(&self) -> u64 {
        let frames = self
            .sequences
            .iter()
            .map(|sequence| u64::from(sequence.frames));
        frames.sum()
    }
}

/// Nearly five seconds: nearly four poses of each limb.
const FREESTYLE_FRAMES: u32 = 56;

/// People of all shapes in every outfit of the training split, each of `people` doing the actions that come `apart` after
/// their first, so many frames of each, and then so many of whatever limbs can do.
fn learned_from(
    seed: u64,
    people: Range<u32>,
    (apart, frames): (&[usize], u32),
    freestyle_frames: u32,
) -> Vec<SequencePlan> {
    let outfits = TRAINING_OUTFITS;
    let actions = LEARNED_ACTIONS.len();
    let random = Randomness::new(seed, 0, 0xda7a);
    let shift = (random.uniform(0) * actions as f32) as usize;
    let mut sequences = Vec::new();
    for person in people {
        let (round, number) = (
            person as usize / outfits.len(),
            person as usize % outfits.len(),
        );
        let wearer = Wearer { split: Split::Train, subject: person, outfit: outfits[number] };
        // Each outfit gets another action each time it is worn: 5 and 12 have no common divisor.
        let first = 5 * round + 3 * number + shift;
        let done = apart
            .iter()
            .map(|apart| (LEARNED_ACTIONS[(first + apart) % actions], frames))
            .chain([(Routine::Freestyle, freestyle_frames)])
            .filter(|(_, frames)| *frames > 0);
        for (action, frames) in done {
            sequences.push(sequence(seed, wearer, action, Role::FineTune, frames));
        }
    }
    sequences
}

/// Ten people in two outfits each to learn from; four in two or three to fine-tune and test on.
fn cape_like(seed: u64) -> Vec<SequencePlan> {
    const TRAIN_PEOPLE: u32 = 10;
    const TRAIN_FRAMES: u32 = 40;
    const TEST_FRAMES: u32 = 40;
    let [outfits @ .., _cardigan] = TRAINING_OUTFITS;
    let mut sequences = Vec::new();
    for subject in 0..TRAIN_PEOPLE {
        for k in 0..2 {
            let number = subject as usize * 2 + k;
            let outfit = outfits[number % outfits.len()];
            let action = LEARNED_ACTIONS[(number * 5) % LEARNED_ACTIONS.len()];
            let wearer = Wearer { split: Split::Train, subject, outfit };
            sequences.push(sequence(seed, wearer, action, Role::FineTune, TRAIN_FRAMES));
        }
    }
    for (subject, outfits) in (0..).zip(test_outfits()) {
        for outfit in outfits {
            let wearer = Wearer { split: Split::Test, subject, outfit };
            for action in FINE_TUNE_ACTIONS {
                sequences.push(sequence(seed, wearer, action, Role::FineTune, TEST_FRAMES));
            }
            for action in EXTRAPOLATED_ACTIONS {
                sequences.push(sequence(
                    seed,
                    wearer,
                    action,
                    Role::Extrapolation,
                    TEST_FRAMES,
                ));
            }
        }
    }
    sequences
}

/// People of the test split's kind, but not those of [`cape_like`].
fn dev(seed: u64) -> Vec<SequencePlan> {
    const FIRST_SUBJECT: u32 = 100;
    // Three seconds, nearly as many as the tests' people: in the first second everybody is near the relaxed stance.
    const FRAMES: u32 = 36;
    let outfits = [
        OutfitKind::TshirtTrousers,
        OutfitKind::LongsleeveWideTrousers,
        OutfitKind::Dress,
        OutfitKind::CardiganTrousers,
    ];
    let mut sequences = Vec::new();
    for (subject, outfit) in (FIRST_SUBJECT..).zip(outfits) {
        let wearer = Wearer { split: Split::Test, subject, outfit };
        for action in FINE_TUNE_ACTIONS {
            sequences.push(sequence(seed, wearer, action, Role::FineTune, FRAMES));
        }
        for action in EXTRAPOLATED_ACTIONS {
            sequences.push(sequence(seed, wearer, action, Role::Extrapolation, FRAMES));
        }
    }
    sequences
}

fn small(seed: u64) -> Vec<SequencePlan> {
    let training = Wearer { split: Split::Train, subject: 0, outfit: OutfitKind::TshirtShorts };
    let test = Wearer { split: Split::Test, subject: 0, outfit: OutfitKind::TshirtTrousers };
    vec![
        sequence(seed, training, Routine::Squat, Role::FineTune, 6),
        sequence(seed, test, Routine::Squat, Role::FineTune, 6),
        sequence(seed, test, Routine::RaiseArms, Role::Extrapolation, 6),
    ]
}

/// Every kind of garment but the blazer, which only test people wear. The last one is not worn by [`cape_like`]'s people.
const TRAINING_OUTFITS: [OutfitKind; 9] = [
    OutfitKind::TshirtTrousers,
    OutfitKind::TshirtShorts,
    OutfitKind::LongsleeveTrousers,
    OutfitKind::LongsleeveWideTrousers,
    OutfitKind::PoloTrousers,
    OutfitKind::HoodieTrousers,
    OutfitKind::Skirt,
    OutfitKind::Dress,
    OutfitKind::CardiganTrousers,
];

/// Of each test person.
fn test_outfits() -> [Vec<OutfitKind>; 4] {
    [
        vec![OutfitKind::LongsleeveTrousers, OutfitKind::TshirtShorts],
        vec![
            OutfitKind::PoloTrousers,
            OutfitKind::TshirtTrousers,
            OutfitKind::Skirt,
        ],
        vec![
            OutfitKind::HoodieTrousers,
            OutfitKind::LongsleeveWideTrousers,
        ],
        vec![OutfitKind::BlazerTrousers, OutfitKind::LongsleeveTrousers],
    ]
}

/// Somebody in something.
#[derive(Clone, Copy, Debug)]
struct Wearer {
    split: Split,
    subject: u32,
    outfit: OutfitKind,
}

impl Wearer {
    /// The size: what the tables call close-fitting is; all else is drawn from tight to loose.
    fn fit(self) -> Option<f32> {
        const CLOSE: f32 = 0.1;
        let close = [
            OutfitKind::TshirtTrousers,
            OutfitKind::LongsleeveTrousers,
            OutfitKind::PoloTrousers,
        ];
        (self.split == Split::Test && close.contains(&self.outfit)).then_some(CLOSE)
    }
}

fn sequence(seed: u64, wearer: Wearer, action: Routine, role: Role, frames: u32) -> SequencePlan {
    let Wearer { split, subject, outfit } = wearer;
    let first = match split {
        Split::Train => 0,
        Split::Test => TEST_SEEDS,
    };
    let who = seed
        .wrapping_mul(1_000_003)
        .wrapping_add(first + u64::from(subject));
    let (outfit_name, action_name) = (outfit.name(), action.name());
    SequencePlan {
        name: format!("{}-{subject:03}-{outfit_name}-{action_name}", split.name()),
        split,
        role,
        subject,
        outfit: outfit.into(),
        action: action_name.to_owned(),
        scenario: Some(Scenario {
            seed: who,
            // As real people: the body model does not fit them to the last millimetre.
            likeness: Likeness::Individual,
            motion: MotionChoice::Routine(action),
            outfit,
            fit: wearer.fit(),
            seconds: frames as f32 / KEPT_RATE_HZ,
            rate_hz: Some(KEPT_RATE_HZ),
            noise: Noise::None,
            ..Scenario::default()
        }),
        frames,
        generator: GENERATOR,
    }
}
