//! At the source's pace: capture, cleaning, tracking and driving each on a thread, late frames dropped and counted.

use std::{
    collections::VecDeque,
    panic::resume_unwind,
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
    thread::{self, ScopedJoinHandle},
    time::Duration,
};

use anyhow::Context as _;
use crossbeam::channel::{Receiver, RecvTimeoutError, Sender, bounded};
use effigy_capture::{
    Frame, FrameSource, Timestamp,
    replay::{Due, Pacer},
};
use effigy_registration::{BodyModel, Tracking};
use effigy_viewer::PlaybackView;

use super::{
    avatar_stage::AvatarStage,
    clock::Clock,
    controls::Controls,
    outputs::Outputs,
    run_log::{Captured, RunLog},
    settings::Settings,
    track_stage::{CleanStage, CleanedFrame, Handover, TrackStage, TrackedFrame, stages},
};
use crate::interrupt;

/// One frame waits while one is worked on; anything longer is latency.
const QUEUE: usize = 1;

/// While somebody is looked for, half a second of frames (at 30 a second) waits: they are recorded and shown a little late, not lost.
const QUEUE_WHILE_LOST: usize = 15;
/// Once somebody is found, so much of a place in the queue goes with each new frame: a machine that catches up loses no
/// frame, and one that does not is current again after 50.
const CATCHING_UP: f32 = 0.3;

/// Commands are looked at this often while no frame comes.
const COMMANDS_EVERY: Duration = Duration::from_millis(50);

struct Delivered {
    frame: Frame,
    at: Duration,
    /// How often a frame was not the one after the last in the source, up to this one.
    jumps: u64,
    dropped_so_far: u64,
    playback: Option<PlaybackView>,
}

struct Cleaned {
    delivered: Delivered,
    cleaned: CleanedFrame,
}

struct Tracked {
    delivered: Delivered,
    tracked: TrackedFrame,
}

/// Takes a source to its end (or to Ctrl-C) in real time.
pub(crate) fn run(
    mut source: Box<dyn FrameSource>,
    body: &Arc<BodyModel>,
    settings: &Settings,
    (avatar, outputs): (&mut AvatarStage, &mut Outputs),
    (clock, controls): (Clock, &Controls),
) -> anyhow::Result<RunLog> {
    let (cleaning, tracking, hand_over) =
        stages(source.calibration(), Arc::clone(body), settings, clock);
    let (to_clean, frames) = bounded(QUEUE_WHILE_LOST);
    // Handed over directly: a cleaned frame that waited would only be late.
    let (to_track, cleaned) = bounded(0);
    let (to_drive, tracked) = bounded(QUEUE);
    let stale_frames = frames.clone();
    let (stop, lost) = (AtomicBool::new(false), AtomicBool::new(true));
    let mut log = RunLog::new(clock);
    thread::scope(|scope| {
        let (stop, lost) = (&stop, &lost);
        let capture = thread::Builder::new()
            .name("capture".to_owned())
            .spawn_scoped(scope, move || {
                capture(
                    &mut *source,
                    &to_clean,
                    &stale_frames,
                    (clock, controls),
                    (stop, lost),
                )
            })
            .context("cannot start the capture thread")?;
        let clean = thread::Builder::new()
            .name("clean".to_owned())
            .spawn_scoped(scope, move || {
                let _stops = StopsCapture(stop);
                clean(cleaning, &frames, &to_track)
            })
            .context("cannot start the cleaning thread")?;
        let track = thread::Builder::new()
            .name("track".to_owned())
            .spawn_scoped(scope, move || {
                let _stops = StopsCapture(stop);
                track(tracking, &cleaned, &to_drive, lost);
            })
            .context("cannot start the tracking thread")?;
        let driven = drive(
            (&tracked, &hand_over),
            avatar,
            outputs,
            (&mut log, controls),
        );
        // Closes the queue, so that the threads before it end too.
        drop(tracked);
        track.join().unwrap_or_else(|panic| resume_unwind(panic));
        joined(clean)?;
        let captured = joined(capture)?;
        driven?;
        log.captured(&captured);
        anyhow::Ok(())
    })?;
    outputs.wait_for_avatar(avatar)?;
    log.avatar_made(avatar);
    Ok(log)
}

/// When cleaning or tracking ends, in whatever way, nothing more need be captured.
struct StopsCapture<'a>(&'a AtomicBool);

impl Drop for StopsCapture<'_> {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
    }
}

/// A thread's result; its panic goes on here.
fn joined<T>(thread: ScopedJoinHandle<'_, anyhow::Result<T>>) -> anyhow::Result<T> {
    thread.join().unwrap_or_else(|panic| resume_unwind(panic))
}

/// Delivers frames when their time has come; where too many wait, the oldest make way.
fn capture(
    source: &mut dyn FrameSource,
    to_clean: &Sender<Delivered>,
    waiting: &Receiver<Delivered>,
    (clock, controls): (Clock, &Controls),
    (stop, lost): (&AtomicBool, &AtomicBool),
) -> anyhow::Result<Captured> {
    let mut captured = Captured::default();
    let mut pacer = Pacer::new(1.0);
    let mut before: Option<Timestamp> = None;
    let (mut jumps, mut queue) = (0, Queue::default());
    let stopped = || interrupt::requested() || stop.load(Ordering::Relaxed);
    while !stopped() {
        let steered = controls.steer(source, stopped);
        if stopped() {
            break;
        }
        if steered.waited || steered.jumped {
            pacer.restart();
        }
        if steered.jumped {
            // Nobody wants to see any more what was before.
            waiting.try_iter().for_each(drop);
        }
        let Some(frame) = source.next_frame()? else {
            break;
        };
        let looped = before.is_some_and(|before| frame.timestamp < before);
        let jumped = steered.jumped || looped;
        jumps += u64::from(jumped);
        before = Some(frame.timestamp);
        captured.count(&frame, jumped);
        let at = wait_until_due(&mut pacer, frame.timestamp, clock);
        let length = queue.length(lost.load(Ordering::Relaxed));
        while to_clean.len() >= length && waiting.try_recv().is_ok() {
            captured.too_late += 1;
        }
        let dropped_so_far = captured.too_late;
        let playback = controls.playback(source.player());
        let item = Delivered { frame, at, jumps, dropped_so_far, playback };
        if to_clean.send(item).is_err() {
            break;
        }
    }
    Ok(captured)
}

/// How many frames may wait.
struct Queue {
    length: f32,
}

impl Default for Queue {
    fn default() -> Self {
        Self { length: QUEUE as f32 }
    }
}

impl Queue {
    /// Now that another frame comes.
    fn length(&mut self, lost: bool) -> usize {
        self.length = if lost {
            QUEUE_WHILE_LOST as f32
        } else {
            (self.length - CATCHING_UP).max(QUEUE as f32)
        };
        self.length as usize
    }
}

/// Returns when the frame was due: what is late from here on is our doing, or the source's.
fn wait_until_due(pacer: &mut Pacer, frame: Timestamp, clock: Clock) -> Duration {
    if let Due::Wait(early) = pacer.due(frame, clock.now()) {
        thread::sleep(early);
    }
    clock.now()
}

fn clean(
    mut cleaning: CleanStage,
    frames: &Receiver<Delivered>,
    to_track: &Sender<Cleaned>,
) -> anyhow::Result<()> {
    for delivered in frames {
        if interrupt::requested() {
            break;
        }
        let cleaned = cleaning.process(&delivered.frame)?;
        if to_track.send(Cleaned { delivered, cleaned }).is_err() {
            break;
        }
    }
    Ok(())
}

fn track(
    mut tracking: TrackStage,
    frames: &Receiver<Cleaned>,
    to_drive: &Sender<Tracked>,
    lost: &AtomicBool,
) {
    let mut jumps = 0;
    for Cleaned { delivered, cleaned } in frames {
        if delivered.jumps != jumps {
            jumps = delivered.jumps;
            tracking.jumped();
            lost.store(true, Ordering::Relaxed);
        }
        let tracked = tracking.process(cleaned);
        // Whoever is seen in part is still looked for.
        let is_tracked = matches!(tracked.registered.tracking, Tracking::Tracked { .. });
        lost.store(!is_tracked, Ordering::Relaxed);
        if to_drive.send(Tracked { delivered, tracked }).is_err() {
            break;
        }
    }
}

/// How many frames were dropped by when.
#[derive(Default)]
struct Load {
    dropped: VecDeque<u64>,
}

impl Load {
    /// Whether more than a tenth of the latest frames were dropped.
    fn is_too_high(&mut self, dropped_so_far: u64) -> bool {
        /// About three seconds.
        const RECENT: usize = 90;
        self.dropped.push_back(dropped_so_far);
        if self.dropped.len() > RECENT {
            self.dropped.pop_front();
        }
        let before = self.dropped.front().copied().unwrap_or_default();
        (dropped_so_far - before) * 10 > RECENT as u64
    }
}

fn drive(
    (tracked, hand_over): (&Receiver<Tracked>, &Sender<Handover>),
    avatar: &mut AvatarStage,
    outputs: &mut Outputs,
    (log, controls): (&mut RunLog, &Controls),
) -> anyhow::Result<()> {
    let mut load = Load::default();
    loop {
        controls.obey(avatar, outputs)?;
        outputs.paused(controls.paused());
        let Tracked { delivered, tracked } = match tracked.recv_timeout(COMMANDS_EVERY) {
            Ok(next) => next,
            Err(RecvTimeoutError::Timeout) => continue,
            Err(RecvTimeoutError::Disconnected) => return Ok(()),
        };
        let was_making = avatar.is_making();
        let registered = &tracked.registered;
        log.delivered(&delivered.frame);
        if was_making {
            log.dropped_while_fine_tuning += delivered.dropped_so_far - log.dropped_so_far;
        }
        log.dropped_so_far = delivered.dropped_so_far;
        log.playback = delivered.playback;
        avatar.note_load(load.is_too_high(delivered.dropped_so_far));
        let decided = avatar.advance(registered)?;
        avatar.hand_over(&decided, tracked.number, hand_over);
        let mesh = avatar.drive(registered);
        let latency = log.clock.now().saturating_sub(delivered.at);
        log.latency(latency, (was_making, mesh.is_some()));
        log.registered(&tracked);
        outputs.record(&delivered.frame, &decided)?;
        outputs.frame(&delivered.frame, registered, mesh.as_ref(), (avatar, log))?;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_wait_while_somebody_is_looked_for_and_ever_fewer_once_found() {
        let mut queue = Queue::default();
        assert_eq!(queue.length(false), QUEUE);
        assert_eq!(queue.length(true), QUEUE_WHILE_LOST);
        let lengths: Vec<usize> = (0..60).map(|_| queue.length(false)).collect();
        assert!(lengths.is_sorted_by(|a, b| a >= b));
        assert_eq!((lengths[0], lengths[59]), (QUEUE_WHILE_LOST - 1, QUEUE));
    }
}
