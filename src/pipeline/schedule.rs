//! When avatars are begun and take over: decided live, or as a recording says it was decided.

use std::collections::VecDeque;

use anyhow::Context as _;
use effigy_capture::{FrameId, recording::Event};
use serde::{Deserialize, Serialize};

/// The recording's event that carries a [`Decided`].
pub(crate) const DECISION_EVENT: &str = "effigy.avatar";

/// What can happen to the avatar between two frames.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Decision {
    /// Fine-tuning starts with the keyframes there are.
    Begin,
    /// What the avatar that was begun has learned so far is driven from this frame on.
    Preview,
    /// The avatar that was begun is driven from this frame on.
    TakeOver,
    Cancel,
    StartOver,
}

/// A decision and the frame it took effect with.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Decided {
    pub(crate) frame: u64,
    pub(crate) decision: Decision,
}

/// Who decides.
#[derive(Clone, Debug)]
pub(crate) enum Schedule {
    /// Previews and avatars are shown fixed numbers of frames after they were begun, waited for if need be: repeatable.
    AfterFrames,
    /// Avatars take over as soon as they are there: live.
    WhenReady,
    /// What a live run decided happens again, at the same frames.
    AsRecorded(VecDeque<Decided>),
}

impl Schedule {
    /// The schedule that a recording's events hold; `None` if it was made without an avatar.
    pub(crate) fn recorded(events: &[Event]) -> anyhow::Result<Option<Self>> {
        let decided: VecDeque<Decided> = events
            .iter()
            .filter(|event| event.name == DECISION_EVENT)
            .map(|event| serde_json::from_value(event.value.clone()))
            .collect::<Result<_, _>>()
            .context("an event of the recording says something about the avatar that this version does not know")?;
        Ok((!decided.is_empty()).then_some(Self::AsRecorded(decided)))
    }

    /// What is due at a frame by the record.
    pub(crate) fn due(&mut self, frame: FrameId) -> Vec<Decision> {
        let Self::AsRecorded(decided) = self else {
            return Vec::new();
        };
        let due = decided.partition_point(|next| next.frame <= frame.0);
        decided.drain(..due).map(|next| next.decision).collect()
    }
}

#[cfg(test)]
mod tests {
    use effigy_capture::Timestamp;
    use serde_json::json;

    use super::*;

    fn event(name: &str, value: serde_json::Value) -> Event {
        Event { name: name.to_owned(), timestamp: Timestamp(0), value }
    }

    #[test]
    fn decisions_come_back_at_their_frames_and_once() {
        let events = [
            event(DECISION_EVENT, json!({"frame": 10, "decision": "begin"})),
            event("something else", json!(7)),
            event(
                DECISION_EVENT,
                json!({"frame": 40, "decision": "take_over"}),
            ),
        ];
        let mut schedule = Schedule::recorded(&events).unwrap().unwrap();
        assert_eq!(schedule.due(FrameId(9)), []);
        assert_eq!(schedule.due(FrameId(10)), [Decision::Begin]);
        assert_eq!(schedule.due(FrameId(10)), []);
        // Frame 40 could not be read: the next one stands in for it.
        assert_eq!(schedule.due(FrameId(41)), [Decision::TakeOver]);
    }

    #[test]
    fn a_recording_without_decisions_has_no_schedule_and_an_unknown_one_is_refused() {
        assert!(Schedule::recorded(&[]).unwrap().is_none());
        let unknown = [event(
            DECISION_EVENT,
            json!({"frame": 1, "decision": "dance"}),
        )];
        assert!(Schedule::recorded(&unknown).is_err());
    }
}
