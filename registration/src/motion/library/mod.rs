//! Movements made from formulas: seeded, smooth, with feet that stay where they are put.
//!
//! Each starts and ends in a relaxed stance facing +z, so that movements can follow one another.

use serde::{Deserialize, Serialize};

use super::{
    Motion, MotionPose, RestBody,
    puppet::{Arm, Foot, Stance},
};

mod arms;
mod ease;
mod freestyle;
mod legs;
mod seat;
mod strikes;
mod style;
mod trunk;
mod turn;

use style::Style;

/// What the simulated person does.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Routine {
    /// Stands, turns once around, walks in place, raises arms, squats, waves: about 20 s.
    #[default]
    Mixture,
    /// One full turn in small steps.
    TurnAround,
    WalkInPlace,
    /// Sideways to horizontal and overhead, then forwards.
    RaiseArms,
    Squat,
    Wave,
    /// Breathes and sways.
    Stand,
    /// Twists the trunk to both sides, then tilts it.
    Twist,
    Punch,
    ShoulderMill,
    /// Circles the hips.
    Hips,
    /// With the right foot, then with the left.
    SoccerKick,
    BallerinaSpin,
    /// Three steps back, three forwards.
    Walk,
    /// Up with one hand, down with the other.
    Reach,
    /// On a chair that is not there, and up again.
    SitDown,
    /// Down in front, and back over the heels.
    Bend,
    ChickenWings,
    FlyingEagle,
    /// Poses drawn at random, one after the other: wherever limbs can go.
    Freestyle,
}

impl Routine {
    /// The everyday ones: what sensors and trackers are tried with.
    pub const ALL: [Self; 7] = [
        Self::Mixture,
        Self::TurnAround,
        Self::WalkInPlace,
        Self::RaiseArms,
        Self::Squat,
        Self::Wave,
        Self::Stand,
    ];

    /// What people do in CAPE, beside the above.
    pub const ACTIONS: [Self; 12] = [
        Self::Twist,
        Self::Punch,
        Self::ShoulderMill,
        Self::Hips,
        Self::SoccerKick,
        Self::BallerinaSpin,
        Self::Walk,
        Self::Reach,
        Self::SitDown,
        Self::Bend,
        Self::ChickenWings,
        Self::FlyingEagle,
    ];

    pub fn name(self) -> &'static str {
        match self {
            Self::Mixture => "mixture",
            Self::TurnAround => "turn_around",
            Self::WalkInPlace => "walk_in_place",
            Self::RaiseArms => "raise_arms",
            Self::Squat => "squat",
            Self::Wave => "wave",
            Self::Stand => "stand",
            Self::Twist => "twist",
            Self::Punch => "punch",
            Self::ShoulderMill => "shoulder_mill",
            Self::Hips => "hips",
            Self::SoccerKick => "soccer_kick",
            Self::BallerinaSpin => "ballerina_spin",
            Self::Walk => "walk",
            Self::Reach => "reach",
            Self::SitDown => "sit_down",
            Self::Bend => "bend",
            Self::ChickenWings => "chicken_wings",
            Self::FlyingEagle => "flying_eagle",
            Self::Freestyle => "freestyle",
        }
    }

    /// The movement as this body does it; the seed varies tempo, size and posture.
    pub fn motion(self, rest: &RestBody, rate_hz: f32, seed: u64) -> Motion {
        let style = Style::sampled(seed);
        let segments = self.segments(&style);
        let total_secs: f32 = segments.iter().map(|segment| segment.secs).sum();
        let count = (total_secs * rate_hz).ceil() as usize + 1;
        let poses = (0..count)
            .map(|i| pose_at(i as f32 / rate_hz, &segments, &style, rest))
            .collect();
        Motion { name: self.name().to_owned(), rate_hz, poses }
    }

    fn segments(self, style: &Style) -> Vec<Segment> {
        let of = |movement: Movement, secs: f32| Segment { movement, secs: secs / style.tempo };
        match self {
            Self::Mixture => vec![
                of(Movement::Stand, 0.8),
                of(Movement::Turn, 8.2),
                of(Movement::Walk, 3.2),
                of(Movement::RaiseArms, 3.6),
                of(Movement::Squat, 2.4),
                of(Movement::Wave, 2.6),
            ],
            Self::TurnAround => vec![of(Movement::Turn, 8.0)],
            Self::WalkInPlace => vec![of(Movement::Walk, 6.0)],
            Self::RaiseArms => {
                vec![
                    of(Movement::RaiseArms, 4.0),
                    of(Movement::RaiseArmsForward, 3.2),
                ]
            }
            Self::Squat => vec![of(Movement::Squat, 2.8), of(Movement::Squat, 2.6)],
            Self::Wave => vec![of(Movement::Wave, 3.5)],
            Self::Stand => vec![of(Movement::Stand, 4.0)],
            Self::Twist => vec![of(Movement::Twist, 8.0)],
            Self::Punch => vec![of(Movement::Punch, 5.6)],
            Self::ShoulderMill => vec![of(Movement::ShoulderMill, 10.0)],
            Self::Hips => vec![of(Movement::Hips, 6.5)],
            Self::SoccerKick => vec![of(Movement::SoccerKick, 5.2)],
            Self::BallerinaSpin => vec![of(Movement::BallerinaSpin, 5.0)],
            Self::Walk => vec![of(Movement::WalkAbout, 6.0)],
            Self::Reach => vec![of(Movement::Reach, 5.6)],
            Self::SitDown => vec![of(Movement::SitDown, 5.0)],
            Self::Bend => vec![of(Movement::Bend, 6.4)],
            Self::ChickenWings => vec![of(Movement::ChickenWings, 5.0)],
            Self::FlyingEagle => vec![of(Movement::FlyingEagle, 6.0)],
            Self::Freestyle => vec![of(Movement::Freestyle, 12.0)],
        }
    }
}

#[derive(Clone, Copy)]
enum Movement {
    Stand,
    Turn,
    Walk,
    RaiseArms,
    RaiseArmsForward,
    Squat,
    Wave,
    Twist,
    Punch,
    ShoulderMill,
    Hips,
    SoccerKick,
    BallerinaSpin,
    WalkAbout,
    Reach,
    SitDown,
    Bend,
    ChickenWings,
    FlyingEagle,
    Freestyle,
}

#[derive(Clone, Copy)]
struct Segment {
    movement: Movement,
    secs: f32,
}

fn pose_at(secs: f32, segments: &[Segment], style: &Style, rest: &RestBody) -> MotionPose {
    let mut stance = style.relaxed(rest);
    style.breathe(secs, &mut stance);
    let mut start_secs = 0.0;
    for (i, segment) in segments.iter().enumerate() {
        let end_secs = start_secs + segment.secs;
        if secs < end_secs || i + 1 == segments.len() {
            let moment =
                Moment { secs: (secs - start_secs).min(segment.secs), of_secs: segment.secs };
            apply(segment.movement, moment, style, rest, &mut stance);
            break;
        }
        start_secs = end_secs;
    }
    stance.solve(rest)
}

/// A time within a movement.
#[derive(Clone, Copy)]
struct Moment {
    secs: f32,
    of_secs: f32,
}

impl Moment {
    /// From 0 to 1.
    fn share(self) -> f32 {
        (self.secs / self.of_secs).clamp(0.0, 1.0)
    }
}

fn apply(movement: Movement, at: Moment, style: &Style, rest: &RestBody, stance: &mut Stance) {
    match movement {
        Movement::Stand => {}
        Movement::Turn => turn::turn_around(at, style, rest, stance),
        Movement::Walk => legs::walk_in_place(at, style, rest, stance),
        Movement::RaiseArms => arms::raise_sideways(at, style, stance),
        Movement::RaiseArmsForward => arms::raise_forwards(at, style, stance),
        Movement::Squat => legs::squat(at, style, rest, stance),
        Movement::Wave => arms::wave(at, style, stance),
        Movement::Twist => trunk::twist(at, style, stance),
        Movement::Punch => strikes::punch(at, style, stance),
        Movement::ShoulderMill => arms::shoulder_mill(at, style, stance),
        Movement::Hips => trunk::hips(at, style, rest, stance),
        Movement::SoccerKick => strikes::soccer_kick(at, style, rest, stance),
        Movement::BallerinaSpin => turn::ballerina_spin(at, style, rest, stance),
        Movement::WalkAbout => legs::walk(at, style, stance),
        Movement::Reach => strikes::reach(at, style, rest, stance),
        Movement::SitDown => seat::sit_down(at, style, rest, stance),
        Movement::Bend => trunk::bend(at, style, rest, stance),
        Movement::ChickenWings => arms::chicken_wings(at, style, stance),
        Movement::FlyingEagle => arms::flying_eagle(at, style, stance),
        Movement::Freestyle => freestyle::freestyle(at, style, rest, stance),
    }
}

#[cfg(test)]
mod tests;
