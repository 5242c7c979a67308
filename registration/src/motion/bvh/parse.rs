//! From text to [`BvhClip`], line by line.

use std::path::Path;

use glam::{Vec3, vec3};

use super::{BvhClip, BvhJoint, Channel, MAX_JOINTS};
use crate::{error::RegistrationError, motion::file::MAX_FRAMES};

pub(super) fn parse(path: &Path, text: &str) -> Result<BvhClip, RegistrationError> {
    let mut lines = Lines { path, rest: text.lines(), number: 0 };
    let (first, words) = lines.next_words("HIERARCHY")?;
    if !first.eq_ignore_ascii_case("HIERARCHY") {
        return Err(lines.error("HIERARCHY", words.trim()));
    }
    let (joints, channel_count) = hierarchy(&mut lines)?;
    let (frame_count, frame_secs) = header(&mut lines)?;
    let mut frames = Vec::new();
    for _ in 0..frame_count {
        frames.push(frame(&mut lines, channel_count)?);
    }
    Ok(BvhClip { joints, frame_secs, frames })
}

struct Lines<'a> {
    path: &'a Path,
    rest: std::str::Lines<'a>,
    number: usize,
}

impl<'a> Lines<'a> {
    /// The first word of the next line with anything on it, and the whole line.
    fn next_words(&mut self, expected: &str) -> Result<(&'a str, &'a str), RegistrationError> {
        loop {
            self.number += 1;
            let Some(line) = self.rest.next() else {
                return Err(self.error(expected, "the end of the file"));
            };
            if let Some(word) = line.split_whitespace().next() {
                return Ok((word, line));
            }
        }
    }

    fn error(&self, expected: &str, found: &str) -> RegistrationError {
        RegistrationError::MotionFile {
            path: self.path.to_path_buf(),
            line: self.number,
            expected: expected.to_owned(),
            found: found.chars().take(60).collect(),
        }
    }
}

/// What an opening brace belongs to.
enum Scope {
    Joint(usize),
    EndSite(usize),
}

/// Joints in file order, and the number of channels.
fn hierarchy(lines: &mut Lines<'_>) -> Result<(Vec<BvhJoint>, usize), RegistrationError> {
    const EXPECTED: &str = "ROOT, JOINT, End Site, OFFSET, CHANNELS, a brace or MOTION";
    let mut joints: Vec<BvhJoint> = Vec::new();
    let mut channel_count = 0;
    let mut open: Vec<Scope> = Vec::new();
    let mut pending: Option<Scope> = None;
    loop {
        let (word, line) = lines.next_words(EXPECTED)?;
        let keyword = word.to_ascii_uppercase();
        match keyword.as_str() {
            "MOTION" if open.is_empty() && !joints.is_empty() => {
                return Ok((joints, channel_count));
            }
            "ROOT" | "JOINT" => {
                let parent = match open.last() {
                    None if joints.is_empty() => None,
                    Some(Scope::Joint(parent)) => Some(*parent),
                    _ => return Err(lines.error("one ROOT, and JOINTs inside joints", line.trim())),
                };
                pending = Some(Scope::Joint(add_joint(lines, line, parent, &mut joints)?));
            }
            "END" => match open.last() {
                Some(Scope::Joint(parent)) => pending = Some(Scope::EndSite(*parent)),
                _ => return Err(lines.error("End Site inside a joint", line.trim())),
            },
            "{" => match pending.take() {
                Some(scope) => open.push(scope),
                None => return Err(lines.error("ROOT, JOINT or End Site before {", line.trim())),
            },
            "}" if open.pop().is_some() => {}
            "OFFSET" => match open.last() {
                Some(Scope::Joint(joint)) => joints[*joint].offset = offset(lines, line)?,
                Some(Scope::EndSite(joint)) => joints[*joint].end_site = Some(offset(lines, line)?),
                None => return Err(lines.error("OFFSET inside a joint", line.trim())),
            },
            "CHANNELS" => match open.last() {
                Some(Scope::Joint(joint)) => {
                    joints[*joint].first_channel = channel_count;
                    joints[*joint].channels = channels(lines, line)?;
                    channel_count += joints[*joint].channels.len();
                }
                _ => return Err(lines.error("CHANNELS inside a joint", line.trim())),
            },
            _ => return Err(lines.error(EXPECTED, line.trim())),
        }
    }
}

fn add_joint(
    lines: &Lines<'_>,
    line: &str,
    parent: Option<usize>,
    joints: &mut Vec<BvhJoint>,
) -> Result<usize, RegistrationError> {
    if joints.len() >= MAX_JOINTS {
        return Err(lines.error(&format!("at most {MAX_JOINTS} joints"), "one more"));
    }
    let name = line
        .split_whitespace()
        .skip(1)
        .collect::<Vec<_>>()
        .join(" ");
    joints.push(BvhJoint {
        name,
        parent,
        offset: Vec3::ZERO,
        channels: Vec::new(),
        first_channel: 0,
        end_site: None,
    });
    Ok(joints.len() - 1)
}

fn offset(lines: &Lines<'_>, line: &str) -> Result<Vec3, RegistrationError> {
    let numbers: Vec<f32> = numbers(lines, line.split_whitespace().skip(1))?;
    match numbers[..] {
        [x, y, z] => Ok(vec3(x, y, z)),
        _ => Err(lines.error("OFFSET and three numbers", line.trim())),
    }
}

fn channels(lines: &Lines<'_>, line: &str) -> Result<Vec<Channel>, RegistrationError> {
    const EXPECTED: &str = "CHANNELS, a count of at most 6, and as many of Xposition .. Zrotation";
    let mut words = line.split_whitespace().skip(1);
    let count: usize = words
        .next()
        .and_then(|word| word.parse().ok())
        .filter(|&count| count <= 6)
        .ok_or_else(|| lines.error(EXPECTED, line.trim()))?;
    let channels: Option<Vec<Channel>> = words.map(channel).collect();
    channels
        .filter(|channels| channels.len() == count)
        .ok_or_else(|| lines.error(EXPECTED, line.trim()))
}

fn channel(word: &str) -> Option<Channel> {
    Some(match word.to_ascii_lowercase().as_str() {
        "xposition" => Channel::PositionX,
        "yposition" => Channel::PositionY,
        "zposition" => Channel::PositionZ,
        "xrotation" => Channel::RotationX,
        "yrotation" => Channel::RotationY,
        "zrotation" => Channel::RotationZ,
        _ => return None,
    })
}

/// The number of frames and the seconds each takes.
fn header(lines: &mut Lines<'_>) -> Result<(usize, f32), RegistrationError> {
    const FRAMES: &str = "Frames: and a count";
    let (_, line) = lines.next_words(FRAMES)?;
    let frame_count: usize = value_after(line, "frames")
        .and_then(|value| value.parse().ok())
        .ok_or_else(|| lines.error(FRAMES, line.trim()))?;
    if frame_count == 0 || frame_count > MAX_FRAMES {
        return Err(lines.error(
            &format!("1 to {MAX_FRAMES} frames"),
            &frame_count.to_string(),
        ));
    }
    const TIME: &str = "Frame Time: and seconds between 0.0005 and 10";
    let (_, line) = lines.next_words(TIME)?;
    let frame_secs: f32 = value_after(line, "frame time")
        .and_then(|value| value.parse().ok())
        .filter(|secs| (0.0005..=10.0).contains(secs))
        .ok_or_else(|| lines.error(TIME, line.trim()))?;
    Ok((frame_count, frame_secs))
}

fn value_after<'a>(line: &'a str, key: &str) -> Option<&'a str> {
    let (name, value) = line.split_once(':')?;
    name.trim().eq_ignore_ascii_case(key).then(|| value.trim())
}

fn frame(lines: &mut Lines<'_>, channel_count: usize) -> Result<Vec<f32>, RegistrationError> {
    let expected = format!("a frame of {channel_count} numbers");
    let (_, line) = lines.next_words(&expected)?;
    let numbers = numbers(lines, line.split_whitespace().take(channel_count + 1))?;
    if numbers.len() != channel_count {
        let found = format!("{} of them", numbers.len());
        return Err(lines.error(&expected, &found));
    }
    Ok(numbers)
}

fn numbers<'a>(
    lines: &Lines<'_>,
    words: impl Iterator<Item = &'a str>,
) -> Result<Vec<f32>, RegistrationError> {
    words
        .map(|word| {
            word.parse()
                .ok()
                .filter(|value: &f32| value.is_finite())
                .ok_or_else(|| lines.error("a finite number", word))
        })
        .collect()
}
