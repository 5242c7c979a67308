//! At the source's pace: capture, tracking and driving each on a thread, late frames dropped and counted.

use std::{
    panic::resume_unwind,
    sync::Arc,
    thread::{self, ScopedJoinHandle},
    time::Duration,
};

use anyhow::Context as _;
use crossbeam::channel::{Receiver, RecvTimeoutError, Sender, TrySendError, bounded};
use effigy_capture::{Frame, FrameSource, Timestamp};
use effigy_registration::{BodyModel, RegisteredFrame};

use super::{
    avatar_stage::AvatarStage,
    clock::{Clock, Timings},
    controls::Controls,
    outputs::Outputs,
    run_log::RunLog,
    settings::Settings,
    track_stage::TrackStage,
};
use crate::interrupt;

/// One frame waits while one is worked on; anything longer is latency.
const QUEUE: usize = 1;

/// Commands are looked at this often while no frame comes.
const COMMANDS_EVERY: Duration = Duration::from_millis(50);

struct Delivered {
    frame: Frame,
    at: Duration,
}

struct Tracked {
    frame: Frame,
    at: Duration,
    registered: Arc<RegisteredFrame>,
}

/// Takes a source to its end (or to Ctrl-C) in real time.
pub(crate) fn run(
    mut source: Box<dyn FrameSource>,
    body: &Arc<BodyModel>,
    settings: &Settings,
    (avatar, outputs): (&mut AvatarStage, &mut Outputs),
    (clock, controls): (Clock, &Controls),
) -> anyhow::Result<RunLog> {
    let tracking = TrackStage::new(source.calibration(), Arc::clone(body), settings, clock);
    let (to_track, frames) = bounded(QUEUE);
    let (to_drive, tracked) = bounded(QUEUE);
    let stale_frames = frames.clone();
    let mut log = RunLog::new(clock);
    thread::scope(|scope| {
        let capture = thread::Builder::new()
            .name("capture".to_owned())
            .spawn_scoped(scope, move || {
                capture(&mut *source, &to_track, &stale_frames, (clock, controls))
            })
            .context("cannot start the capture thread")?;
        let track = thread::Builder::new()
            .name("track".to_owned())
            .spawn_scoped(scope, move || track(tracking, &frames, &to_drive))
            .context("cannot start the tracking thread")?;
        let driven = drive(&tracked, avatar, outputs, (&mut log, controls));
        // Closes the queue, so that the threads before it end too.
        drop(tracked);
        let timings = joined(track)?;
        let captured = joined(capture)?;
        driven?;
        log.delivered = captured.delivered;
        log.drop_frames("tracking was busy", captured.dropped);
        log.timings.merge(timings);
        anyhow::Ok(())
    })?;
    avatar.end()?;
    log.avatar_made(avatar);
    Ok(log)
}

/// A thread's result; its panic goes on here.
fn joined<T>(thread: ScopedJoinHandle<'_, anyhow::Result<T>>) -> anyhow::Result<T> {
    thread.join().unwrap_or_else(|panic| resume_unwind(panic))
}

#[derive(Clone, Copy, Debug, Default)]
struct Captured {
    delivered: u64,
    dropped: u64,
}

/// Delivers frames when their time has come; a frame that nobody took makes way for the next.
fn capture(
    source: &mut dyn FrameSource,
    to_track: &Sender<Delivered>,
    waiting: &Receiver<Delivered>,
    (clock, controls): (Clock, &Controls),
) -> anyhow::Result<Captured> {
    let mut captured = Captured::default();
    let mut start: Option<(Timestamp, Duration)> = None;
    while !interrupt::requested() {
        let Some(frame) = source.next_frame()? else {
            break;
        };
        let (first, began) = start.get_or_insert((frame.timestamp, clock.now()));
        *began += controls.wait_while_paused();
        let (first, began) = (*first, *began);
        let due = began + Duration::from_secs_f64((frame.timestamp - first).max(0.0));
        thread::sleep(due.saturating_sub(clock.now()));
        captured.delivered += 1;
        let mut item = Delivered { frame, at: clock.now().max(due) };
        loop {
            match to_track.try_send(item) {
                Ok(()) => break,
                Err(TrySendError::Full(back)) => {
                    item = back;
                    captured.dropped += u64::from(waiting.try_recv().is_ok());
                }
                Err(TrySendError::Disconnected(_)) => return Ok(captured),
            }
        }
    }
    Ok(captured)
}

fn track(
    mut tracking: TrackStage,
    frames: &Receiver<Delivered>,
    to_drive: &Sender<Tracked>,
) -> anyhow::Result<Timings> {
    for Delivered { frame, at } in frames {
        let registered = tracking.process(&frame)?;
        if to_drive.send(Tracked { frame, at, registered }).is_err() {
            break;
        }
    }
    Ok(tracking.timings)
}

fn drive(
    tracked: &Receiver<Tracked>,
    avatar: &mut AvatarStage,
    outputs: &mut Outputs,
    (log, controls): (&mut RunLog, &Controls),
) -> anyhow::Result<()> {
    loop {
        controls.obey(avatar, outputs)?;
        let Tracked { frame, at, registered } = match tracked.recv_timeout(COMMANDS_EVERY) {
            Ok(next) => next,
            Err(RecvTimeoutError::Timeout) => continue,
            Err(RecvTimeoutError::Disconnected) => return Ok(()),
        };
        let tuning = avatar.is_making();
        log.delivered(&frame);
        avatar.advance(&registered)?;
        let mesh = avatar.drive(&registered);
        let latency = log.clock.now().saturating_sub(at);
        log.latencies_ms.push((latency.as_secs_f32() * 1e3, tuning));
        log.registered(&registered);
        outputs.frame(&frame, &registered, mesh.as_ref(), (avatar, log))?;
    }
}
