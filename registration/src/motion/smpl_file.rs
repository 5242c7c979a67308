//! Files of SMPL parameters: `.npz` as AMASS writes them, `.csv` with a row of axis-angles a frame.
//!
//! Whatever axes the file uses, the trunk is upright on average; which axis that is decides how the file is turned.
//! Lengths are metres.

use std::path::Path;

use glam::{Quat, Vec3};

use super::{
    Motion, MotionPose, RestBody,
    file::{self, MAX_FRAMES},
    retarget, short_axis_angle,
};
use crate::{
    error::RegistrationError,
    smpl::{JOINT_COUNT, npz::Npz},
};

#[cfg(test)]
mod tests;

/// What video pose estimators deliver, where the file does not say.
pub const DEFAULT_RATE_HZ: f32 = 30.0;
/// Pelvis, legs, spine, head and arms; SMPL-H and SMPL-X have fingers after them.
const BODY_JOINTS: usize = 22;

/// Nobody turned or went this far, in radians or metres.
const FARTHEST: f32 = 1e4;

/// Poses as a file has them, in its own axes.
#[derive(Clone, Debug, PartialEq)]
pub struct SmplFile {
    pub name: String,
    pub rate_hz: f32,
    pub poses: Vec<[Vec3; JOINT_COUNT]>,
    /// One a frame, or none at all.
    pub trans: Vec<Vec3>,
    pub betas: Option<[f32; 10]>,
}

impl SmplFile {
    /// Reads a `.csv` file, or an `.npz` under any other name.
    pub fn read(path: &Path) -> Result<Self, RegistrationError> {
        let is_csv = path
            .extension()
            .is_some_and(|extension| extension.eq_ignore_ascii_case("csv"));
        let file = if is_csv {
            Self::read_csv(path)?
        } else {
            Self::read_npz(path)?
        };
        let far = |point: &Vec3| !point.is_finite() || point.abs().max_element() > FARTHEST;
        let bad = |frame: usize| {
            file.poses[frame].iter().any(far) || file.trans.get(frame).is_some_and(far)
        };
        match (0..file.poses.len()).find(|&frame| bad(frame)) {
            Some(frame) => {
                let expected =
                    format!("angles and translations between {FARTHEST} and its negative");
                let found = format!("a number beyond in frame {frame}");
                Err(wrong(path, 0, &expected, found))
            }
            None => Ok(file),
        }
    }

    /// The motion with its feet on the floor; without `trans` each frame stands on its lowest point.
    pub fn onto(&self, rest: &RestBody) -> Motion {
        let ours_from_file = self.ours_from_file();
        let pelvis = rest.joints[0];
        let mut poses: Vec<MotionPose> = self
            .poses
            .iter()
            .enumerate()
            .map(|(frame, theta)| {
                let mut theta = theta.map(|t| short_axis_angle(Quat::from_scaled_axis(t)));
                let root = ours_from_file * Quat::from_scaled_axis(theta[0]);
                theta[0] = short_axis_angle(root.normalize());
                let trans = match self.trans.get(frame) {
                    Some(&trans) => ours_from_file * (pelvis + trans) - pelvis,
                    None => Vec3::NEG_Y * rest.lowest_point_m(&theta),
                };
                MotionPose { theta, trans }
            })
            .collect();
        if !self.trans.is_empty() {
            retarget::put_on_floor(&mut poses, rest);
        }
        Motion { name: self.name.clone(), rate_hz: self.rate_hz, poses }
    }

    fn ours_from_file(&self) -> Quat {
        let up: Vec3 = self
            .poses
            .iter()
            .map(|theta| Quat::from_scaled_axis(theta[0]) * Vec3::Y)
            .sum();
        match retarget::nearest_axis(up) {
            // A camera's axes: half a turn about x, so that who faces the camera faces +z.
            Vec3::NEG_Y => Quat::from_rotation_x(std::f32::consts::PI),
            up => Quat::from_rotation_arc(up, Vec3::Y),
        }
    }

    fn read_npz(path: &Path) -> Result<Self, RegistrationError> {
        let in_motion_terms = |error| motion_error(path, error);
        let mut npz = Npz::open(path).map_err(in_motion_terms)?;
        let array = npz.array("poses").map_err(in_motion_terms)?;
        let frames = array.shape.first().copied().unwrap_or(0);
        let width: usize = array.shape.iter().skip(1).product();
        let known = array.shape.len() >= 2 && matches!(width, 72 | 156 | 165);
        if !known || frames == 0 || frames > MAX_FRAMES {
            let expected = format!(
                "array \"poses\" of 1 to {MAX_FRAMES} frames with 72, 156 or 165 numbers (SMPL, SMPL-H, SMPL-X)"
            );
            return Err(wrong(
                path,
                0,
                &expected,
                format!("shape {:?}", array.shape),
            ));
        }
        let joints = if width == 72 {
            JOINT_COUNT
        } else {
            BODY_JOINTS
        };
        let poses = array
            .data
            .chunks_exact(width)
            .map(|numbers| {
                pose(
                    &numbers.iter().map(|&n| n as f32).collect::<Vec<_>>(),
                    joints,
                )
            })
            .collect();
        let mut trans = Vec::new();
        if npz.has("trans") {
            let array = npz
                .shaped("trans", &[Some(frames), Some(3)])
                .map_err(in_motion_terms)?;
            trans = array.data.chunks_exact(3).map(vector).collect();
        }
        let mut betas = None;
        if npz.has("betas") {
            let array = npz.array("betas").map_err(in_motion_terms)?;
            let at = |i: usize| array.data.get(i).map_or(0.0, |&beta| beta as f32);
            betas = Some(std::array::from_fn(at));
        }
        let mut rate_hz = DEFAULT_RATE_HZ;
        for key in ["mocap_framerate", "mocap_frame_rate", "fps"] {
            if npz.has(key) {
                let array = npz.array(key).map_err(in_motion_terms)?;
                let found = array.data.first().map_or(0.0, |&rate| rate as f32);
                if !(0.1..=2000.0).contains(&found) {
                    let expected = format!("array {key:?} of 0.1 to 2000 frames a second");
                    return Err(wrong(path, 0, &expected, found.to_string()));
                }
                rate_hz = found;
                break;
            }
        }
        Ok(Self { name: stem(path), rate_hz, poses, trans, betas })
    }

    fn read_csv(path: &Path) -> Result<Self, RegistrationError> {
        let text = file::read_text(path)?;
        let mut file = Self {
            name: stem(path),
            rate_hz: DEFAULT_RATE_HZ,
            poses: Vec::new(),
            trans: Vec::new(),
            betas: None,
        };
        for (index, line) in text.trim_end().lines().enumerate() {
            let cells: Vec<&str> = line.split(',').map(str::trim).collect();
            if index == 0 && is_header(&cells) {
                continue;
            }
            if line.trim().is_empty() {
                let expected = "a row of numbers";
                return Err(wrong(path, index + 1, expected, "an empty row".to_owned()));
            }
            let numbers = row(path, index + 1, &cells)?;
            if file.poses.len() >= MAX_FRAMES {
                let expected = format!("at most {MAX_FRAMES} rows");
                return Err(wrong(path, index + 1, &expected, "one more".to_owned()));
            }
            file.poses.push(pose(&numbers, JOINT_COUNT));
            if let Some(&[x, y, z]) = numbers.get(72..) {
                file.trans.push(Vec3::new(x, y, z));
            }
        }
        if file.poses.is_empty() {
            return Err(wrong(path, 0, "rows of 72 numbers", "none".to_owned()));
        }
        if !file.trans.is_empty() && file.trans.len() != file.poses.len() {
            let found = format!("{} of {}", file.trans.len(), file.poses.len());
            return Err(wrong(
                path,
                0,
                "a translation in every row or in none",
                found,
            ));
        }
        Ok(file)
    }
}

/// Names, or columns counted from zero.
fn is_header(cells: &[&str]) -> bool {
    let counted = cells
        .iter()
        .enumerate()
        .all(|(i, cell)| cell.parse() == Ok(i));
    counted
        || cells
            .iter()
            .all(|cell| !cell.is_empty() && cell.parse::<f32>().is_err())
}

fn row(path: &Path, line: usize, cells: &[&str]) -> Result<Vec<f32>, RegistrationError> {
    if !matches!(cells.len(), 72 | 75) {
        let expected = "72 cells (24 axis-angles), or 75 with a translation";
        return Err(wrong(
            path,
            line,
            expected,
            format!("{} of them", cells.len()),
        ));
    }
    let mut numbers = Vec::with_capacity(cells.len());
    for (column, cell) in cells.iter().enumerate() {
        let number = cell.parse().ok().filter(|number: &f32| number.is_finite());
        let Some(number) = number else {
            let expected = format!("a finite number in column {}", column + 1);
            let found = if cell.is_empty() {
                "an empty cell"
            } else {
                cell
            };
            return Err(wrong(
                path,
                line,
                &expected,
                found.chars().take(60).collect(),
            ));
        };
        numbers.push(number);
    }
    Ok(numbers)
}

fn pose(numbers: &[f32], joints: usize) -> [Vec3; JOINT_COUNT] {
    let mut theta = [Vec3::ZERO; JOINT_COUNT];
    for (joint, turn) in theta.iter_mut().zip(numbers.chunks_exact(3)).take(joints) {
        *joint = Vec3::from_slice(turn);
    }
    theta
}

fn vector(numbers: &[f64]) -> Vec3 {
    Vec3::new(numbers[0] as f32, numbers[1] as f32, numbers[2] as f32)
}

fn stem(path: &Path) -> String {
    path.file_stem()
        .map_or_else(String::new, |stem| stem.to_string_lossy().into_owned())
}

fn wrong(path: &Path, line: usize, expected: &str, found: String) -> RegistrationError {
    let expected = expected.to_owned();
    RegistrationError::MotionFile { path: path.to_path_buf(), line, expected, found }
}

/// What is wrong with an archive, said of a motion file.
fn motion_error(path: &Path, error: RegistrationError) -> RegistrationError {
    match error {
        RegistrationError::BodyArchive { problem, .. } => {
            wrong(path, 0, "an .npz archive of NumPy arrays", problem)
        }
        RegistrationError::BodyArrayMissing { array, found, .. } => {
            wrong(path, 0, &format!("an array {array:?}"), found.join(", "))
        }
        RegistrationError::BodyArray { array, expected, found, .. } => {
            wrong(path, 0, &format!("array {array:?}: {expected}"), found)
        }
        other => other,
    }
}
