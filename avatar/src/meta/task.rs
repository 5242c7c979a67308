//! What meta-learning learns from: people, each in a number of poses.

use glam::Vec3;

use crate::{PoseInput, fine_tune::sampling::KeyframePoints};

/// One clothed person.
#[derive(Clone, Debug)]
pub struct Person {
    pub frames: Vec<PersonFrame>,
}

/// A person's whole clothed surface in one pose, canonicalised, in unit space.
#[derive(Clone, Debug)]
pub struct PersonFrame {
    pub pose: PoseInput,
    pub points_in_unit: Vec<Vec3>,
    /// Unit normals, outwards.
    pub normals: Vec<Vec3>,
}

/// Makes people: the same number gives the same person, and the same frame number the same pose of theirs.
pub trait PersonSource: Sync {
    fn person(&self, number: u64, frames: usize) -> Person;
}

impl<F: Fn(u64, usize) -> Person + Sync> PersonSource for F {
    fn person(&self, number: u64, frames: usize) -> Person {
        self(number, frames)
    }
}

/// A person's frames, ready to be drawn from.
pub(super) struct Prepared {
    pub(super) poses: Vec<PoseInput>,
    pub(super) points: Vec<KeyframePoints>,
}

impl Prepared {
    pub(super) fn new(person: Person) -> Self {
        let poses = person.frames.iter().map(|frame| frame.pose).collect();
        let points = person
            .frames
            .into_iter()
            .map(|frame| KeyframePoints::whole(&frame.points_in_unit, &frame.normals))
            .collect();
        Self { poses, points }
    }
}
