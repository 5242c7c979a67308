//! The recorder's thread: takes frames and events from its queue and writes them.

use std::{
    io::{self, Write},
    path::PathBuf,
    sync::{Mutex, PoisonError, atomic::AtomicU64},
    time::Duration,
};

use crossbeam::channel::{Receiver, RecvTimeoutError};

use super::sink::{Sink, SinkError};
use crate::{error::CaptureError, frame::Frame, time::Timestamp};

/// A live recording that gets no frame for this long is flushed.
const IDLE_FLUSH: Duration = Duration::from_secs(1);

pub(super) enum Command {
    Frame(Frame, Urgency),
    Event { name: String, time: Timestamp, value: serde_json::Value },
}

/// Whether the disk is flushed when no frame comes for a while. Offline it is not: the file's bytes would depend
/// on the speed of the machine.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Urgency {
    Live,
    Offline,
}

pub(super) struct Shared {
    pub(super) path: PathBuf,
    pub(super) failure: Mutex<Option<Failure>>,
    pub(super) frames_queue_full: AtomicU64,
    pub(super) events_queue_full: AtomicU64,
}

#[derive(Clone)]
pub(super) struct Failure {
    pub(super) frames_written: u64,
    pub(super) reason: String,
}

pub(super) struct Written {
    pub(super) frames: u64,
    pub(super) events: u64,
    pub(super) bytes: u64,
    pub(super) duration_secs: f64,
}

impl Shared {
    pub(super) fn error(&self, Failure { frames_written, reason }: Failure) -> CaptureError {
        CaptureError::RecorderFailed { path: self.path.clone(), frames_written, reason }
    }
}

/// The recorder's thread: writes until the sender is gone. After a failure it goes on taking frames, so that nobody
/// waits for it.
pub(super) fn write_all<W: Write>(
    mut sink: Sink<W>,
    commands: &Receiver<Command>,
    slots: &Receiver<()>,
    shared: &Shared,
    close: fn(W) -> io::Result<()>,
) -> Result<Written, Failure> {
    let mut failed = None;
    let mut urgency = Urgency::Offline;
    loop {
        let command = match commands.recv_timeout(IDLE_FLUSH) {
            Ok(command) => Some(command),
            Err(RecvTimeoutError::Timeout) => None,
            Err(RecvTimeoutError::Disconnected) => break,
        };
        if let Some(Command::Frame(_, of_frame)) = &command {
            urgency = *of_frame;
            let _slot = slots.try_recv();
        }
        if failed.is_some() {
            continue;
        }
        let result = match command {
            Some(Command::Frame(frame, _)) => sink.frame(&frame),
            Some(Command::Event { name, time, value }) => sink.event(&name, time, &value),
            None if urgency == Urgency::Live => sink.flush(),
            None => Ok(()),
        };
        if let Err(error) = result {
            let failure = Failure { frames_written: sink.frames, reason: error.to_string() };
            *shared
                .failure
                .lock()
                .unwrap_or_else(PoisonError::into_inner) = Some(failure.clone());
            failed = Some(failure);
        }
    }
    match failed {
        Some(failure) => Err(failure),
        None => finish(sink, close),
    }
}

fn finish<W: Write>(mut sink: Sink<W>, close: fn(W) -> io::Result<()>) -> Result<Written, Failure> {
    let (frames, events) = (sink.frames, sink.events);
    let failure = |error: SinkError| Failure { frames_written: frames, reason: error.to_string() };
    let duration_secs = sink
        .first_and_last
        .map_or(0.0, |(first, last)| last - first);
    sink.finish().map_err(failure)?;
    let (writer, bytes) = sink.into_inner();
    close(writer).map_err(|error| failure(SinkError::Mcap(error.into())))?;
    Ok(Written { frames, events, bytes, duration_secs })
}
