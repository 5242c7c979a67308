//! Another skeleton's motion on SMPL's joints.
//!
//! Each SMPL joint takes the global rotation of the joint that plays its part, corrected for how the two rest
//! poses differ: `G_smpl = C G_source C^-1 A`, where `C` turns the file's axes into ours and `A` turns SMPL's
//! zero-pose bone onto the source's rest bone (identity for trunk, head and feet, which both skeletons hold
//! upright or flat at rest).

use std::path::Path;

use glam::{Mat3, Quat, Vec3};

use super::{Motion, MotionPose, RestBody, short_axis_angle};
use crate::{
    error::RegistrationError,
    smpl::{JOINT_COUNT, JOINT_NAMES, PARENTS},
};

mod names;

pub use names::JointMap;

/// A skeleton and what it does, in a file's own units and axes; parents come before their children.
pub(super) trait Clip {
    fn names(&self) -> Vec<&str>;
    fn parents(&self) -> Vec<Option<usize>>;
    fn frame_count(&self) -> usize;
    fn frame_secs(&self) -> f32;
    /// Positions of all joints with every rotation zero.
    fn rest_positions(&self) -> Vec<Vec3>;
    /// Rotation and position of every joint in one frame, in the space of the file.
    fn global_pose(&self, frame: usize) -> Vec<(Quat, Vec3)>;
    /// Whether feet at rest are tilted as their shins are; otherwise they are flat.
    fn feet_follow_shins(&self) -> bool {
        false
    }
}

/// A first frame further than this from the second is a calibration pose, not part of the motion.
const CALIBRATION_JUMP_RAD: f32 = 0.5;
/// The share of frames whose feet may touch the floor line from below: measured feet are noisy.
const FLOOR_PERCENTILE: f32 = 0.02;

pub(super) fn onto_smpl(
    path: &Path,
    clip: &dyn Clip,
    rest: &RestBody,
) -> Result<Motion, RegistrationError> {
    let map = JointMap::find(&clip.names(), &clip.parents()).map_err(|missing| {
        RegistrationError::MotionFile {
            path: path.to_path_buf(),
            line: 0,
            expected: format!(
                "a joint for SMPL's `{}`, under one of the names {}",
                JOINT_NAMES[missing],
                JointMap::known_names(missing)
            ),
            found: clip.names().join(", "),
        }
    })?;
    let source = SourceRest::measure(clip, &map);
    let their_rest = map
        .0
        .map(|joint| joint.map(|joint| source.positions[joint]));
    let mut alignments = limb_alignments(&their_rest, &rest.joints);
    if clip.feet_follow_shins() {
        for foot in [7, 8, 10, 11] {
            alignments[foot] = alignments[4 + (foot - 7) % 3];
        }
    }
    let metres_per_unit = source.metres_per_unit(rest);
    let retargeting = Retargeting { map, source, alignments, metres_per_unit };
    let start = usize::from(first_frame_is_calibration(clip));
    let mut poses: Vec<MotionPose> = (start..clip.frame_count())
        .map(|frame| retargeting.pose(&clip.global_pose(frame), rest))
        .collect();
    put_on_floor(&mut poses, rest);
    let name = path
        .file_stem()
        .map_or_else(String::new, |s| s.to_string_lossy().into_owned());
    Ok(Motion { name, rate_hz: 1.0 / clip.frame_secs(), poses })
}

/// The source's rest pose in our axes (y up, facing +z), in the file's unit.
struct SourceRest {
    ours_from_file: Quat,
    positions: Vec<Vec3>,
    leg_length: f32,
}

impl SourceRest {
    fn measure(clip: &dyn Clip, map: &JointMap) -> Self {
        let in_file = clip.rest_positions();
        let at = |smpl: usize| map.0[smpl].map(|joint| in_file[joint]);
        let between = |from: usize, to: usize| match (at(from), at(to)) {
            (Some(from), Some(to)) => to - from,
            _ => Vec3::ZERO,
        };
        let up = nearest_axis(between(0, 15) + between(7, 1) + between(8, 2));
        let left = between(2, 1) + between(17, 16);
        let left = nearest_axis(left.reject_from(up));
        let file_from_ours = Mat3::from_cols(left, up, left.cross(up));
        let ours_from_file = Quat::from_mat3(&file_from_ours.transpose());
        let positions = in_file.iter().map(|&p| ours_from_file * p).collect();
        let leg_length = between(1, 4).length() + between(4, 7).length();
        Self { ours_from_file, positions, leg_length }
    }

    /// Metres of the performing body a unit of the file.
    fn metres_per_unit(&self, rest: &RestBody) -> f32 {
        let ours =
            rest.joints[1].distance(rest.joints[4]) + rest.joints[4].distance(rest.joints[7]);
        if self.leg_length > 0.0 {
            ours / self.leg_length
        } else {
            1.0
        }
    }
}

/// The signed coordinate axis closest to a direction; y for none.
pub(super) fn nearest_axis(direction: Vec3) -> Vec3 {
    [
        Vec3::Y,
        Vec3::NEG_Y,
        Vec3::X,
        Vec3::NEG_X,
        Vec3::Z,
        Vec3::NEG_Z,
    ]
    .into_iter()
    .fold(Vec3::Y, |best, axis| {
        if axis.dot(direction) > best.dot(direction) + 1e-6 {
            axis
        } else {
            best
        }
    })
}

/// `A` for each SMPL joint: turns the bones of our rest pose onto another skeleton's, in one space.
pub fn limb_alignments(
    their_rest: &[Option<Vec3>; JOINT_COUNT],
    our_rest: &[Vec3; JOINT_COUNT],
) -> [Quat; JOINT_COUNT] {
    let mut alignments = [Quat::IDENTITY; JOINT_COUNT];
    // Hips, knees, shoulders, elbows, each with the joint at the end of its bone.
    for (joint, end) in [
        (1, 4),
        (2, 5),
        (4, 7),
        (5, 8),
        (16, 18),
        (17, 19),
        (18, 20),
        (19, 21),
    ] {
        let (Some(from), Some(to)) = (their_rest[joint], their_rest[end]) else {
            continue;
        };
        let theirs = to - from;
        let ours = our_rest[end] - our_rest[joint];
        if let (Some(ours), Some(theirs)) = (ours.try_normalize(), theirs.try_normalize()) {
            alignments[joint] = Quat::from_rotation_arc(ours, theirs);
        }
    }
    // A hand continues its forearm at rest.
    alignments[20] = alignments[18];
    alignments[21] = alignments[19];
    alignments
}

/// Everything that stays the same from frame to frame.
struct Retargeting {
    map: JointMap,
    source: SourceRest,
    alignments: [Quat; JOINT_COUNT],
    metres_per_unit: f32,
}

impl Retargeting {
    /// One frame, from the global rotation and position of each source joint.
    fn pose(&self, globals: &[(Quat, Vec3)], rest: &RestBody) -> MotionPose {
        let convert = self.source.ours_from_file;
        let mut ours = [Quat::IDENTITY; JOINT_COUNT];
        let mut theta = [Vec3::ZERO; JOINT_COUNT];
        for joint in 0..JOINT_COUNT {
            let parent = if joint == 0 {
                Quat::IDENTITY
            } else {
                ours[PARENTS[joint]]
            };
            ours[joint] = self.map.0[joint].map_or(parent, |theirs| {
                convert * globals[theirs].0 * convert.inverse() * self.alignments[joint]
            });
            theta[joint] = short_axis_angle((parent.inverse() * ours[joint]).normalize());
        }
        let root = self.map.0[0].map_or(Vec3::ZERO, |root| globals[root].1);
        let trans = convert * root * self.metres_per_unit - rest.joints[0];
        MotionPose { theta, trans }
    }
}

fn first_frame_is_calibration(clip: &dyn Clip) -> bool {
    if clip.frame_count() < 3 {
        return false;
    }
    let (first, second) = (clip.global_pose(0), clip.global_pose(1));
    let jumps = first
        .iter()
        .zip(&second)
        .map(|(a, b)| a.0.angle_between(b.0));
    jumps.fold(0.0, f32::max) > CALIBRATION_JUMP_RAD
}

/// One height for all: jumps stay jumps. Then nobody is left standing in the floor.
pub(super) fn put_on_floor(poses: &mut [MotionPose], rest: &RestBody) {
    let mut lowest: Vec<f32> = poses
        .iter()
        .map(|pose| rest.lowest_point_m(&pose.theta) + pose.trans.y)
        .collect();
    let before = lowest.clone();
    lowest.sort_by(f32::total_cmp);
    let Some(&floor) = lowest.get((lowest.len() as f32 * FLOOR_PERCENTILE) as usize) else {
        return;
    };
    for (pose, low) in poses.iter_mut().zip(before) {
        pose.trans.y -= floor.min(low);
    }
}
