//! What meta-learning learns from: people, each in a number of poses.

use glam::Vec3;

use crate::{PoseInput, fine_tune::sampling::KeyframePoints, pose_input::across};

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

impl PersonFrame {
    /// Left is right and right is left.
    #[must_use]
    pub fn mirrored(&self) -> Self {
        let midplane = self.pose.midplane();
        let points = self.points_in_unit.iter();
        Self {
            pose: self.pose.mirrored(),
            points_in_unit: points.map(|&point| midplane.mirrored(point)).collect(),
            normals: self.normals.iter().map(|&normal| across(normal)).collect(),
        }
    }
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
#[derive(Default)]
pub(super) struct Prepared {
    pub(super) poses: Vec<PoseInput>,
    pub(super) points: Vec<KeyframePoints>,
}

impl Prepared {
    pub(super) fn new(person: &Person) -> Self {
        let mut prepared = Self::default();
        for frame in &person.frames {
            prepared.push(frame);
        }
        prepared
    }

    /// Adds a whole surface.
    pub(super) fn push(&mut self, frame: &PersonFrame) {
        let points = KeyframePoints::whole(&frame.points_in_unit, &frame.normals);
        self.poses.push(frame.pose);
        self.points.push(points);
    }
}
