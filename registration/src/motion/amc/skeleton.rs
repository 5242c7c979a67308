//! The `.asf` file: bones, how long they are, and about which axes they turn.

use std::path::Path;

use glam::{Quat, Vec3, vec3};

use crate::{error::RegistrationError, motion::bvh::MAX_JOINTS};

/// Bones in an order in which parents come before their children; the root is the first.
#[derive(Clone, Debug)]
pub struct AsfSkeleton {
    pub bones: Vec<AsfBone>,
    /// Numbers a frame.
    pub channel_count: usize,
}

#[derive(Clone, Debug)]
pub struct AsfBone {
    pub name: String,
    pub parent: Option<usize>,
    /// From where it starts to where it ends, at rest.
    pub along: Vec3,
    /// `C`: from the bone's own axes to the skeleton's.
    pub axes: Quat,
    /// What its numbers mean, in their order.
    pub channels: Vec<Axis>,
    pub first_channel: usize,
}

/// A translation along or a rotation about an axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Axis {
    MoveX,
    MoveY,
    MoveZ,
    TurnX,
    TurnY,
    TurnZ,
    /// A change of length, which no body follows.
    Length,
}

impl AsfSkeleton {
    /// Rotation and start of every bone, from their moves and turns relative to their parents.
    pub(super) fn posed(&self, locals: &[(Vec3, Quat)]) -> Vec<(Quat, Vec3)> {
        let mut poses: Vec<(Quat, Vec3)> = Vec::with_capacity(self.bones.len());
        for (bone, &(moved, turned)) in self.bones.iter().zip(locals) {
            poses.push(match bone.parent {
                None => (turned, moved),
                Some(parent) => {
                    let (rotation, start) = poses[parent];
                    (
                        rotation * turned,
                        start + rotation * (self.bones[parent].along + moved),
                    )
                }
            });
        }
        poses
    }
}

impl AsfBone {
    /// How a bone moves and turns relative to its parent.
    pub(super) fn local(&self, numbers: &[f32]) -> (Vec3, Quat) {
        let mut moved = Vec3::ZERO;
        let mut turned = Quat::IDENTITY;
        for (channel, &number) in self.channels.iter().zip(numbers) {
            match channel {
                Axis::MoveX => moved.x += number,
                Axis::MoveY => moved.y += number,
                Axis::MoveZ => moved.z += number,
                // What is named first turns first.
                Axis::TurnX => turned = Quat::from_rotation_x(number) * turned,
                Axis::TurnY => turned = Quat::from_rotation_y(number) * turned,
                Axis::TurnZ => turned = Quat::from_rotation_z(number) * turned,
                Axis::Length => {}
            }
        }
        (moved, self.axes * turned * self.axes.inverse())
    }
}

impl Axis {
    pub(super) fn is_angle(self) -> bool {
        matches!(self, Self::TurnX | Self::TurnY | Self::TurnZ)
    }

    fn named(word: &str) -> Option<Self> {
        Some(match word.to_ascii_lowercase().as_str() {
            "tx" => Self::MoveX,
            "ty" => Self::MoveY,
            "tz" => Self::MoveZ,
            "rx" => Self::TurnX,
            "ry" => Self::TurnY,
            "rz" => Self::TurnZ,
            "l" => Self::Length,
            _ => return None,
        })
    }
}

pub(super) fn parse(path: &Path, text: &str) -> Result<AsfSkeleton, RegistrationError> {
    let mut reader = Reader {
        path,
        line: 0,
        section: String::new(),
        degrees: true,
        bones: vec![AsfBone::named("root")],
        lengths: vec![0.0],
        children: Vec::new(),
    };
    for line in text.lines() {
        reader.line += 1;
        let line = line.split('#').next().unwrap_or_default().trim();
        let mut words = line.split_whitespace();
        if let Some(first) = words.next() {
            reader.take(first, &words.collect::<Vec<_>>())?;
        }
    }
    reader.finish()
}

impl AsfBone {
    fn named(name: &str) -> Self {
        Self {
            name: name.to_owned(),
            parent: None,
            along: Vec3::ZERO,
            axes: Quat::IDENTITY,
            channels: Vec::new(),
            first_channel: 0,
        }
    }
}

struct Reader<'a> {
    path: &'a Path,
    line: usize,
    section: String,
    degrees: bool,
    bones: Vec<AsfBone>,
    lengths: Vec<f32>,
    /// Parent and child by name, with the line they stand on.
    children: Vec<(String, String, usize)>,
}

impl Reader<'_> {
    fn take(&mut self, first: &str, words: &[&str]) -> Result<(), RegistrationError> {
        if let Some(section) = first.strip_prefix(':') {
            section.to_ascii_lowercase().clone_into(&mut self.section);
            return Ok(());
        }
        match self.section.as_str() {
            "units" if first == "angle" => {
                self.degrees = words.first().is_none_or(|unit| unit.starts_with("deg"));
                Ok(())
            }
            "root" => self.take_root(first, words),
            "bonedata" => self.take_bone(first, words),
            "hierarchy" if first != "begin" && first != "end" => {
                for child in words {
                    self.children
                        .push((first.to_owned(), (*child).to_owned(), self.line));
                }
                self.check_count(self.children.len())
            }
            _ => Ok(()),
        }
    }

    fn take_root(&mut self, first: &str, words: &[&str]) -> Result<(), RegistrationError> {
        match first {
            "order" => self.bones[0].channels = self.channels(words)?,
            "orientation" => {
                let angles = self.numbers(words)?;
                self.bones[0].axes = self.turned("xyz", angles)?;
            }
            _ => {}
        }
        Ok(())
    }

    fn take_bone(&mut self, first: &str, words: &[&str]) -> Result<(), RegistrationError> {
        if first == "begin" {
            self.check_count(self.bones.len() + 1)?;
            self.bones.push(AsfBone::named(""));
            self.lengths.push(0.0);
            return Ok(());
        }
        let last = self.bones.len() - 1;
        match first {
            "name" => self.bones[last].name = words.join(" "),
            "direction" => self.bones[last].along = self.numbers(words)?,
            "length" => {
                let length: Option<f32> = words.first().and_then(|word| word.parse().ok());
                let found = words.join(" ");
                let length = length.filter(|length| length.is_finite() && *length >= 0.0);
                self.lengths[last] = length.ok_or_else(|| self.error("a length", &found))?;
            }
            "axis" => {
                let order = words.get(3).copied().unwrap_or("XYZ");
                let angles = self.numbers(&words[..words.len().min(3)])?;
                self.bones[last].axes = self.turned(order, angles)?;
            }
            "dof" => self.bones[last].channels = self.channels(words)?,
            _ => {}
        }
        Ok(())
    }

    fn check_count(&self, count: usize) -> Result<(), RegistrationError> {
        if count <= MAX_JOINTS {
            return Ok(());
        }
        Err(self.error(&format!("at most {MAX_JOINTS} bones"), "one more"))
    }

    fn channels(&self, words: &[&str]) -> Result<Vec<Axis>, RegistrationError> {
        const EXPECTED: &str = "at most 7 of tx, ty, tz, rx, ry, rz, l";
        let channels: Option<Vec<Axis>> = words.iter().map(|word| Axis::named(word)).collect();
        channels
            .filter(|channels| channels.len() <= 7)
            .ok_or_else(|| self.error(EXPECTED, &words.join(" ")))
    }

    fn numbers(&self, words: &[&str]) -> Result<Vec3, RegistrationError> {
        let numbers: Option<Vec<f32>> = words
            .iter()
            .map(|word| word.parse().ok().filter(|number: &f32| number.is_finite()))
            .collect();
        match numbers.as_deref() {
            Some(&[x, y, z]) => Ok(vec3(x, y, z)),
            _ => Err(self.error("three finite numbers", &words.join(" "))),
        }
    }

    /// Turns about x, y and z, in an order such as "XYZ".
    fn turned(&self, order: &str, angles: Vec3) -> Result<Quat, RegistrationError> {
        let mut turned = Quat::IDENTITY;
        for (axis, angle) in order.chars().zip(angles.to_array()) {
            let angle = if self.degrees {
                angle.to_radians()
            } else {
                angle
            };
            turned = match axis.to_ascii_lowercase() {
                'x' => Quat::from_rotation_x(angle),
                'y' => Quat::from_rotation_y(angle),
                'z' => Quat::from_rotation_z(angle),
                _ => return Err(self.error("an order of X, Y and Z", order)),
            } * turned;
        }
        Ok(turned)
    }

    /// Bones in hierarchical order, with parents.
    fn finish(mut self) -> Result<AsfSkeleton, RegistrationError> {
        for (bone, length) in self.bones.iter_mut().zip(&self.lengths) {
            bone.along = bone.along.normalize_or_zero() * *length;
        }
        let mut bones = vec![self.bones[0].clone()];
        let mut placed = 0;
        while placed < bones.len() {
            let parent = bones[placed].name.clone();
            for (of, child, line) in &self.children {
                if *of != parent {
                    continue;
                }
                self.line = *line;
                let bone = self.bones.iter().skip(1).find(|bone| bone.name == *child);
                let Some(bone) = bone else {
                    return Err(self.error("a bone of the bonedata", child));
                };
                if bones.iter().any(|placed| placed.name == *child) {
                    return Err(self.error("each bone once", child));
                }
                bones.push(AsfBone { parent: Some(placed), ..bone.clone() });
            }
            placed += 1;
        }
        let mut channel_count = 0;
        for bone in &mut bones {
            bone.first_channel = channel_count;
            channel_count += bone.channels.len();
        }
        if bones.len() < 2 || bones[0].channels.is_empty() {
            self.line = 0;
            return Err(self.error(
                "a :root with its order, :bonedata and :hierarchy",
                "no bones",
            ));
        }
        Ok(AsfSkeleton { bones, channel_count })
    }

    fn error(&self, expected: &str, found: &str) -> RegistrationError {
        RegistrationError::MotionFile {
            path: self.path.to_path_buf(),
            line: self.line,
            expected: expected.to_owned(),
            found: found.chars().take(60).collect(),
        }
    }
}
