//! What the movements claim: whole turns, joints within limits, feet that stay where they stand.

use glam::Quat;

use super::*;
use crate::smpl::{BoneTransforms, builtin};

const RATE_HZ: f32 = 30.0;

fn every() -> impl Iterator<Item = Routine> {
    Routine::ALL
        .into_iter()
        .chain(Routine::ACTIONS)
        .chain([Routine::Freestyle])
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
        let seeds = if routine == Routine::Freestyle { 40 } else { 4 };
        for seed in 0..seeds {
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

/// Joints in world space in every frame of a movement.
fn joints_of(routine: Routine) -> Vec<[glam::Vec3; 24]> {
    let rest = rest();
    let motion = routine.motion(&rest, RATE_HZ, 3);
    let of = |pose: &MotionPose| {
        let (_, joints) = BoneTransforms::from_pose(&pose.theta, &rest.joints);
        joints.map(|joint| joint + pose.trans)
    };
    motion.poses.iter().map(of).collect()
}

fn most(routine: Routine, of: &dyn Fn(&[glam::Vec3; 24]) -> f32) -> f32 {
    joints_of(routine).iter().map(of).fold(f32::MIN, f32::max)
}

/// What somebody who knows the movement by name would look for.
#[test]
fn arms_and_legs_do_what_their_actions_names_say() {
    let fist = |side: usize| move |j: &[glam::Vec3; 24]| j[20 + side].z - j[16 + side].z;
    for side in 0..2 {
        assert!(
            most(Routine::Punch, &fist(side)) > 0.35,
            "fist {side} goes straight ahead"
        );
        let over_head = |j: &[glam::Vec3; 24]| j[20 + side].y - j[15].y;
        assert!(
            most(Routine::ShoulderMill, &over_head) > 0.1,
            "arm {side} goes over the top"
        );
        let kicked = |j: &[glam::Vec3; 24]| (j[10 + side].z - j[0].z).min(4.0 * j[10 + side].y);
        assert!(
            most(Routine::SoccerKick, &kicked) > 0.3,
            "foot {side} is in front, off the floor"
        );
        let back = |j: &[glam::Vec3; 24]| j[0].z - j[10 + side].z;
        assert!(
            most(Routine::SoccerKick, &back) > 0.25,
            "foot {side} swings back first"
        );
    }
    assert!(
        most(Routine::Reach, &|j| j[21].y - j[15].y) > 0.15,
        "a hand over the head"
    );
    assert!(
        most(Routine::Reach, &|j| j[16].y - j[20].y) > 0.4,
        "the other goes down"
    );
    assert!(
        most(Routine::Reach, &|j| -j[20].y) > -0.75,
        "to the knee's height"
    );
    assert!(
        most(Routine::Bend, &|j| -j[20].y) > -0.65,
        "hands at the knees"
    );
    assert!(
        most(Routine::Bend, &|j| j[0].z - j[12].z) > 0.05,
        "and back over the heels"
    );
}

#[test]
fn trunks_do_what_their_actions_names_say() {
    let standing_m = joints_of(Routine::SitDown)[0][0].y;
    let low = most(Routine::SitDown, &|j| standing_m - j[0].y);
    assert!(
        (0.25..0.55).contains(&low),
        "a chair's height: {low} m lower"
    );
    assert!(
        most(Routine::SitDown, &|j| (j[4] - j[1]).with_y(0.0).length()) > 0.33,
        "thighs level"
    );
    let back_m = most(Routine::Walk, &|j| -j[0].z) + joints_of(Routine::Walk)[0][0].z;
    assert!((0.5..1.2).contains(&back_m), "three steps back: {back_m} m");
    let circle = |axis: usize| most(Routine::Hips, &|j| j[0][axis] - j[12][axis]);
    assert!(
        circle(0) > 0.05 && circle(2) > 0.05,
        "hips leave the shoulders' plumb line all around"
    );
    let turned = |j: &[glam::Vec3; 24]| {
        let [shoulders, hips] = [j[16] - j[17], j[1] - j[2]].map(|v| v.z.atan2(v.x));
        (shoulders - hips).abs()
    };
    assert!(
        most(Routine::Twist, &turned) > 0.5,
        "shoulders against hips, radians"
    );
    let spin = Routine::BallerinaSpin.motion(&rest(), RATE_HZ, 3);
    let turned: f32 = spin
        .poses
        .windows(2)
        .map(|w| {
            let step = facing_rad(&w[1]) - facing_rad(&w[0]);
            (step + std::f32::consts::PI).rem_euclid(std::f32::consts::TAU) - std::f32::consts::PI
        })
        .sum();
    assert!(
        (turned.abs() - std::f32::consts::TAU).abs() < 0.05,
        "once around: {turned} rad"
    );
    assert!(
        most(Routine::BallerinaSpin, &|j| j[8].y) > 0.3,
        "a foot at the knee"
    );
    for (routine, up, down) in [
        (Routine::FlyingEagle, 0.2, 0.15),
        (Routine::ChickenWings, 0.0, 0.05),
    ] {
        let joint = if routine == Routine::FlyingEagle {
            20
        } else {
            18
        };
        assert!(
            most(routine, &|j| j[joint].y - j[16].y) > up - 0.1,
            "wings go up"
        );
        assert!(most(routine, &|j| j[16].y - j[joint].y) > down, "and down");
    }
}

/// A data set shows the first seconds.
#[test]
fn within_seconds_freestyles_go_wherever_limbs_can_go() {
    let rest = rest();
    // 56 frames at 12 Hz.
    let shown = (56.0 / 12.0 * RATE_HZ) as usize;
    let mut reached = [f32::MIN; 5];
    for seed in 0..12 {
        let motion = Routine::Freestyle.motion(&rest, RATE_HZ, seed);
        for pose in motion.poses.iter().take(shown) {
            let (_, j) = BoneTransforms::from_pose(&pose.theta, &rest.joints);
            let now = [
                j[20].y - j[15].y,
                j[12].z - j[0].z,
                -(j[20] - j[1]).length(),
                j[11].y - j[10].y,
                (j[10].x - j[11].x).abs(),
            ];
            for (most, now) in reached.iter_mut().zip(now) {
                *most = most.max(now);
            }
        }
    }
    let [over_head, forwards, to_hip, foot_up, astride] = reached;
    assert!(over_head > 0.2, "a hand over the head: {over_head}");
    assert!(forwards > 0.25, "trunks bend: {forwards}");
    assert!(to_hip > -0.25, "a hand at the hip: {to_hip}");
    assert!(foot_up > 0.25, "a foot is lifted: {foot_up}");
    assert!(astride > 0.35, "a foot goes aside: {astride}");
}
