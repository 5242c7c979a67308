//! When a recorded frame is due. No clock in here: the caller says what time it is, and does the waiting.

use std::time::Duration;

use crate::time::Timestamp;

/// A step of the source's clock larger than this, forwards or backwards, is a seek, a loop or a pause, not a wait.
const MAX_GAP_SECS: f64 = 5.0;

/// What to do with the next frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Due {
    /// It is early: wait this long, then deliver it.
    Wait(Duration),
    /// Deliver it now; it is this late.
    Now { late: Duration },
}

/// Maps a recording's times to the caller's, so that frames come as fast as they were taken.
#[derive(Clone, Debug)]
pub struct Pacer {
    speed: f64,
    anchor: Option<Anchor>,
}

/// A frame's time and when it was due, with the frame that was asked for last.
#[derive(Clone, Copy, Debug)]
struct Anchor {
    recorded: Timestamp,
    now: Duration,
    last: Timestamp,
}

impl Pacer {
    /// `speed` 1 is real time, 2 is twice as fast.
    pub fn new(speed: f64) -> Self {
        let speed = if speed.is_finite() && speed > 0.0 {
            speed
        } else {
            1.0
        };
        Self { speed, anchor: None }
    }

    /// Whether the frame of a time is due at `now` (time since any moment, always the same). The first frame is due at once,
    /// and so is the one after a jump of the recording's clock.
    pub fn due(&mut self, frame: Timestamp, now: Duration) -> Due {
        let jumped = |anchor: &Anchor| {
            let step = frame - anchor.last;
            !(0.0..=MAX_GAP_SECS).contains(&step)
        };
        let mut anchor = match self.anchor {
            Some(anchor) if !jumped(&anchor) => anchor,
            _ => Anchor { recorded: frame, now, last: frame },
        };
        anchor.last = frame;
        self.anchor = Some(anchor);
        let due = anchor.now.as_secs_f64() + (frame - anchor.recorded) / self.speed;
        let early = due - now.as_secs_f64();
        let length = Duration::from_secs_f64(early.abs());
        if early > 0.0 {
            Due::Wait(length)
        } else {
            Due::Now { late: length }
        }
    }

    /// The next frame is due at once: call it after a pause or a seek.
    pub fn restart(&mut self) {
        self.anchor = None;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(millis: u64) -> Timestamp {
        Timestamp(1_700_000_000_000_000_000 + millis * 1_000_000)
    }

    const fn ms(millis: u64) -> Duration {
        Duration::from_millis(millis)
    }

    /// f64 seconds keep times within a day to a nanosecond.
    fn assert_due(got: Due, expected: Due) {
        let signed = |due| match due {
            Due::Wait(wait) => wait.as_secs_f64(),
            Due::Now { late } => -late.as_secs_f64(),
        };
        approx::assert_abs_diff_eq!(signed(got), signed(expected), epsilon = 1e-8);
    }

    #[test]
    fn frames_come_as_far_apart_as_they_were_taken() {
        let mut pacer = Pacer::new(1.0);
        assert_due(pacer.due(at(0), ms(500)), Due::Now { late: ms(0) });
        assert_due(pacer.due(at(33), ms(510)), Due::Wait(ms(23)));
        assert_due(pacer.due(at(66), ms(580)), Due::Now { late: ms(14) });
        // A late frame does not shift those after it.
        assert_due(pacer.due(at(100), ms(581)), Due::Wait(ms(19)));
        assert_due(Pacer::new(2.0).due(at(0), ms(0)), Due::Now { late: ms(0) });
    }

    #[test]
    fn twice_the_speed_halves_the_wait() {
        let mut pacer = Pacer::new(2.0);
        pacer.due(at(0), ms(0));
        assert_due(pacer.due(at(100), ms(0)), Due::Wait(ms(50)));
    }

    #[test]
    fn loops_gaps_and_restarts_begin_anew() {
        let mut pacer = Pacer::new(1.0);
        pacer.due(at(0), ms(0));
        pacer.due(at(1000), ms(0));
        for (frame, now) in [(0, 1033), (60_000, 1066), (59_000, 1070)] {
            assert_due(pacer.due(at(frame), ms(now)), Due::Now { late: ms(0) });
        }
        pacer.restart();
        assert_due(pacer.due(at(59_033), ms(99_000)), Due::Now { late: ms(0) });
    }
}
