//! A run as a recording: the frames that were looked at and what was decided, so that a replay repeats it.

use std::{collections::BTreeMap, path::Path};

use anyhow::Context as _;
use effigy_capture::{Calibration, Frame, recording::RecordingWriter};

use super::schedule::{DECISION_EVENT, Decided, Decision};
use crate::say::say;

/// Whether the chain waits for the disk.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum WhenDiskIsSlow {
    Wait,
    /// Live: a frame is left out, counted and reported.
    LeaveOut,
}

pub(crate) struct Recorder {
    writer: RecordingWriter,
    when_slow: WhenDiskIsSlow,
}

impl Recorder {
    pub(crate) fn create(
        path: &Path,
        calibration: &Calibration,
        metadata: &BTreeMap<String, String>,
        when_slow: WhenDiskIsSlow,
    ) -> anyhow::Result<Self> {
        let writer = RecordingWriter::create(path, calibration, metadata)?;
        Ok(Self { writer, when_slow })
    }

    pub(crate) fn add(&self, frame: &Frame, decided: &[Decision]) -> anyhow::Result<()> {
        match self.when_slow {
            WhenDiskIsSlow::Wait => self.writer.push_blocking(frame)?,
            // The writer counts what it left out.
            WhenDiskIsSlow::LeaveOut => drop(self.writer.push(frame)?),
        }
        for decision in decided {
            let decided = Decided { frame: frame.id.0, decision: *decision };
            let value = serde_json::to_value(decided).context("a decision is plain data")?;
            self.writer.event(DECISION_EVENT, frame.timestamp, &value)?;
        }
        Ok(())
    }

    /// Closes the file and says what is in it.
    pub(crate) fn finish(self) -> anyhow::Result<()> {
        let summary = self.writer.finish()?;
        say!(
            "{}: {} frames, {:.0} MB",
            summary.path.display(),
            summary.frames,
            summary.bytes as f64 / 1e6
        );
        let lost = summary.dropped.frames_queue_full;
        if lost > 0 {
            eprintln!(
                "effigy: the disk was too slow for {lost} frames; a replay will not repeat this run to the last bit"
            );
        }
        Ok(())
    }
}
