//! Frames in any order from a simulation that only runs forwards: states are kept at intervals.

use std::collections::BTreeMap;

use effigy_registration::motion::MotionPose;

use super::wear::{ClothState, Wear};

/// States kept at most; beyond that every other one is dropped.
const MAX_KEYS: usize = 64;

/// A movement in clothes.
#[derive(Clone, Debug)]
pub struct Tape {
    wear: Wear,
    secs_per_frame: f32,
    at: Option<u64>,
    keys: BTreeMap<u64, ClothState>,
    /// Frames between kept states.
    spacing: u64,
}

impl Tape {
    pub fn new(wear: Wear, rate_hz: f32) -> Self {
        Self {
            wear,
            secs_per_frame: rate_hz.recip(),
            at: None,
            keys: BTreeMap::new(),
            spacing: 16,
        }
    }

    /// The clothes in a frame. The first call puts them on and lets them settle in frame 0; going forwards
    /// costs one step a frame, going back a few from the last kept state. The same frame is the same to the
    /// last bit, however it was reached.
    pub fn at(&mut self, frame: u64, pose_of: impl Fn(u64) -> MotionPose) -> &Wear {
        if self.keys.is_empty() {
            self.wear.start(&pose_of(0));
            self.at = Some(0);
            self.keys.insert(0, self.wear.state());
        }
        let mut now = self.at.unwrap_or(0);
        if let Some((&key, state)) = self.keys.range(..=frame).next_back()
            && (now > frame || key > now)
        {
            self.wear.restore(state);
            now = key;
        }
        while now < frame {
            now += 1;
            self.wear.step(&pose_of(now), self.secs_per_frame);
            if now.is_multiple_of(self.spacing) && !self.keys.contains_key(&now) {
                self.keys.insert(now, self.wear.state());
                self.thin_out();
            }
        }
        self.at = Some(now);
        &self.wear
    }

    fn thin_out(&mut self) {
        if self.keys.len() > MAX_KEYS {
            self.spacing *= 2;
            let spacing = self.spacing;
            self.keys.retain(|frame, _| frame.is_multiple_of(spacing));
        }
    }
}
