//! ASF/AMC motion capture (Acclaim): a skeleton in one file, its movement in another.
//!
//! A bone turns about axes of its own, `L = C M C^-1` relative to its parent, where `C` comes from the skeleton and
//! `M` from the frame; with all of `M` zero, bones lie along their `direction`s. Bones have the names of what they
//! are (`lfemur`); the joint of that name is where the bone starts.

use std::{
    fs,
    path::{Path, PathBuf},
};

use glam::{Quat, Vec3};

use super::{Motion, RestBody, file, retarget};
use crate::error::RegistrationError;

mod frames;
mod skeleton;
#[cfg(test)]
mod tests;

pub use skeleton::{AsfBone, AsfSkeleton, Axis};

/// The files do not say; the laboratory that made the format common recorded at this rate.
pub const RATE_HZ: f32 = 120.0;

/// A skeleton and what it does, in the files' unit.
#[derive(Clone, Debug)]
pub struct AmcClip {
    pub skeleton: AsfSkeleton,
    /// Numbers of each bone in the skeleton's order: radians, and for the root its place before them.
    pub frames: Vec<Vec<f32>>,
}

impl AmcClip {
    /// Reads an `.amc` file and the skeleton beside it: of the same name, of the name up to its last `_`, or the
    /// only `.asf` there.
    pub fn read(path: &Path) -> Result<Self, RegistrationError> {
        let skeleton_path = skeleton_beside(path)?;
        let skeleton = skeleton::parse(&skeleton_path, &file::read_text(&skeleton_path)?)?;
        let frames = frames::parse(path, &file::read_text(path)?, &skeleton)?;
        Ok(Self { skeleton, frames })
    }
}

impl retarget::Clip for AmcClip {
    fn names(&self) -> Vec<&str> {
        self.skeleton
            .bones
            .iter()
            .map(|bone| bone.name.as_str())
            .collect()
    }

    fn parents(&self) -> Vec<Option<usize>> {
        self.skeleton.bones.iter().map(|bone| bone.parent).collect()
    }

    fn frame_count(&self) -> usize {
        self.frames.len()
    }

    fn frame_secs(&self) -> f32 {
        1.0 / RATE_HZ
    }

    fn rest_positions(&self) -> Vec<Vec3> {
        let still = vec![(Vec3::ZERO, Quat::IDENTITY); self.skeleton.bones.len()];
        self.skeleton
            .posed(&still)
            .into_iter()
            .map(|(_, position)| position)
            .collect()
    }

    fn global_pose(&self, frame: usize) -> Vec<(Quat, Vec3)> {
        let numbers = &self.frames[frame];
        let locals: Vec<(Vec3, Quat)> = self
            .skeleton
            .bones
            .iter()
            .map(|bone| bone.local(&numbers[bone.first_channel..]))
            .collect();
        self.skeleton.posed(&locals)
    }

    /// Bones at rest are turned as one: legs that stand apart take their feet with them.
    fn feet_follow_shins(&self) -> bool {
        true
    }
}

impl Motion {
    /// Reads an AMC file and its ASF skeleton, and moves the motion onto SMPL's joints as [`Self::from_bvh`] does.
    pub fn from_amc(path: &Path, rest: &RestBody) -> Result<Self, RegistrationError> {
        let clip = AmcClip::read(path)?;
        retarget::onto_smpl(path, &clip, rest)
    }
}

fn skeleton_beside(path: &Path) -> Result<PathBuf, RegistrationError> {
    let stem = path
        .file_stem()
        .unwrap_or_default()
        .to_string_lossy()
        .into_owned();
    let subject = stem
        .rsplit_once('_')
        .map_or(stem.as_str(), |(subject, _)| subject);
    for name in [stem.as_str(), subject] {
        let candidate = path.with_file_name(format!("{name}.asf"));
        if candidate.is_file() {
            return Ok(candidate);
        }
    }
    let folder = path
        .parent()
        .filter(|folder| !folder.as_os_str().is_empty());
    let folder = folder.unwrap_or_else(|| Path::new("."));
    let io = |source| RegistrationError::Io { path: folder.to_path_buf(), source };
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).map_err(io)? {
        let entry = entry.map_err(io)?.path();
        if entry
            .extension()
            .is_some_and(|extension| extension.eq_ignore_ascii_case("asf"))
        {
            found.push(entry);
        }
    }
    match &found[..] {
        [only] => Ok(only.clone()),
        _ => Err(RegistrationError::MotionFile {
            path: path.to_path_buf(),
            line: 0,
            expected: format!("its skeleton {stem}.asf or {subject}.asf beside it"),
            found: format!("{} other .asf files", found.len()),
        }),
    }
}
