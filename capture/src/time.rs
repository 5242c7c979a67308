//! When and which: nanoseconds on a source's clock, and running numbers.

use std::ops::Sub;

use serde::{Deserialize, Serialize};

/// Nanoseconds on the source's own clock; only differences mean anything.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize,
)]
pub struct Timestamp(pub u64);

impl Timestamp {
    pub fn from_secs_f64(secs: f64) -> Self {
        Self((secs.max(0.0) * 1e9).round() as u64)
    }

    pub fn as_secs_f64(self) -> f64 {
        self.0 as f64 * 1e-9
    }
}

impl Sub for Timestamp {
    /// Seconds; negative if `self` is the earlier one.
    type Output = f64;

    fn sub(self, earlier: Self) -> f64 {
        (self.0 as i128 - earlier.0 as i128) as f64 * 1e-9
    }
}

/// The running number of a frame in its source, starting at 0; gaps are frames the source lost.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize,
)]
pub struct FrameId(pub u64);
