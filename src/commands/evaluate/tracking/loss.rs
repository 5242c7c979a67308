//! People who go and come back: when, how, and what tracking made of it.

use std::sync::Arc;

use effigy_capture::{DepthImage, Frame};
use effigy_sim_sensor::Scenario;

use super::score::{FrameScore, LossScore};

/// What one frame shows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Moment {
    /// The moment of the scenario's movement.
    pub(super) content: u64,
    pub(super) vanished: Option<Vanishing>,
}

/// How a person disappears.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Vanishing {
    /// Out of the room.
    Left,
    /// Behind a board as tall as a door and wider than outstretched elbows.
    Hidden,
    /// A hand lies on the lens: something near everywhere, or nothing at all.
    Covered { blind: bool },
}

/// Frames of being there and of being away, shortest and longest.
const PRESENT: [u64; 2] = [20, 50];
const AWAY: [u64; 2] = [9, 60];
/// Who comes back is somewhere else in the movement: up to this many frames on.
const JUMP: u64 = 400;
/// After the last return.
const END: u64 = 25;

/// Seeded disappearances, one after the other.
pub(super) fn schedule(scenario: &Scenario, count: usize) -> Vec<Moment> {
    let mut random =
        Draws(scenario.seed ^ (scenario.outfit as u64) << 8 ^ (scenario.sensor as u64) << 16);
    let mut moments = Vec::new();
    let mut content = random.between([0, JUMP]);
    let mut pass = |frames: u64, vanished: Option<Vanishing>, content: &mut u64| {
        for _ in 0..frames {
            moments.push(Moment { content: *content, vanished });
            *content += 1;
        }
    };
    for _ in 0..count {
        pass(random.between(PRESENT), None, &mut content);
        let how = match random.between([0, 3]) {
            0 => Vanishing::Left,
            1 => Vanishing::Hidden,
            2 => Vanishing::Covered { blind: true },
            _ => Vanishing::Covered { blind: false },
        };
        pass(random.between(AWAY), Some(how), &mut content);
        content += random.between([0, JUMP]);
    }
    pass(END, None, &mut content);
    moments
}

/// How each disappearance went.
pub(super) fn losses_of(moments: &[Moment], frames: &[FrameScore]) -> Vec<LossScore> {
    let away = |i: usize| moments[i].vanished.is_some();
    let ends = |from: usize, of: bool| {
        (from..moments.len())
            .find(|&i| away(i) != of)
            .unwrap_or(moments.len())
    };
    let mut losses = Vec::new();
    let mut at = ends(0, false);
    while at < moments.len() {
        let back = ends(at, true);
        let gone_again = ends(back, false);
        let secs_since =
            |from: usize, i: usize| (frames[i].timestamp - frames[from].timestamp) as f32;
        losses.push(LossScore {
            noticed_secs: (at..back)
                .find(|&i| frames[i].state != super::score::State::Tracked)
                .map(|i| secs_since(at, i)),
            reacquired_secs: (back..gone_again)
                .find(|&i| frames[i].truly_tracked())
                .map(|i| secs_since(back, i)),
        });
        at = gone_again;
    }
    losses
}

impl Vanishing {
    /// The frame with the obstacle in front.
    pub(super) fn applied(self, frame: &Frame, scenario: &Scenario) -> anyhow::Result<Frame> {
        /// Half a board's width and height, and its distance.
        const BOARD_M: [f32; 3] = [0.65, 1.15, 1.30];
        const HAND_M: f32 = 0.35;
        /// Millimetres that a flat thing's depth wavers by.
        const WAVER: u64 = 3;
        let camera = scenario.sensor.intrinsics();
        let units = |metres: f32| metres / scenario.sensor.calibration().metres_per_unit;
        let (width, height) = (frame.depth.width(), frame.depth.height());
        let mut random = Draws(frame.id.0);
        let mut raw = frame.depth.pixels().to_vec();
        for (i, pixel) in raw.iter_mut().enumerate() {
            let x = ((i as u32 % width) as f32 - camera.cx) / camera.fx;
            let y = ((i as u32 / width) as f32 - camera.cy) / camera.fy;
            let flat = |metres: f32, random: &mut Draws| {
                units(metres) as u16 + random.between([0, 2 * WAVER]) as u16
            };
            match self {
                Self::Left => {}
                Self::Hidden => {
                    if x.abs() * BOARD_M[2] < BOARD_M[0] && y.abs() * BOARD_M[2] < BOARD_M[1] {
                        *pixel = flat(BOARD_M[2], &mut random);
                    }
                }
                Self::Covered { blind: true } => *pixel = 0,
                Self::Covered { blind: false } => {
                    *pixel = flat(HAND_M * (1.0 + 0.2 * x), &mut random);
                }
            }
        }
        Ok(Frame { depth: Arc::new(DepthImage::new(width, height, raw)?), ..frame.clone() })
    }
}

/// `SplitMix64`: small, and the same on every machine.
struct Draws(u64);

impl Draws {
    /// A whole number of a closed range.
    fn between(&mut self, [low, high]: [u64; 2]) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        low + (z ^ (z >> 31)) % (high - low + 1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_schedule_has_as_many_losses_as_asked_for_and_repeats() {
        let scenario = Scenario::default();
        let moments = schedule(&scenario, 7);
        let starts = moments
            .windows(2)
            .filter(|pair| pair[0].vanished.is_none() && pair[1].vanished.is_some())
            .count();
        assert_eq!(starts, 7);
        assert_eq!(moments, schedule(&scenario, 7));
        let other = Scenario { seed: 5, ..scenario };
        assert_ne!(moments, schedule(&other, 7));
    }
}
