//! The `.amc` file: a number a frame, then a line for each bone that moves.

use std::path::Path;

use super::AsfSkeleton;
use crate::{error::RegistrationError, motion::file::MAX_FRAMES};

pub(super) fn parse(
    path: &Path,
    text: &str,
    skeleton: &AsfSkeleton,
) -> Result<Vec<Vec<f32>>, RegistrationError> {
    let mut reader = Reader {
        path,
        line: 0,
        skeleton,
        degrees: true,
        frames: Vec::new(),
        number: None,
        filled: vec![false; skeleton.bones.len()],
    };
    for line in text.lines() {
        reader.line += 1;
        let line = line.split('#').next().unwrap_or_default().trim();
        if let Some(keyword) = line.strip_prefix(':') {
            reader.degrees &= !keyword.eq_ignore_ascii_case("radians");
        } else if !line.is_empty() {
            reader.take(line)?;
        }
    }
    reader.close_frame()?;
    if reader.frames.is_empty() {
        return Err(reader.error("at least one frame", "none"));
    }
    Ok(reader.frames)
}

struct Reader<'a> {
    path: &'a Path,
    line: usize,
    skeleton: &'a AsfSkeleton,
    degrees: bool,
    frames: Vec<Vec<f32>>,
    /// What the last frame is called in the file.
    number: Option<u64>,
    /// Which bones the last frame has so far.
    filled: Vec<bool>,
}

impl Reader<'_> {
    fn take(&mut self, line: &str) -> Result<(), RegistrationError> {
        if line.bytes().all(|byte| byte.is_ascii_digit()) {
            self.close_frame()?;
            if self.frames.len() >= MAX_FRAMES {
                return Err(self.error(&format!("at most {MAX_FRAMES} frames"), "one more"));
            }
            let Ok(number) = line.parse::<u64>() else {
                return Err(self.error("the number of a frame", line));
            };
            let expected = self
                .number
                .map_or(number, |before| before.saturating_add(1));
            if number != expected {
                return Err(self.error(&format!("frame {expected} next"), line));
            }
            self.number = Some(number);
            self.frames.push(vec![0.0; self.skeleton.channel_count]);
            self.filled.fill(false);
            return Ok(());
        }
        let mut words = line.split_whitespace();
        let name = words.next().unwrap_or_default();
        let skeleton = self.skeleton;
        let place = skeleton.bones.iter().position(|bone| bone.name == name);
        let Some((place, bone)) = place.map(|place| (place, &skeleton.bones[place])) else {
            return Err(self.error("a bone of the skeleton", name));
        };
        if self.filled[place] {
            return Err(self.error("each bone once a frame", name));
        }
        let numbers: Option<Vec<f32>> = words
            .map(|word| word.parse().ok().filter(|n: &f32| n.is_finite()))
            .collect();
        let numbers = numbers.filter(|numbers| numbers.len() == bone.channels.len());
        let Some(numbers) = numbers else {
            let expected = format!("{name} and {} finite numbers", bone.channels.len());
            return Err(self.error(&expected, line));
        };
        if self.frames.is_empty() {
            return Err(self.error("the number of a frame first", name));
        }
        let degrees = self.degrees;
        let frame = self
            .frames
            .last_mut()
            .map(|frame| &mut frame[bone.first_channel..]);
        for ((to, number), channel) in frame.into_iter().flatten().zip(numbers).zip(&bone.channels)
        {
            *to = if channel.is_angle() && degrees {
                number.to_radians()
            } else {
                number
            };
        }
        self.filled[place] = true;
        Ok(())
    }

    fn close_frame(&self) -> Result<(), RegistrationError> {
        if self.frames.is_empty() {
            return Ok(());
        }
        let bones = self.skeleton.bones.iter().zip(&self.filled);
        let mut missing = bones.filter(|(bone, filled)| !**filled && !bone.channels.is_empty());
        missing.next().map_or(Ok(()), |(bone, _)| {
            let expected = format!("{} in each frame", bone.name);
            Err(self.error(&expected, "a frame without"))
        })
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
