//! The latest snapshot, between the pipeline's threads and the window.

use std::{
    fmt,
    sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError},
};

#[cfg(feature = "window")]
use eframe::wgpu;

use super::Snapshot;

/// Holds one snapshot; writers never wait for the reader to draw.
#[derive(Default)]
pub struct SnapshotSlot {
    latest: Mutex<Arc<Snapshot>>,
    waker: OnceLock<Box<dyn Fn() + Send + Sync>>,
    #[cfg(feature = "window")]
    adapter: OnceLock<wgpu::Adapter>,
}

impl SnapshotSlot {
    pub fn new() -> Self {
        Self::default()
    }

    /// Replaces the whole snapshot.
    pub fn publish(&self, snapshot: Snapshot) {
        *self.lock() = Arc::new(snapshot);
        self.wake();
    }

    /// Changes some of the snapshot; several threads may each own a part. The lock is held for `change`:
    /// move finished values in, compute nothing.
    pub fn update(&self, change: impl FnOnce(&mut Snapshot)) {
        change(Arc::make_mut(&mut self.lock()));
        self.wake();
    }

    pub fn latest(&self) -> Arc<Snapshot> {
        Arc::clone(&self.lock())
    }

    /// Called after each change; the window asks to be redrawn with it. Only the first one set is kept.
    pub fn set_waker(&self, waker: impl Fn() + Send + Sync + 'static) {
        self.waker.get_or_init(|| Box::new(waker));
    }

    /// Whether a window shows what comes in.
    pub fn is_watched(&self) -> bool {
        self.waker.get().is_some()
    }

    /// What draws the window: the pipeline may compute on it, with a device of its own.
    #[cfg(feature = "window")]
    pub fn adapter(&self) -> Option<&wgpu::Adapter> {
        self.adapter.get()
    }

    #[cfg(feature = "window")]
    pub(crate) fn set_adapter(&self, adapter: wgpu::Adapter) {
        self.adapter.get_or_init(|| adapter);
    }

    fn wake(&self) {
        if let Some(waker) = self.waker.get() {
            waker();
        }
    }

    fn lock(&self) -> MutexGuard<'_, Arc<Snapshot>> {
        // A panic in `change` leaves a snapshot that is old, not broken.
        self.latest.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl fmt::Debug for SnapshotSlot {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("SnapshotSlot").finish_non_exhaustive()
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicUsize, Ordering};

    use super::*;
    use crate::snapshot::{PlaybackView, TrackState};

    fn at(frame: u64) -> Snapshot {
        let playback = Some(PlaybackView { frame, ..PlaybackView::default() });
        Snapshot { playback, ..Snapshot::default() }
    }

    fn frame_in(snapshot: &Snapshot) -> u64 {
        snapshot.playback.expect("set in this test").frame
    }

    #[test]
    fn the_slot_keeps_only_the_latest_snapshot() {
        let slot = SnapshotSlot::new();
        for frame in 0..10 {
            slot.publish(at(frame));
        }
        assert_eq!(frame_in(&slot.latest()), 9);
    }

    #[test]
    fn a_snapshot_in_the_readers_hands_does_not_change() {
        let slot = SnapshotSlot::new();
        slot.publish(at(1));
        let held = slot.latest();
        slot.update(|snapshot| snapshot.state = TrackState::Partial);
        slot.publish(at(2));
        assert_eq!((frame_in(&held), held.state), (1, TrackState::Searching));
        assert_eq!(frame_in(&slot.latest()), 2);
    }

    #[test]
    fn updates_from_several_threads_all_arrive_and_wake_the_window() {
        let slot = SnapshotSlot::new();
        let wakes = Arc::new(AtomicUsize::new(0));
        let counted = Arc::clone(&wakes);
        slot.set_waker(move || {
            counted.fetch_add(1, Ordering::Relaxed);
        });
        slot.publish(at(0));
        std::thread::scope(|scope| {
            for _ in 0..4 {
                scope.spawn(|| {
                    for _ in 0..25 {
                        slot.update(|snapshot| {
                            snapshot.playback.as_mut().expect("published above").frame += 1;
                        });
                    }
                });
            }
        });
        assert_eq!(frame_in(&slot.latest()), 100);
        assert_eq!(wakes.load(Ordering::Relaxed), 101);
    }
}
