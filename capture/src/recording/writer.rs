//! Recording on a thread of its own, so that a slow disk never holds up the source.

use std::{
    collections::BTreeMap,
    fs::File,
    io::BufWriter,
    path::{Path, PathBuf},
    sync::{
        Arc, Mutex, PoisonError,
        atomic::{AtomicU64, Ordering},
    },
    thread::{self, JoinHandle},
    time::Duration,
};

use crossbeam::channel::{self, Receiver, RecvTimeoutError, Sender, TrySendError};
use serde::{Deserialize, Serialize};

use super::{
    format::Head,
    sink::{Sink, SinkError},
};
use crate::{
    calibration::Calibration, codec::color::ColorCodec, error::CaptureError, frame::Frame,
    time::Timestamp,
};

/// Events that may wait in the queue beside the frames.
const EVENT_QUEUE: usize = 1024;
/// A live recording that gets no frame for this long is flushed.
const IDLE_FLUSH: Duration = Duration::from_secs(1);

/// How a recording is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RecordConfig {
    /// Frames that may wait for the disk; at 30 Hz, 16 ride out half a second for 15-60 MB of memory.
    pub queue_frames: usize,
    pub color: ColorCodec,
}

impl Default for RecordConfig {
    fn default() -> Self {
        Self { queue_frames: 16, color: ColorCodec::Png }
    }
}

/// What became of a frame that was offered.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pushed {
    Queued,
    /// The queue was full: the frame will not be in the file.
    Dropped,
}

/// What a recording did not take, by cause.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct DropCounts {
    pub frames_queue_full: u64,
    pub events_queue_full: u64,
}

/// What ended up in the file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RecordingSummary {
    pub path: PathBuf,
    pub frames: u64,
    pub events: u64,
    pub bytes: u64,
    pub duration_secs: f64,
    pub dropped: DropCounts,
}

/// Writes a recording; call [`Self::finish`] to learn how it went.
pub struct RecordingWriter {
    shared: Arc<Shared>,
    calibration: Calibration,
    commands: Option<Sender<Command>>,
    slots: Sender<()>,
    thread: Option<JoinHandle<Result<Written, Failure>>>,
}

enum Command {
    Frame(Frame, Urgency),
    Event { name: String, time: Timestamp, value: serde_json::Value },
}

/// Whether the disk is flushed when no frame comes for a while. Offline it is not: the file's bytes would depend
/// on the speed of the machine.
#[derive(Clone, Copy, PartialEq)]
enum Urgency {
    Live,
    Offline,
}

struct Shared {
    path: PathBuf,
    failure: Mutex<Option<Failure>>,
    frames_queue_full: AtomicU64,
    events_queue_full: AtomicU64,
}

#[derive(Clone)]
struct Failure {
    frames_written: u64,
    reason: String,
}

struct Written {
    frames: u64,
    events: u64,
    bytes: u64,
    duration_secs: f64,
}

impl RecordingWriter {
    pub fn create(
        path: &Path,
        calibration: &Calibration,
        metadata: &BTreeMap<String, String>,
    ) -> Result<Self, CaptureError> {
        Self::create_with(path, calibration, metadata, RecordConfig::default())
    }

    pub fn create_with(
        path: &Path,
        calibration: &Calibration,
        metadata: &BTreeMap<String, String>,
        config: RecordConfig,
    ) -> Result<Self, CaptureError> {
        let head = Head { calibration: calibration.clone(), metadata: metadata.clone() };
        calibration.check()?;
        let file = File::create(path)
            .map_err(|source| CaptureError::CannotCreate { path: path.to_owned(), source })?;
        let sink = Sink::new(BufWriter::new(file), &head, config.color).map_err(|error| {
            CaptureError::RecorderFailed {
                path: path.to_owned(),
                frames_written: 0,
                reason: error.to_string(),
            }
        })?;
        let shared = Arc::new(Shared {
            path: path.to_owned(),
            failure: Mutex::new(None),
            frames_queue_full: AtomicU64::new(0),
            events_queue_full: AtomicU64::new(0),
        });
        let frames = config.queue_frames.max(1);
        let (commands, received) = channel::bounded(frames + EVENT_QUEUE);
        let (slots, taken_slots) = channel::bounded(frames);
        let thread = {
            let shared = Arc::clone(&shared);
            thread::Builder::new()
                .name("recorder".to_owned())
                .spawn(move || write_all(sink, &received, &taken_slots, &shared))
                .map_err(CaptureError::io(path))?
        };
        Ok(Self {
            shared,
            calibration: calibration.clone(),
            commands: Some(commands),
            slots,
            thread: Some(thread),
        })
    }

    /// Offers a frame and returns at once; a full queue drops and counts it.
    pub fn push(&self, frame: &Frame) -> Result<Pushed, CaptureError> {
        self.check(frame)?;
        if let Err(TrySendError::Full(())) = self.slots.try_send(()) {
            self.shared
                .frames_queue_full
                .fetch_add(1, Ordering::Relaxed);
            return Ok(Pushed::Dropped);
        }
        self.send(Command::Frame(frame.clone(), Urgency::Live))?;
        Ok(Pushed::Queued)
    }

    /// Waits until there is room: for sources that can wait, which must lose nothing.
    pub fn push_blocking(&self, frame: &Frame) -> Result<(), CaptureError> {
        self.check(frame)?;
        // The thread takes slots until it ends, also after a failure, so this cannot wait for ever.
        let _ended = self.slots.send(());
        self.send(Command::Frame(frame.clone(), Urgency::Offline))
    }

    /// Notes that something happened: an avatar swap, say. Returns at once.
    pub fn event(
        &self,
        name: &str,
        time: Timestamp,
        value: &serde_json::Value,
    ) -> Result<(), CaptureError> {
        self.fail_if_stopped()?;
        self.send(Command::Event { name: name.to_owned(), time, value: value.clone() })
    }

    /// What was dropped so far.
    pub fn dropped(&self) -> DropCounts {
        DropCounts {
            frames_queue_full: self.shared.frames_queue_full.load(Ordering::Relaxed),
            events_queue_full: self.shared.events_queue_full.load(Ordering::Relaxed),
        }
    }

    /// Writes what is queued and the closing index.
    pub fn finish(mut self) -> Result<RecordingSummary, CaptureError> {
        let written = self.join()?;
        Ok(RecordingSummary {
            path: self.shared.path.clone(),
            frames: written.frames,
            events: written.events,
            bytes: written.bytes,
            duration_secs: written.duration_secs,
            dropped: self.dropped(),
        })
    }

    fn check(&self, frame: &Frame) -> Result<(), CaptureError> {
        self.fail_if_stopped()?;
        let expected = &self.calibration.depth.intrinsics;
        let depth = &frame.depth;
        check_size(
            "depth",
            [depth.width(), depth.height()],
            [expected.width, expected.height],
        )?;
        if let (Some(color), Some(camera)) = (&frame.color, &self.calibration.color) {
            let expected = &camera.intrinsics;
            check_size(
                "colour",
                [color.width(), color.height()],
                [expected.width, expected.height],
            )?;
        }
        Ok(())
    }

    fn fail_if_stopped(&self) -> Result<(), CaptureError> {
        let failure = self
            .shared
            .failure
            .lock()
            .unwrap_or_else(PoisonError::into_inner);
        match &*failure {
            Some(failure) => Err(self.shared.error(failure.clone())),
            None => Ok(()),
        }
    }

    fn send(&self, command: Command) -> Result<(), CaptureError> {
        let commands = self
            .commands
            .as_ref()
            .expect("only finish and drop take the sender");
        match commands.try_send(command) {
            Ok(()) => Ok(()),
            // Frames are held back by their slots, so only events can find the queue full.
            Err(TrySendError::Full(_)) => {
                self.shared
                    .events_queue_full
                    .fetch_add(1, Ordering::Relaxed);
                Ok(())
            }
            Err(TrySendError::Disconnected(_)) => {
                let reason = "its thread has ended".to_owned();
                Err(self.shared.error(Failure { frames_written: 0, reason }))
            }
        }
    }

    fn join(&mut self) -> Result<Written, CaptureError> {
        drop(self.commands.take());
        let thread = self
            .thread
            .take()
            .expect("joined once, by finish or by drop");
        let result = thread.join().unwrap_or_else(|_| {
            Err(Failure { frames_written: 0, reason: "its thread panicked".to_owned() })
        });
        result.map_err(|failure| self.shared.error(failure))
    }
}

impl Drop for RecordingWriter {
    /// A recording that nobody finished is still closed properly.
    fn drop(&mut self) {
        if self.thread.is_some()
            && let Err(error) = self.join()
        {
            tracing::error!("{error}");
        }
    }
}

impl Shared {
    fn error(&self, Failure { frames_written, reason }: Failure) -> CaptureError {
        CaptureError::RecorderFailed { path: self.path.clone(), frames_written, reason }
    }
}

/// The recorder's thread: writes until the sender is gone. After a failure it goes on taking frames, so that nobody
/// waits for it.
fn write_all(
    mut sink: Sink<BufWriter<File>>,
    commands: &Receiver<Command>,
    slots: &Receiver<()>,
    shared: &Shared,
) -> Result<Written, Failure> {
    let mut failed = None;
    let mut urgency = Urgency::Offline;
    loop {
        let result = match commands.recv_timeout(IDLE_FLUSH) {
            Ok(command) => {
                if let Command::Frame(_, of_frame) = &command {
                    urgency = *of_frame;
                    let _slot = slots.try_recv();
                }
                if failed.is_none() {
                    write(&mut sink, command)
                } else {
                    Ok(())
                }
            }
            Err(RecvTimeoutError::Timeout) if urgency == Urgency::Live && failed.is_none() => {
                sink.flush()
            }
            Err(RecvTimeoutError::Timeout) => Ok(()),
            Err(RecvTimeoutError::Disconnected) => break,
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
        None => close(sink),
    }
}

fn write(sink: &mut Sink<BufWriter<File>>, command: Command) -> Result<(), SinkError> {
    match command {
        Command::Frame(frame, _) => sink.frame(&frame),
        Command::Event { name, time, value } => sink.event(&name, time, &value),
    }
}

fn close(mut sink: Sink<BufWriter<File>>) -> Result<Written, Failure> {
    let (frames, events) = (sink.frames, sink.events);
    let failure = |reason: String| Failure { frames_written: frames, reason };
    let duration_secs = sink
        .first_and_last
        .map_or(0.0, |(first, last)| last - first);
    sink.finish().map_err(|error| failure(error.to_string()))?;
    let (buffer, bytes) = sink.into_inner();
    let file = buffer
        .into_inner()
        .map_err(|error| failure(error.error().to_string()))?;
    // Devices and pipes cannot be synchronised; for them there is nothing to lose.
    if let Err(error) = file.sync_all() {
        tracing::debug!("the recording could not be synchronised to its disk: {error}");
    }
    Ok(Written { frames, events, bytes, duration_secs })
}

fn check_size(
    what: &'static str,
    got_px: [u32; 2],
    expected_px: [u32; 2],
) -> Result<(), CaptureError> {
    if got_px == expected_px {
        return Ok(());
    }
    Err(CaptureError::SizeMismatch { what, got_px, expected_px })
}
