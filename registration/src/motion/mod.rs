//! Motion: sequences of SMPL poses, the files they come from, and a small procedural library.

use glam::{Quat, Vec3};

use crate::smpl::JOINT_COUNT;

pub mod amc;
pub mod bvh;
mod file;
pub mod library;
mod puppet;
mod rest_body;
mod retarget;
pub mod smpl_file;

pub use file::{MAX_BYTES, MAX_FRAMES, open};
pub use library::Routine;
pub use rest_body::RestBody;
pub use retarget::{JointMap, limb_alignments};

/// Movement of the whole body slower than this counts as travel.
const WANDER_SECS: f32 = 0.6;

/// Ends closer than this meet: what a body does in a thirtieth of a second.
const MEETING_RAD: f32 = 0.2;
const MEETING_M: f32 = 0.05;

/// A sequence of poses at a fixed rate. `trans` is metres in the world (y up).
#[derive(Clone, Debug, PartialEq)]
pub struct Motion {
    pub name: String,
    pub rate_hz: f32,
    pub poses: Vec<MotionPose>,
}

/// One pose: axis-angle for each SMPL joint, radians.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotionPose {
    pub theta: [Vec3; 24],
    pub trans: Vec3,
}

impl Motion {
    /// From the first pose to the last.
    pub fn duration_secs(&self) -> f32 {
        self.poses.len().saturating_sub(1) as f32 / self.rate_hz
    }

    /// The pose at a time since the first one, interpolated; held at both ends. `None` for an empty motion.
    pub fn at(&self, secs: f32) -> Option<MotionPose> {
        let last = self.poses.len().checked_sub(1)?;
        let position = (secs * self.rate_hz).clamp(0.0, last as f32);
        let before = position.floor() as usize;
        let after = (before + 1).min(last);
        Some(self.poses[before].interpolate(&self.poses[after], position - before as f32))
    }

    /// The same movement at another rate.
    pub fn resampled(&self, rate_hz: f32) -> Self {
        let count = (self.duration_secs() * rate_hz).floor() as usize + 1;
        let poses = (0..count)
            .filter_map(|i| self.at(i as f32 / rate_hz))
            .collect();
        Self { name: self.name.clone(), rate_hz, poses }
    }

    /// Turns and moves the whole motion so that it starts above the origin, facing +z (the camera).
    pub fn starting_at_origin(mut self, rest: &RestBody) -> Self {
        let Some(first) = self.poses.first() else {
            return self;
        };
        let facing = Quat::from_scaled_axis(first.theta[0]) * Vec3::Z;
        let turn = Quat::from_rotation_y(-facing.x.atan2(facing.z));
        let start = rest.joints[0] + first.trans;
        for pose in &mut self.poses {
            let root = turn * Quat::from_scaled_axis(pose.theta[0]);
            pose.theta[0] = root.to_scaled_axis();
            let mut pelvis = rest.joints[0] + pose.trans;
            pelvis -= Vec3::new(start.x, 0.0, start.z);
            pose.trans = turn * pelvis - rest.joints[0];
        }
        self
    }

    /// Takes travel out, as on a treadmill: what is left stays around the spot of the first pose.
    pub fn in_place(mut self) -> Self {
        let (Some(first), Some(last)) = (self.poses.first(), self.poses.last()) else {
            return self;
        };
        let start = first.trans;
        let travel = last.trans - start;
        let steps = (self.poses.len() - 1).max(1) as f32;
        // Steady travel first, so that the ends of the mean below are not biased.
        let aside: Vec<Vec3> = (self.poses.iter().enumerate())
            .map(|(i, pose)| pose.trans - start - travel * (i as f32 / steps))
            .collect();
        let reach = ((self.rate_hz * WANDER_SECS) as usize).max(1);
        for (i, pose) in self.poses.iter_mut().enumerate() {
            let window = &aside[i.saturating_sub(reach)..(i + reach + 1).min(aside.len())];
            let wandered = window.iter().sum::<Vec3>() / window.len() as f32;
            let moved = start + aside[i] - wandered;
            pose.trans = Vec3::new(moved.x, pose.trans.y, moved.z);
        }
        self
    }

    /// Ends as it begins, so that it can be repeated: as it is where its ends meet, else there and back.
    pub fn closed(mut self) -> Self {
        let meet = match (self.poses.first(), self.poses.last()) {
            (Some(first), Some(last)) => first.is_near(last),
            _ => true,
        };
        if !meet {
            let back: Vec<MotionPose> = self.poses.iter().rev().skip(1).copied().collect();
            self.poses.extend(back);
        }
        self
    }
}

impl MotionPose {
    fn is_near(&self, other: &Self) -> bool {
        let turned = |joint: usize| {
            let [from, to] = [self, other].map(|pose| Quat::from_scaled_axis(pose.theta[joint]));
            from.angle_between(to)
        };
        self.trans.distance(other.trans) < MEETING_M
            && (0..JOINT_COUNT).all(|joint| turned(joint) < MEETING_RAD)
    }

    /// From `self` (0) to `other` (1), each joint along the shorter arc.
    pub fn interpolate(&self, other: &Self, share: f32) -> Self {
        let theta = std::array::from_fn::<_, JOINT_COUNT, _>(|joint| {
            let from = Quat::from_scaled_axis(self.theta[joint]);
            let to = Quat::from_scaled_axis(other.theta[joint]);
            short_axis_angle(from.slerp(to, share))
        });
        Self { theta, trans: self.trans.lerp(other.trans, share) }
    }
}

/// The rotation's axis-angle with an angle of at most pi.
pub(crate) fn short_axis_angle(rotation: Quat) -> Vec3 {
    let rotation = if rotation.w < 0.0 {
        -rotation
    } else {
        rotation
    };
    rotation.to_scaled_axis()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pose(angle_rad: f32, x_m: f32) -> MotionPose {
        let mut theta = [Vec3::ZERO; 24];
        theta[18] = Vec3::Y * angle_rad;
        MotionPose { theta, trans: Vec3::X * x_m }
    }

    #[test]
    fn a_motion_is_interpolated_between_poses_and_held_at_its_ends() {
        let motion = Motion {
            name: "bend".to_owned(),
            rate_hz: 10.0,
            poses: vec![pose(0.0, 0.0), pose(1.0, 0.2)],
        };
        let middle = motion.at(0.05).unwrap();
        assert!(
            (middle.theta[18].y - 0.5).abs() < 1e-5,
            "half of one radian"
        );
        assert!((middle.trans.x - 0.1).abs() < 1e-6, "half of 0.2 m");
        assert_eq!(motion.at(-1.0).unwrap().trans.x, 0.0);
        assert!((motion.at(9.0).unwrap().trans.x - 0.2).abs() < 1e-6, "held");
        assert_eq!(motion.resampled(100.0).poses.len(), 11);
    }

    #[test]
    fn a_motion_that_does_not_end_as_it_begins_goes_back() {
        let poses = vec![pose(0.0, 0.0), pose(0.5, 0.0), pose(1.0, 0.0)];
        let motion = Motion { name: "bend".to_owned(), rate_hz: 1.0, poses }.closed();
        let angles: Vec<f32> = motion.poses.iter().map(|pose| pose.theta[18].y).collect();
        assert_eq!(angles, [0.0, 0.5, 1.0, 0.5, 0.0]);
        assert_eq!(motion.clone().closed(), motion, "it ends as it begins now");
    }

    #[test]
    fn in_place_motion_returns_to_where_it_started() {
        let poses = (0..5).map(|i| pose(0.0, i as f32)).collect();
        let motion = Motion { name: "walk".to_owned(), rate_hz: 1.0, poses }.in_place();
        for pose in &motion.poses {
            assert!(pose.trans.length() < 1e-6, "steady travel is gone");
        }
    }
}
