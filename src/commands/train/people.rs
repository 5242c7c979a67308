//! The people that a prior is learned from: those of a data set, and simpler ones made as they are asked for.

use std::sync::Arc;

use anyhow::Context as _;
use effigy_avatar::{
    Canonicaliser, Subject,
    canonicalise::CanonicaliseConfig,
    meta::{Person, PersonFrame, PersonSource},
};
use effigy_fusion::{TriangleMesh, mesh::sample::sample_surface};
use effigy_registration::{BodyModel, smpl::JOINT_COUNT};
use effigy_sim_sensor::{
    dataset::{Dataset, Sequence, SequenceEntry},
    population,
};
use glam::Vec3;
use rayon::prelude::*;

/// Points kept of each surface in cloth; all of them stay in memory.
const CLOTH_POINTS: usize = 2500;

/// Points of a surface that is made when it is asked for.
const OFFSET_POINTS: usize = 4000;

/// A person's surfaces, and who they are in numbers.
struct Learned {
    subject: Subject,
    frames: Vec<LearnedFrame>,
}

pub(super) struct LearnedFrame {
    theta: [Vec3; JOINT_COUNT],
    /// In unit space, with unit normals.
    points: Vec<(Vec3, Vec3)>,
}

/// Training people of a data set, each as they are and as their mirror image.
pub(super) struct ClothPeople {
    people: Vec<Learned>,
}

impl ClothPeople {
    /// `people`: everything that each of them does, of which every `every`th frame is looked at.
    pub(super) fn load(
        dataset: &Dataset,
        people: &[Vec<&SequenceEntry>],
        body: &Arc<BodyModel>,
        canonicalise: &CanonicaliseConfig,
        every: usize,
    ) -> anyhow::Result<Self> {
        let people = people
            .par_iter()
            .map(|entries| learned(dataset, entries, body, canonicalise, every))
            .collect::<anyhow::Result<_>>()?;
        Ok(Self { people })
    }

    /// People, mirror images included.
    pub(super) fn count(&self) -> usize {
        2 * self.people.len()
    }
}

fn learned(
    dataset: &Dataset,
    entries: &[&SequenceEntry],
    body: &Arc<BodyModel>,
    config: &CanonicaliseConfig,
    every: usize,
) -> anyhow::Result<Learned> {
    let mut frames = Vec::new();
    let mut subject = None;
    for entry in entries {
        let sequence = dataset.load(entry)?;
        let canonicaliser = Canonicaliser::new(Arc::clone(body), &sequence.betas, config.clone())?;
        let numbers = (0..sequence.frames.len()).step_by(every);
        frames.extend(numbers.map(|frame| frame_of(&sequence, frame, &canonicaliser)));
        subject = Some(*canonicaliser.subject());
    }
    let subject = subject.context("a person without sequences")?;
    Ok(Learned { subject, frames })
}

/// A frame's whole surface, brought to canonical space as keyframes are: what the pose does to that is part of what
/// is to be learned.
pub(super) fn frame_of(
    sequence: &Sequence,
    frame: usize,
    canonicaliser: &Canonicaliser,
) -> LearnedFrame {
    let surface = sample_surface(&sequence.posed_mesh(frame), CLOTH_POINTS, frame as u64);
    let (samples, _) = canonicaliser.process_surface(&sequence.params(frame), &surface);
    LearnedFrame {
        theta: samples.theta,
        points: samples
            .points_in_unit
            .into_iter()
            .zip(samples.normals)
            .collect(),
    }
}

fn points_of(
    star: &TriangleMesh,
    subject: &Subject,
    (count, seed): (usize, u64),
) -> Vec<(Vec3, Vec3)> {
    sample_surface(star, count, seed)
        .iter()
        .map(|sample| {
            (
                subject.unit_box.unit_from_canonical(sample.point),
                sample.normal,
            )
        })
        .collect()
}

impl PersonSource for ClothPeople {
    fn person(&self, number: u64, frames: usize) -> Person {
        let drawn = number / 2;
        let (who, round) = (drawn % self.count() as u64, drawn / self.count() as u64);
        let person = &self.people[who as usize / 2];
        let is_mirrored = who % 2 == 1;
        let all = person.frames.len();
        // A few frames start somewhere else each time; all frames are all there are.
        let start = if frames < all {
            (round.wrapping_mul(7919) % all as u64) as usize
        } else {
            0
        };
        let taken = frames.min(all);
        let frame = |index: usize| {
            let frame = &person.frames[(start + index * all / taken) % all];
            let frame = as_is(frame, &person.subject);
            // The body model is the same on both sides.
            if is_mirrored { frame.mirrored() } else { frame }
        };
        Person { frames: (0..taken).map(frame).collect() }
    }
}

pub(super) fn as_is(frame: &LearnedFrame, subject: &Subject) -> PersonFrame {
    PersonFrame {
        pose: subject.pose_input(&frame.theta),
        points_in_unit: frame.points.iter().map(|(point, _)| *point).collect(),
        normals: frame.points.iter().map(|(_, normal)| *normal).collect(),
    }
}

/// People in clothes that are offsets of their skin, made when they are asked for.
pub(super) struct OffsetPeople {
    pub(super) body: Arc<BodyModel>,
    pub(super) seed: u64,
}

impl PersonSource for OffsetPeople {
    fn person(&self, number: u64, frames: usize) -> Person {
        let simulated =
            population::person(Arc::clone(&self.body), self.seed, number as usize, frames);
        let subject = Subject::new(&self.body, &simulated.person.betas)
            .expect("the built-in body has vertices in every shape");
        let frame = |(index, sample): (usize, &population::PopulationSample)| {
            let seed = number * 1000 + index as u64;
            let points = points_of(&sample.clothed_canonical, &subject, (OFFSET_POINTS, seed));
            as_is(&LearnedFrame { theta: sample.theta, points }, &subject)
        };
        Person { frames: simulated.samples.iter().enumerate().map(frame).collect() }
    }
}

/// Everybody that a prior is learned from.
pub(super) struct People {
    pub(super) cloth: Option<ClothPeople>,
    pub(super) offsets: OffsetPeople,
    /// Of this many people in a row one is an [`OffsetPeople`]'s; 0 for none.
    pub(super) one_in: u64,
    /// In words.
    pub(super) described: String,
}

impl People {
    /// So many that everybody in cloth is among them; of those in simpler clothes there is no end.
    pub(super) fn count(&self) -> usize {
        const SIMPLER: usize = 200;
        let in_cloth = self.cloth.as_ref().map_or(0, ClothPeople::count);
        let one_in = self.one_in as usize;
        match (in_cloth, one_in) {
            (0, _) | (_, 1) => SIMPLER,
            (_, 0) => in_cloth,
            _ => (in_cloth * one_in).div_ceil(one_in - 1),
        }
    }
}

impl PersonSource for People {
    fn person(&self, number: u64, frames: usize) -> Person {
        let drawn = number / 2;
        match &self.cloth {
            Some(cloth) if self.one_in == 0 => cloth.person(number, frames),
            Some(cloth) if !drawn.is_multiple_of(self.one_in) => {
                cloth.person(2 * (drawn - drawn / self.one_in - 1), frames)
            }
            _ => self.offsets.person(number, frames),
        }
    }
}
