//! Poses drawn at random, one after the other: each arm, the trunk and the legs in their own time.

use glam::{Vec2, Vec3, vec2};

use super::{
    Arm, Moment, RestBody, Stance,
    arms::{blend_arm, hand_on_hip},
    ease::{smooth, window},
    style::Style,
};

/// From one pose of an arm, of the trunk or of the legs to the next.
const POSE_SECS: f32 = 1.2;
/// At the start and the end, as a share of the whole.
const FLANK: f32 = 0.06;

/// Where arms can go; any two of these are mixed.
const ARMS: [Arm; 10] = [
    arm(0.35, 0.10, 0.10, 0.30),
    arm(0.40, -0.55, 0.00, 0.25),
    arm(0.34, 0.80, -0.50, 1.70),
    arm(0.16, 1.50, 0.00, 0.22),
    arm(0.20, 2.40, 0.00, 0.20),
    arm(1.55, 0.05, 0.00, 0.10),
    arm(2.60, 0.10, -0.80, 0.30),
    arm(1.45, 0.20, -1.30, 1.50),
    arm(1.05, 0.00, 0.80, 1.60),
    hand_on_hip(),
];

const fn arm(abduction_rad: f32, flexion_rad: f32, twist_rad: f32, elbow_rad: f32) -> Arm {
    Arm { abduction_rad, flexion_rad, twist_rad, elbow_rad }
}

/// A number of the style's own for each pose, and for each of its parts.
#[derive(Clone, Copy)]
struct Draw<'a> {
    style: &'a Style,
    pose: u64,
}

impl Draw<'_> {
    fn between(self, part: u64, low: f32, high: f32) -> f32 {
        low + (high - low) * self.style.uniform(self.pose * 64 + part)
    }

    fn arm(self, side: usize) -> Arm {
        let first = 8 * side as u64;
        let kind = |part| {
            let number = self.between(part, 0.0, ARMS.len() as f32) as usize;
            ARMS[number.min(ARMS.len() - 1)]
        };
        let mixed = self.between(first + 2, 0.0, 1.0);
        blend_arm(kind(first), kind(first + 1), mixed)
    }

    fn trunk(self) -> Trunk {
        let forwards = self.between(16, -0.3, 1.0);
        Trunk {
            spine: Vec3::new(
                forwards,
                self.between(17, -0.8, 0.8),
                self.between(18, -0.45, 0.45),
            ),
            tilt: Vec3::new(
                (0.5 * forwards).max(-0.05),
                self.between(19, -0.2, 0.2),
                self.between(20, -0.08, 0.08),
            ),
            head: Vec3::new(
                self.between(21, -0.35, 0.35),
                self.between(22, -0.5, 0.5),
                self.between(23, -0.2, 0.2),
            ),
        }
    }

    /// Every other stance is on both feet: one comes down before the other goes up.
    fn legs(self) -> Legs {
        let depth = self.between(24, -0.5, 0.95).max(0.0);
        let mut legs = Legs { depth, ..Legs::default() };
        if self.pose.is_multiple_of(2) {
            return legs;
        }
        let side = usize::from(self.between(25, 0.0, 1.0) < 0.5);
        let lift = self.between(26, 0.05, 0.42);
        legs.feet[side] = RaisedFoot {
            away: vec2(self.between(27, 0.0, 0.35), self.between(28, -0.45, 0.50)),
            lift,
            pitch_rad: self.between(29, 0.0, 1.0) * lift / 0.42,
        };
        legs.depth *= 0.4;
        legs
    }
}

#[derive(Clone, Copy, Default)]
struct Trunk {
    spine: Vec3,
    tilt: Vec3,
    head: Vec3,
}

impl Trunk {
    fn lerp(self, to: Self, share: f32) -> Self {
        Self {
            spine: self.spine.lerp(to.spine, share),
            tilt: self.tilt.lerp(to.tilt, share),
            head: self.head.lerp(to.head, share),
        }
    }
}

/// Lengths are shares of the leg's.
#[derive(Clone, Copy, Default)]
struct Legs {
    /// How far the knees bend, of a squat.
    depth: f32,
    feet: [RaisedFoot; 2],
}

#[derive(Clone, Copy, Default)]
struct RaisedFoot {
    /// Outwards and forwards from where it stands.
    away: Vec2,
    lift: f32,
    pitch_rad: f32,
}

impl Legs {
    fn lerp(self, to: Self, share: f32) -> Self {
        let foot = |side: usize| {
            let (from, to) = (self.feet[side], to.feet[side]);
            RaisedFoot {
                away: from.away.lerp(to.away, share),
                lift: from.lift + (to.lift - from.lift) * share,
                pitch_rad: from.pitch_rad + (to.pitch_rad - from.pitch_rad) * share,
            }
        };
        Self { depth: self.depth + (to.depth - self.depth) * share, feet: [foot(0), foot(1)] }
    }
}

/// What something does at a time: mixed from the pose drawn last and the next one; the first is the relaxed one.
/// `late` is in poses.
fn at_time<P>(
    secs: f32,
    late: f32,
    relaxed: P,
    drawn: impl Fn(u64) -> P,
    mixed: impl Fn(P, P, f32) -> P,
) -> P {
    let at = (secs / POSE_SECS - late).max(0.0);
    let before = at.floor();
    let number = before as u64;
    let from = if number == 0 { relaxed } else { drawn(number) };
    mixed(from, drawn(number + 1), smooth(at - before))
}

pub(super) fn freestyle(at: Moment, style: &Style, rest: &RestBody, stance: &mut Stance) {
    let going = window(at.share(), 0.0, 1.0, FLANK);
    let draw = |pose| Draw { style, pose };
    for (side, arm) in stance.arms.iter_mut().enumerate() {
        let late = 0.3 * side as f32;
        let now = at_time(at.secs, late, *arm, |pose| draw(pose).arm(side), blend_arm);
        *arm = blend_arm(*arm, now, going);
    }
    let relaxed = Trunk::default();
    let trunk = at_time(
        at.secs,
        0.15,
        relaxed,
        |pose| draw(pose).trunk(),
        Trunk::lerp,
    );
    stance.spine += trunk.spine * going;
    stance.pelvis_tilt += trunk.tilt * going;
    stance.head += trunk.head * going;
    let relaxed = Legs::default();
    let legs = at_time(at.secs, 0.0, relaxed, |pose| draw(pose).legs(), Legs::lerp);
    stand(legs, trunk, going, rest, stance);
}

/// Puts the feet where they are to be, and the pelvis over them.
fn stand(legs: Legs, trunk: Trunk, going: f32, rest: &RestBody, stance: &mut Stance) {
    let leg_m = rest.joints[1].y - rest.joints[7].y;
    let squat = legs.depth * going;
    let leaning = trunk.tilt.x.max(0.0) * going;
    stance.pelvis_shift_m += Vec3::new(0.0, -0.42 * squat, -0.24 * squat - 0.25 * leaning) * leg_m;
    stance.pelvis_tilt.x += 0.3 * squat;
    for (side, sign) in [(0, 1.0f32), (1, -1.0)] {
        let raised = legs.feet[side];
        let lifted = smooth(raised.lift / 0.10) * going;
        let standing_x = stance.feet[1 - side].ball_m.x;
        stance.pelvis_shift_m.x += 0.9 * standing_x * lifted;
        let foot = &mut stance.feet[side];
        foot.ball_m += vec2(sign * raised.away.x, raised.away.y) * leg_m * lifted;
        foot.lift_m += raised.lift * leg_m * going;
        foot.pitch_rad += raised.pitch_rad * going;
    }
}
