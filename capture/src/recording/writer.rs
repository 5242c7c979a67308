//! Recording on a thread of its own, so that a slow disk never holds up the source.

use std::{
    collections::BTreeMap,
    fs::File,
    io::{self, BufWriter, Write},
    path::{Path, PathBuf},
    sync::{
        Arc, Mutex, PoisonError,
        atomic::{AtomicU64, Ordering},
    },
    thread::{self, JoinHandle},
};

use crossbeam::channel::{self, Sender, TrySendError};
use serde::{Deserialize, Serialize};

use super::{
    format::Head,
    recorder::{Command, Failure, Shared, Urgency, Written, write_all},
    sink::{Sink, SinkError},
};
use crate::{
    calibration::Calibration, codec::color::ColorCodec, error::CaptureError, frame::Frame,
    time::Timestamp,
};

/// Events that may wait in the queue beside the frames.
const EVENT_QUEUE: usize = 1024;

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
        calibration.check()?;
        let file = File::create(path)
            .map_err(|source| CaptureError::CannotCreate { path: path.to_owned(), source })?;
        let head = Head { calibration: calibration.clone(), metadata: metadata.clone() };
        Self::start(path, head, config, BufWriter::new(file), close_file)
    }

    /// Writes the head and starts the thread. `close` is called with the stream after the last byte.
    fn start<W: Write + Send + 'static>(
        path: &Path,
        head: Head,
        config: RecordConfig,
        writer: W,
        close: fn(W) -> io::Result<()>,
    ) -> Result<Self, CaptureError> {
        let shared = Arc::new(Shared {
            path: path.to_owned(),
            failure: Mutex::new(None),
            frames_queue_full: AtomicU64::new(0),
            events_queue_full: AtomicU64::new(0),
        });
        let failed = |error: SinkError| {
            shared.error(Failure { frames_written: 0, reason: error.to_string() })
        };
        let sink = Sink::new(writer, &head, config.color).map_err(failed)?;
        let frames = config.queue_frames.max(1);
        let (commands, received) = channel::bounded(frames + EVENT_QUEUE);
        let (slots, taken_slots) = channel::bounded(frames);
        let of_thread = Arc::clone(&shared);
        let thread = thread::Builder::new()
            .name("recorder".to_owned())
            .spawn(move || write_all(sink, &received, &taken_slots, &of_thread, close))
            .map_err(CaptureError::io(path))?;
        Ok(Self {
            shared,
            calibration: head.calibration,
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

fn close_file(buffer: BufWriter<File>) -> io::Result<()> {
    let file = buffer
        .into_inner()
        .map_err(io::IntoInnerError::into_error)?;
    // Devices and pipes cannot be synchronised; for them there is nothing to lose.
    if let Err(error) = file.sync_all() {
        tracing::debug!("the recording could not be synchronised to its disk: {error}");
    }
    Ok(())
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{DepthImage, FrameId, Intrinsics, Rigid3, SensorModel, recording::Recording};

    /// A disk with room for so many bytes.
    struct SmallDisk {
        file: File,
        room: usize,
    }

    impl Write for SmallDisk {
        fn write(&mut self, data: &[u8]) -> io::Result<usize> {
            if self.room == 0 {
                return Err(io::ErrorKind::StorageFull.into());
            }
            let count = self.file.write(&data[..data.len().min(self.room)])?;
            self.room -= count;
            Ok(count)
        }

        fn flush(&mut self) -> io::Result<()> {
            self.file.flush()
        }
    }

    fn head() -> Head {
        let intrinsics = Intrinsics { width: 16, height: 16, fx: 10.0, fy: 10.0, cx: 8.0, cy: 8.0 };
        let calibration = Calibration {
            sensor_name: "test".to_owned(),
            depth: intrinsics.into(),
            color: None,
            color_from_depth: Rigid3::IDENTITY,
            metres_per_unit: 0.001,
            range_m: [0.1, 5.0],
            rate_hz: 30.0,
            sensor: SensorModel::StructuredLight,
            world_from_camera: None,
        };
        Head { calibration, metadata: BTreeMap::new() }
    }

    fn frame(number: u64) -> Frame {
        let depth = Arc::new(DepthImage::new(16, 16, vec![number as u16; 256]).unwrap());
        Frame {
            id: FrameId(number),
            timestamp: Timestamp(number * 500_000_000),
            depth,
            color: None,
        }
    }

    #[test]
    fn a_disk_that_fills_up_is_reported_to_the_next_push_and_to_finish() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("small.mcap");
        let disk = SmallDisk { file: File::create(&path).unwrap(), room: 20_000 };
        let writer =
            RecordingWriter::start(&path, head(), RecordConfig::default(), disk, |_| Ok(()))
                .unwrap();
        let error = (0..10_000).find_map(|number| writer.push_blocking(&frame(number)).err());
        let message = error.expect("20 kB cannot hold this").to_string();
        assert!(
            message.contains("the disk is full") && message.contains("small.mcap"),
            "{message}"
        );
        assert!(
            writer
                .event("swap", Timestamp(0), &serde_json::Value::Null)
                .is_err()
        );
        assert!(
            writer
                .finish()
                .unwrap_err()
                .to_string()
                .contains("the disk is full")
        );
        let recording = Recording::open(&path).unwrap();
        assert!(recording.frame_count() > 5 && recording.damage().is_some());
    }

    #[test]
    fn a_writer_that_nobody_finishes_still_closes_the_file() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("dropped.mcap");
        let writer = RecordingWriter::create(&path, &head().calibration, &BTreeMap::new()).unwrap();
        writer.push_blocking(&frame(0)).unwrap();
        drop(writer);
        assert_eq!(Recording::open(&path).unwrap().damage(), None);
    }
}
