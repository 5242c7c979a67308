//! Biovision hierarchy (BVH) files: a skeleton with rotations and positions for each frame.
//!
//! The reader is bounded: a file may not make it allocate more than the limits below allow, whatever its
//! header claims.

use std::path::Path;

use glam::{Quat, Vec3};

use super::{Motion, RestBody, file, retarget};
use crate::error::RegistrationError;

mod parse;
#[cfg(test)]
mod tests;

pub const MAX_JOINTS: usize = 512;

/// A skeleton and what it does, in the file's own units and axes.
#[derive(Clone, Debug)]
pub struct BvhClip {
    /// Parents come before their children; end sites are left out.
    pub joints: Vec<BvhJoint>,
    pub frame_secs: f32,
    /// `frames[f][c]`: one number a channel, in file order; degrees for rotations.
    pub frames: Vec<Vec<f32>>,
}

#[derive(Clone, Debug)]
pub struct BvhJoint {
    pub name: String,
    pub parent: Option<usize>,
    pub offset: Vec3,
    pub channels: Vec<Channel>,
    /// Where the joint's numbers begin in a frame.
    pub first_channel: usize,
    /// The offset of the end site, for the last joint of a chain.
    pub end_site: Option<Vec3>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Channel {
    PositionX,
    PositionY,
    PositionZ,
    RotationX,
    RotationY,
    RotationZ,
}

impl BvhClip {
    pub fn read(path: &Path) -> Result<Self, RegistrationError> {
        let text = file::read_text(path)?;
        parse::parse(path, &text)
    }

    /// Rotation and position of every joint in one frame, in the space of the file.
    pub fn global_pose(&self, frame: usize) -> Vec<(Quat, Vec3)> {
        let numbers = &self.frames[frame];
        let mut poses: Vec<(Quat, Vec3)> = Vec::with_capacity(self.joints.len());
        for joint in &self.joints {
            let (rotation, position) = joint.local_pose(numbers);
            let pose = match joint.parent {
                None => (rotation, position),
                Some(parent) => {
                    let (parent_rotation, parent_position) = poses[parent];
                    (
                        parent_rotation * rotation,
                        parent_position + parent_rotation * position,
                    )
                }
            };
            poses.push(pose);
        }
        poses
    }

    /// Positions of all joints with every rotation zero.
    pub fn rest_positions(&self) -> Vec<Vec3> {
        let mut positions: Vec<Vec3> = Vec::with_capacity(self.joints.len());
        for joint in &self.joints {
            let parent = joint.parent.map_or(Vec3::ZERO, |parent| positions[parent]);
            positions.push(parent + joint.offset);
        }
        positions
    }
}

impl retarget::Clip for BvhClip {
    fn names(&self) -> Vec<&str> {
        self.joints
            .iter()
            .map(|joint| joint.name.as_str())
            .collect()
    }

    fn parents(&self) -> Vec<Option<usize>> {
        self.joints.iter().map(|joint| joint.parent).collect()
    }

    fn frame_count(&self) -> usize {
        self.frames.len()
    }

    fn frame_secs(&self) -> f32 {
        self.frame_secs
    }

    fn rest_positions(&self) -> Vec<Vec3> {
        Self::rest_positions(self)
    }

    fn global_pose(&self, frame: usize) -> Vec<(Quat, Vec3)> {
        Self::global_pose(self, frame)
    }
}

impl BvhJoint {
    /// Channels apply in the order of the file, each about the axes left by those before it.
    fn local_pose(&self, numbers: &[f32]) -> (Quat, Vec3) {
        let mut rotation = Quat::IDENTITY;
        let mut position = self.offset;
        let values = &numbers[self.first_channel..self.first_channel + self.channels.len()];
        for (channel, &value) in self.channels.iter().zip(values) {
            let radians = value.to_radians();
            match channel {
                Channel::PositionX => position.x = value,
                Channel::PositionY => position.y = value,
                Channel::PositionZ => position.z = value,
                Channel::RotationX => rotation *= Quat::from_rotation_x(radians),
                Channel::RotationY => rotation *= Quat::from_rotation_y(radians),
                Channel::RotationZ => rotation *= Quat::from_rotation_z(radians),
            }
        }
        (rotation, position)
    }
}

impl Motion {
    /// Reads a BVH file and moves its motion onto SMPL's joints: metres, y up, feet on the floor.
    ///
    /// `rest` is the body that will perform it; steps are scaled by the ratio of leg lengths, whatever the
    /// file's unit. Heading and place are the file's; see [`Self::starting_at_origin`] and [`Self::in_place`].
    pub fn from_bvh(path: &Path, rest: &RestBody) -> Result<Self, RegistrationError> {
        let clip = BvhClip::read(path)?;
        retarget::onto_smpl(path, &clip, rest)
    }
}
