//! One test person in one outfit: frames to learn from, and frames to be judged on.

use std::f32::consts::FRAC_PI_4;

use effigy_avatar::metrics::measured_vertices;
use effigy_fusion::TriangleMesh;
use effigy_registration::BodyParams;
use effigy_sim_sensor::{
    OutfitKind,
    dataset::{Dataset, Role, Sequence, SequenceEntry, Split},
};

use super::plan::Data;
use crate::pipeline::evaluate::evenly_placed;

/// What a test frame tests.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Task {
    /// An action of which other frames were learned from.
    Interpolation,
    /// An action that was not.
    Extrapolation,
}

/// A person in an outfit; spaces: the data set's world.
pub(super) struct Subject {
    pub(super) name: String,
    pub(super) outfit: String,
    /// What the data set knows of it.
    pub(super) history_floor_cm: Option<f64>,
    sequences: Vec<Sequence>,
    /// Sequence and frame of what may be learned from: all frames but those that are judged.
    teaching: Vec<(usize, usize)>,
    pub(super) tests: Vec<TestFrame>,
}

pub(super) struct TestFrame {
    pub(super) task: Task,
    pub(super) params: BodyParams,
    pub(super) truth: TriangleMesh,
    /// Which truth vertices count (MetaAvatar's mask).
    pub(super) measured: Vec<bool>,
}

/// A frame to learn from and the side it is seen from.
#[derive(Clone, Copy)]
pub(crate) struct Lesson<'a> {
    pub(crate) sequence: &'a Sequence,
    pub(crate) frame: usize,
    pub(crate) yaw_rad: f32,
}

/// The sequences of one test person in one outfit.
pub(super) type Entries = Vec<SequenceEntry>;

/// Of whom the tables are made, where the data set has them: clothes that fit closely, loose ones, one that no prior
/// learns from, and a skirt; four different people.
const IN_THE_TABLES: [OutfitKind; 4] = [
    OutfitKind::LongsleeveTrousers,
    OutfitKind::LongsleeveWideTrousers,
    OutfitKind::BlazerTrousers,
    OutfitKind::Skirt,
];

/// Test people in outfits: the four of the tables, or all of them.
pub(super) fn chosen(dataset: &Dataset, all: bool) -> Vec<Entries> {
    let wearers = dataset.manifest().wearers(Split::Test).into_iter();
    let mut people: Vec<Entries> = wearers
        .map(|entries| entries.into_iter().cloned().collect())
        .collect();
    if all {
        return people;
    }
    let named: Vec<Entries> = IN_THE_TABLES
        .iter()
        .filter_map(|outfit| {
            people
                .iter()
                .find(|entries| entries[0].plan.outfit == *outfit)
        })
        .cloned()
        .collect();
    if named.is_empty() {
        people.truncate(IN_THE_TABLES.len());
        return people;
    }
    named
}

/// A person in an outfit as tables name them.
pub(super) fn name(entries: &[SequenceEntry]) -> String {
    let plan = &entries[0].plan;
    format!("{:03}-{}", plan.subject, plan.outfit.name())
}

impl Subject {
    /// With `tests` frames for each task, spread over all actions; those of interpolation are taken out of what may
    /// be learned from.
    pub(super) fn load(
        dataset: &Dataset,
        entries: &[SequenceEntry],
        tests: usize,
    ) -> anyhow::Result<Self> {
        let plan = &entries[0].plan;
        let loaded = |role: Role| -> anyhow::Result<Vec<Sequence>> {
            let of_role = entries.iter().filter(|entry| entry.plan.role == role);
            of_role.map(|entry| Ok(dataset.load(entry)?)).collect()
        };
        let (sequences, held_out) = (loaded(Role::FineTune)?, loaded(Role::Extrapolation)?);
        let (judged, teaching) = spread(&all_frames(&sequences), tests);
        let (extrapolated, _) = spread(&all_frames(&held_out), tests);
        let of = |task, sequences: &[Sequence], frames: &[(usize, usize)]| -> Vec<TestFrame> {
            let frames = frames.iter();
            frames
                .map(|&(s, f)| TestFrame::new(task, &sequences[s], f))
                .collect()
        };
        let mut tests = of(Task::Interpolation, &sequences, &judged);
        tests.extend(of(Task::Extrapolation, &held_out, &extrapolated));
        Ok(Self {
            name: name(entries),
            outfit: plan.outfit.name().to_owned(),
            history_floor_cm: dataset
                .manifest()
                .history_floor_cm(Split::Test, plan.subject, plan.outfit)
                .map(f64::from),
            sequences,
            teaching,
            tests,
        })
    }

    /// Frames spread over the actions, each seen from an eighth of a turn further on (seed paper, section 4.1); at most
    /// `few` where few are asked for.
    pub(super) fn lessons(&self, data: Data, few: usize) -> Vec<Lesson<'_>> {
        let count = match data {
            Data::Few => few,
            Data::Percent(percent) => (self.teaching.len() * percent).div_ceil(100),
        };
        let (taken, _) = spread(&self.teaching, count);
        let lessons = taken.into_iter().enumerate();
        lessons
            .map(|(number, (sequence, frame))| Lesson {
                sequence: &self.sequences[sequence],
                frame,
                yaw_rad: (number + 1) as f32 * FRAC_PI_4,
            })
            .collect()
    }
}

impl TestFrame {
    fn new(task: Task, sequence: &Sequence, frame: usize) -> Self {
        let truth = sequence.posed_mesh(frame);
        Self {
            task,
            params: sequence.params(frame),
            measured: measured_vertices(&sequence.weights, &truth.triangles),
            truth,
        }
    }
}

/// Sequence and frame of all frames.
fn all_frames(sequences: &[Sequence]) -> Vec<(usize, usize)> {
    let of = |(s, sequence): (usize, &Sequence)| (0..sequence.frames.len()).map(move |f| (s, f));
    sequences.iter().enumerate().flat_map(of).collect()
}

/// `count` items evenly spread, and the others.
fn spread<T: Copy>(items: &[T], count: usize) -> (Vec<T>, Vec<T>) {
    let places = evenly_placed(items.len(), count);
    let (taken, left): (Vec<_>, Vec<_>) = items
        .iter()
        .enumerate()
        .partition(|(place, _)| places.binary_search(place).is_ok());
    let values = |pairs: Vec<(usize, &T)>| pairs.into_iter().map(|(_, &value)| value).collect();
    (values(taken), values(left))
}

#[cfg(test)]
mod tests {
    use super::spread;

    #[test]
    fn frames_are_spread_and_none_is_both_learned_from_and_judged() {
        let (chosen, left) = spread(&(0..240).collect::<Vec<_>>(), 8);
        assert_eq!(chosen, [15, 45, 75, 105, 135, 165, 195, 225]);
        assert_eq!(left.len(), 232);
        assert!(chosen.iter().all(|frame| !left.contains(frame)));
        let (all, none) = spread(&[1, 2, 3], 8);
        assert_eq!((all, none), (vec![1, 2, 3], vec![]));
    }
}
