//! One test person in one outfit: frames to learn from, and frames to be judged on.

use std::{f32::consts::FRAC_PI_4, sync::Arc};

use effigy_avatar::metrics::measured_vertices;
use effigy_capture::{
    Calibration, CameraModel, Distortion, Frame, FrameId, Rigid3, SensorModel, Timestamp,
};
use effigy_fusion::{TriangleMesh, clean::Cleaner};
use effigy_registration::{BodyParams, RegisteredFrame, Tracking};
use effigy_sim_sensor::dataset::{Dataset, Role, Sequence, SequenceEntry, Split, protocol_camera};

use crate::pipeline::{evaluate::evenly_placed, settings::Settings};

/// What a test frame tests.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
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
    pub(super) camera: CameraModel,
    pub(super) keyframes: Vec<RegisteredFrame>,
    pub(super) tests: Vec<TestFrame>,
}

pub(super) struct TestFrame {
    pub(super) task: Task,
    pub(super) params: BodyParams,
    pub(super) truth: TriangleMesh,
    pub(super) truth_in_star: TriangleMesh,
    /// Which truth vertices count (MetaAvatar's mask).
    pub(super) measured: Vec<bool>,
}

/// The sequences of each test person in each outfit.
pub(super) fn test_people(dataset: &Dataset) -> Vec<Vec<SequenceEntry>> {
    let mut people: Vec<Vec<SequenceEntry>> = Vec::new();
    let tests = dataset.manifest().sequences.iter();
    for entry in tests.filter(|entry| entry.plan.split == Split::Test) {
        let same = |people: &&mut Vec<SequenceEntry>| {
            let plan = &people[0].plan;
            (plan.subject, plan.outfit) == (entry.plan.subject, entry.plan.outfit)
        };
        match people.iter_mut().find(same) {
            Some(person) => person.push(entry.clone()),
            None => people.push(vec![entry.clone()]),
        }
    }
    people
}

impl Subject {
    /// `keyframes` single views, each an eighth of a turn further on (seed paper, section 4.1), spread over the
    /// actions; `tests` frames for each task, spread over what is left.
    pub(super) fn load(
        dataset: &Dataset,
        entries: &[SequenceEntry],
        (keyframes, tests): (usize, usize),
        settings: &Settings,
    ) -> anyhow::Result<Self> {
        let plan = &entries[0].plan;
        let loaded = |role: Role| -> anyhow::Result<Vec<Sequence>> {
            let of_role = entries.iter().filter(|entry| entry.plan.role == role);
            of_role.map(|entry| Ok(dataset.load(entry)?)).collect()
        };
        let (learned, held_out) = (loaded(Role::FineTune)?, loaded(Role::Extrapolation)?);
        let (chosen, left) = spread(&all_frames(&learned), keyframes);
        let calibration = protocol_calibration();
        let mut cleaner = Cleaner::new(calibration.clone(), settings.clean.clone());
        let keyframes = chosen
            .iter()
            .enumerate()
            .map(|(number, &(sequence, frame))| {
                let yaw_rad = (number + 1) as f32 * FRAC_PI_4;
                seen(&learned[sequence], (frame, yaw_rad), number, &mut cleaner)
            })
            .collect::<anyhow::Result<_>>()?;
        let of = |task, sequences: &[Sequence], frames: &[(usize, usize)]| -> Vec<TestFrame> {
            let (chosen, _) = spread(frames, tests);
            chosen
                .iter()
                .map(|&(s, f)| TestFrame::new(task, &sequences[s], f))
                .collect()
        };
        let mut tests = of(Task::Interpolation, &learned, &left);
        tests.extend(of(Task::Extrapolation, &held_out, &all_frames(&held_out)));
        Ok(Self {
            name: format!("{:03}-{}", plan.subject, plan.outfit.name()),
            outfit: plan.outfit.name().to_owned(),
            camera: calibration.depth,
            keyframes,
            tests,
        })
    }
}

impl TestFrame {
    fn new(task: Task, sequence: &Sequence, frame: usize) -> Self {
        let truth = sequence.posed_mesh(frame);
        Self {
            task,
            params: sequence.params(frame),
            measured: measured_vertices(&sequence.weights, &truth.triangles),
            truth_in_star: sequence.star_mesh(frame),
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

/// A frame as the protocol's camera sees it, with the true pose.
pub(crate) fn seen(
    sequence: &Sequence,
    (frame, yaw_rad): (usize, f32),
    number: usize,
    cleaner: &mut Cleaner,
) -> anyhow::Result<RegisteredFrame> {
    let (depth, world_from_camera) = sequence.protocol_depth(frame, yaw_rad);
    let exposure = Frame {
        id: FrameId(number as u64),
        timestamp: Timestamp::from_secs_f64(number as f64),
        depth: Arc::new(depth),
        color: None,
    };
    let tracking = Tracking::Tracked {
        params: sequence.params(frame),
        residual_rms_m: 0.0,
        joint_confidence: [1.0; 24],
    };
    let clean = Arc::new(cleaner.process(&exposure)?);
    Ok(RegisteredFrame { clean, world_from_camera, tracking })
}

pub(crate) fn protocol_calibration() -> Calibration {
    let (intrinsics, _) = protocol_camera();
    Calibration {
        sensor_name: "MetaAvatar's protocol".to_owned(),
        depth: CameraModel { intrinsics, distortion: Distortion::None },
        color: None,
        color_from_depth: Rigid3::IDENTITY,
        metres_per_unit: 1e-3,
        range_m: [1.0, 10.0],
        rate_hz: 30.0,
        // No noise but the millimetres' own.
        sensor: SensorModel::TimeOfFlight { floor_m: 3e-4, slope: 0.0 },
        world_from_camera: None,
    }
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
