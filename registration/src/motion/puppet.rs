//! From what a mover thinks of (where the feet stand, how far the arms are raised) to SMPL's joint rotations.

use std::f32::consts::PI;

use glam::{Mat3, Quat, Vec2, Vec3, vec3};

use super::{MotionPose, RestBody, short_axis_angle};
use crate::smpl::{JOINT_COUNT, PARENTS};

/// Legs are never stretched further than this share of their length: a straight knee snaps.
const MAX_STRETCH: f32 = 0.995;
/// The collar bone takes this share of an arm's movement away from a hanging arm.
const COLLAR_SHARE: f32 = 0.22;
/// Limits a healthy adult keeps while exercising, in radians.
const ELBOW_LIMIT_RAD: f32 = 2.5;
const ABDUCTION_LIMIT_RAD: f32 = 2.95;
/// Of a foot that stands on nothing: it turns with the shin before its ankle bends further.
const FREE_ANKLE_LIMIT_RAD: f32 = 0.88;
/// So far off the floor a foot is free; on the way there the limit tightens.
const FREE_LIFT_M: f32 = 0.04;

/// One moment of a movement, in words a mover would use. Metres and radians.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stance {
    /// Which way the pelvis faces: 0 is +z, a quarter turn is +x (the world's left of somebody facing +z).
    pub(super) heading_rad: f32,
    /// From the standing pelvis, in the heading's frame: left, up, forward.
    pub(super) pelvis_shift_m: Vec3,
    /// Forward lean, twist to the left, lean to the right, as axis-angle in the heading's frame.
    pub(super) pelvis_tilt: Vec3,
    pub(super) feet: [Foot; 2],
    /// As `pelvis_tilt`, shared among the three spine joints.
    pub(super) spine: Vec3,
    /// As `pelvis_tilt`, shared between neck and head.
    pub(super) head: Vec3,
    pub(super) arms: [Arm; 2],
}

/// Where a foot is: its ball on the floor, or lifted from it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Foot {
    /// World x and z of the ball of the foot.
    pub(super) ball_m: Vec2,
    pub(super) lift_m: f32,
    pub(super) yaw_rad: f32,
    /// Heel up is positive.
    pub(super) pitch_rad: f32,
}

/// An arm, the same for both sides.
#[expect(
    clippy::struct_field_names,
    reason = "a number's name ends in its unit"
)]
#[derive(Clone, Copy, Debug)]
pub(super) struct Arm {
    /// Sideways from hanging (0) over horizontal (pi/2) to overhead.
    pub(super) abduction_rad: f32,
    /// Forwards.
    pub(super) flexion_rad: f32,
    /// About the upper arm; negative turns a bent forearm upwards when the arm is out sideways.
    pub(super) twist_rad: f32,
    pub(super) elbow_rad: f32,
}

impl Stance {
    /// The pose of a body of these proportions; its lowest point is on the floor.
    pub(super) fn solve(&self, rest: &RestBody) -> MotionPose {
        let mut rotations = [Quat::IDENTITY; JOINT_COUNT];
        let heading = Quat::from_rotation_y(self.heading_rad);
        rotations[0] = heading * Quat::from_scaled_axis(self.pelvis_tilt);
        self.bend_spine(&mut rotations);
        for side in 0..2 {
            self.set_arm(side, &mut rotations);
        }
        let ankles: [AnkleTarget; 2] =
            std::array::from_fn(|side| self.feet[side].ankle(side, rest));
        let pelvis = self.reachable_pelvis(rest, heading, rotations[0], &ankles);
        for (side, ankle) in ankles.iter().enumerate() {
            self.feet[side].set_leg(side, pelvis, ankle, rest, &mut rotations);
        }
        let theta = rotations.map(short_axis_angle);
        let mut trans = pelvis - rest.joints[0];
        trans.y = -rest.lowest_point_m(&theta);
        MotionPose { theta, trans }
    }

    fn bend_spine(&self, rotations: &mut [Quat; JOINT_COUNT]) {
        for (joint, share) in [(3, 0.35), (6, 0.35), (9, 0.3)] {
            rotations[joint] = Quat::from_scaled_axis(self.spine * share);
        }
        for (joint, share) in [(12, 0.45), (15, 0.55)] {
            rotations[joint] = Quat::from_scaled_axis(self.head * share);
        }
    }

    fn set_arm(&self, side: usize, rotations: &mut [Quat; JOINT_COUNT]) {
        let arm = &self.arms[side];
        let (collar, shoulder, elbow) = arm.left_rotations();
        let of_side = |q: Quat| if side == 0 { q } else { mirrored(q) };
        rotations[13 + side] = of_side(collar);
        rotations[16 + side] = of_side(shoulder);
        rotations[18 + side] = of_side(elbow);
    }

    /// The pelvis where the stance wants it, lowered until both feet can be reached.
    fn reachable_pelvis(
        &self,
        rest: &RestBody,
        heading: Quat,
        rotation: Quat,
        ankles: &[AnkleTarget; 2],
    ) -> Vec3 {
        let standing_m = rest.joints[0].y - rest.sole_height_m();
        let mut pelvis = heading * self.pelvis_shift_m + Vec3::Y * standing_m;
        for (side, ankle) in ankles.iter().enumerate() {
            let hip = rotation * (rest.joints[1 + side] - rest.joints[0]);
            let reach = MAX_STRETCH * leg_lengths_m(side, rest).iter().sum::<f32>();
            let aside = pelvis + hip - ankle.position;
            let rise = (reach * reach - aside.x * aside.x - aside.z * aside.z)
                .max(0.0)
                .sqrt();
            pelvis.y = pelvis.y.min(ankle.position.y + rise - hip.y);
        }
        pelvis
    }
}

impl Foot {
    /// Where the ankle has to be, and how the foot is turned, for the ball to be where it is.
    fn ankle(&self, side: usize, rest: &RestBody) -> AnkleTarget {
        let rotation = Quat::from_rotation_y(self.yaw_rad) * Quat::from_rotation_x(self.pitch_rad);
        self.ankle_turned(rotation, side, rest)
    }

    /// As [`Self::ankle`], for a foot that is turned otherwise than it wants to be.
    fn ankle_turned(&self, rotation: Quat, side: usize, rest: &RestBody) -> AnkleTarget {
        let (ankle, ball) = (rest.joints[7 + side], rest.joints[10 + side]);
        let ball_height_m = ball.y - rest.sole_height_m() + self.lift_m;
        let ball_in_world = vec3(self.ball_m.x, ball_height_m, self.ball_m.y);
        AnkleTarget { position: ball_in_world + rotation * (ankle - ball), rotation }
    }

    /// The leg that carries this foot. A free one gives way to the shin, its ball where it is as far as the leg reaches.
    fn set_leg(
        &self,
        side: usize,
        pelvis: Vec3,
        ankle: &AnkleTarget,
        rest: &RestBody,
        rotations: &mut [Quat; JOINT_COUNT],
    ) {
        // Turning the foot moves the ankle, and with it the shin: less each time.
        const ROUNDS: usize = 3;
        let mut shin = bend_leg(side, pelvis, ankle, self.pitch_rad, rest, rotations);
        let free = (self.lift_m / FREE_LIFT_M).clamp(0.0, 1.0);
        let limit_rad = PI + (FREE_ANKLE_LIMIT_RAD - PI) * free;
        for _ in 0..ROUNDS {
            let bend = short_axis_angle(rotations[7 + side]);
            if bend.length() <= limit_rad {
                return;
            }
            let within = Quat::from_scaled_axis(bend.clamp_length_max(limit_rad));
            let turned = self.ankle_turned(shin * within, side, rest);
            shin = bend_leg(side, pelvis, &turned, self.pitch_rad, rest, rotations);
        }
        let bend = short_axis_angle(rotations[7 + side]);
        rotations[7 + side] = Quat::from_scaled_axis(bend.clamp_length_max(limit_rad));
    }
}

impl Arm {
    /// Collar, shoulder and elbow of a left arm, relative to their parents.
    fn left_rotations(self) -> (Quat, Quat, Quat) {
        let abduction = self.abduction_rad.min(ABDUCTION_LIMIT_RAD);
        let hanging = vec3(abduction.sin(), -abduction.cos(), 0.0);
        let direction = Quat::from_rotation_x(-self.flexion_rad) * hanging;
        let whole = Quat::from_rotation_arc(Vec3::X, direction.normalize_or(Vec3::X))
            * Quat::from_rotation_x(self.twist_rad);
        // Elevation above horizontal, which is the zero pose.
        let collar =
            Quat::from_rotation_z(COLLAR_SHARE * direction.y.clamp(-1.0, 1.0).asin().max(-0.6));
        let elbow = Quat::from_rotation_y(-self.elbow_rad.clamp(0.0, ELBOW_LIMIT_RAD));
        (collar, collar.inverse() * whole, elbow)
    }
}

struct AnkleTarget {
    position: Vec3,
    rotation: Quat,
}

/// Two-bone inverse kinematics; the knee points where pelvis and foot point on average. Returns world from shin.
fn bend_leg(
    side: usize,
    pelvis: Vec3,
    ankle: &AnkleTarget,
    pitch_rad: f32,
    rest: &RestBody,
    rotations: &mut [Quat; JOINT_COUNT],
) -> Quat {
    let [hip_joint, knee_joint, ankle_joint] = [1 + side, 4 + side, 7 + side];
    let hip = pelvis + rotations[0] * (rest.joints[hip_joint] - rest.joints[0]);
    let [thigh_m, shin_m] = leg_lengths_m(side, rest);
    let forward = rotations[0] * Vec3::Z + ankle.rotation * Vec3::Z;
    let knee = knee_position(hip, ankle.position, [thigh_m, shin_m], forward);
    // The hinge points to the left, as x does in the zero pose.
    let hinge = forward.cross(ankle.position - hip).normalize_or(Vec3::X);
    let bone = |from: usize, to: usize, direction: Vec3| {
        let at_rest = hinge_frame(rest.joints[to] - rest.joints[from], Vec3::X);
        Quat::from_mat3(&(hinge_frame(direction, hinge) * at_rest.transpose())).normalize()
    };
    let thigh = bone(hip_joint, knee_joint, knee - hip);
    let shin = bone(knee_joint, ankle_joint, ankle.position - knee);
    rotations[hip_joint] = rotations[PARENTS[hip_joint]].inverse() * thigh;
    rotations[knee_joint] = thigh.inverse() * shin;
    rotations[ankle_joint] = shin.inverse() * ankle.rotation;
    // Toes stay flat while the heel rises.
    rotations[10 + side] = Quat::from_rotation_x(-pitch_rad.clamp(0.0, 0.6));
    shin
}

fn knee_position(hip: Vec3, ankle: Vec3, [thigh_m, shin_m]: [f32; 2], forward: Vec3) -> Vec3 {
    let down = ankle - hip;
    let distance = down.length().clamp(1e-3, (thigh_m + shin_m) * 0.9999);
    let axis = down.normalize_or(Vec3::NEG_Y);
    let along = (distance * distance + thigh_m * thigh_m - shin_m * shin_m) / (2.0 * distance);
    let aside = (thigh_m * thigh_m - along * along).max(0.0).sqrt();
    let bend = forward.reject_from(axis).normalize_or(Vec3::Z);
    hip + axis * along + bend * aside
}

/// Columns: the hinge made orthogonal, the bone's direction, and what is orthogonal to both.
fn hinge_frame(direction: Vec3, hinge: Vec3) -> Mat3 {
    let direction = direction.normalize_or(Vec3::NEG_Y);
    let hinge = hinge.reject_from(direction).normalize_or(Vec3::X);
    Mat3::from_cols(hinge, direction, hinge.cross(direction))
}

fn leg_lengths_m(side: usize, rest: &RestBody) -> [f32; 2] {
    let length = |from: usize, to: usize| rest.joints[from].distance(rest.joints[to]);
    [length(1 + side, 4 + side), length(4 + side, 7 + side)]
}

/// The same rotation on the body's other side.
fn mirrored(q: Quat) -> Quat {
    Quat::from_xyzw(q.x, -q.y, -q.z, q.w)
}
