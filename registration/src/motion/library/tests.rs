//! What the movements claim: whole turns, joints within limits, feet that stay where they stand.

use glam::Quat;

use super::*;
use crate::smpl::{BoneTransforms, builtin};

const RATE_HZ: f32 = 30.0;

fn every() -> impl Iterator<Item = Routine> {
    Routine::ALL.into_iter().chain(Routine::ACTIONS)
}

fn rest() -> RestBody {
    RestBody::of(&builtin::body(), &[0.0; 10])
}

fn facing_rad(pose: &MotionPose) -> f32 {
    let forward = Quat::from_scaled_axis(pose.theta[0]) * glam::Vec3::Z;
    forward.x.atan2(forward.z)
}

#[test]
fn every_routine_starts_and_ends_facing_the_camera_with_feet_on_the_floor() {
    let rest = rest();
    for routine in every() {
        let motion = routine.motion(&rest, RATE_HZ, 3);
        for pose in [&motion.poses[0], &motion.poses[motion.poses.len() - 1]] {
            assert!(facing_rad(pose).abs() < 0.05, "{} faces +z", motion.name);
        }
        for pose in &motion.poses {
            let lowest_m = rest.lowest_point_m(&pose.theta) + pose.trans.y;
            assert!(
                lowest_m.abs() < 1e-4,
                "{}: lowest point at {lowest_m} m",
                motion.name
            );
        }
    }
}

#[test]
fn movements_are_smooth_and_within_the_limits_of_joints() {
    let rest = rest();
    for routine in every() {
        for seed in 0..4 {
            let motion = routine.motion(&rest, RATE_HZ, seed);
            for (before, after) in motion.poses.iter().zip(&motion.poses[1..]) {
                assert_speed(&motion.name, before, after);
                assert_within_limits(&motion.name, after);
            }
        }
    }
}

fn assert_speed(name: &str, before: &MotionPose, after: &MotionPose) {
    for joint in 0..24 {
        let [from, to] = [before, after].map(|p| Quat::from_scaled_axis(p.theta[joint]));
        let speed = from.angle_between(to) * RATE_HZ;
        assert!(
            speed < 9.0,
            "{name}: joint {joint} at {speed} rad/s; a brisk wave has 6"
        );
    }
    let speed = (after.trans - before.trans).length() * RATE_HZ;
    assert!(
        speed < 1.2,
        "{name}: pelvis at {speed} m/s; a squat has 0.7"
    );
}

fn assert_within_limits(name: &str, pose: &MotionPose) {
    for knee in [4, 5] {
        let bend = pose.theta[knee];
        assert!(
            bend.x > -0.15 && bend.x < 2.6,
            "{name}: knees bend one way: {bend}"
        );
        assert!(
            bend.y.abs() + bend.z.abs() < 0.3,
            "{name}: knees are hinges: {bend}"
        );
    }
    for (elbow, sign) in [(18, -1.0), (19, 1.0)] {
        let bend = pose.theta[elbow].y * sign;
        assert!(
            (-0.01..2.6).contains(&bend),
            "{name}: elbows bend one way: {bend}"
        );
    }
    let limits = [
        (1, 2.3),
        (2, 2.3),
        (3, 0.6),
        (6, 0.6),
        (9, 0.6),
        (7, 0.9),
        (8, 0.9),
        (12, 0.6),
    ];
    for (joint, limit_rad) in limits {
        let angle = pose.theta[joint].length();
        assert!(angle < limit_rad, "{name}: joint {joint} at {angle} rad");
    }
}

#[test]
fn a_turn_is_one_whole_turn() {
    let motion = Routine::TurnAround.motion(&rest(), RATE_HZ, 1);
    let mut turned = 0.0;
    for (before, after) in motion.poses.iter().zip(&motion.poses[1..]) {
        let step = facing_rad(after) - facing_rad(before);
        let step =
            (step + std::f32::consts::PI).rem_euclid(std::f32::consts::TAU) - std::f32::consts::PI;
        assert!(step > -0.01, "never turns back");
        turned += step;
    }
    assert!(
        (turned - std::f32::consts::TAU).abs() < 0.02,
        "{turned} rad"
    );
}

#[test]
fn feet_that_stand_do_not_slide() {
    let rest = rest();
    let ball_height_m = rest.joints[10].y - rest.sole_height_m();
    for routine in every() {
        let motion = routine.motion(&rest, RATE_HZ, 2);
        let balls: Vec<_> = motion
            .poses
            .iter()
            .map(|pose| {
                let (_, joints) = BoneTransforms::from_pose(&pose.theta, &rest.joints);
                [joints[10] + pose.trans, joints[11] + pose.trans]
            })
            .collect();
        for (before, after) in balls.iter().zip(&balls[1..]) {
            for side in 0..2 {
                let stands = |ball: glam::Vec3| ball.y < ball_height_m + 0.004;
                if stands(before[side]) && stands(after[side]) {
                    let slid_m = (after[side] - before[side]).with_y(0.0).length();
                    assert!(slid_m < 0.008, "{}: {slid_m} m in a frame", motion.name);
                }
            }
        }
    }
}

#[test]
fn seeds_vary_a_movement_and_repeat_it_exactly() {
    let rest = rest();
    let of = |seed| Routine::Squat.motion(&rest, RATE_HZ, seed);
    assert_eq!(of(5), of(5));
    assert_ne!(of(5).poses.len(), of(6).poses.len(), "tempo differs");
}
