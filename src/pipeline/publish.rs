//! What the window is told about each frame.

use std::sync::Arc;

use effigy_avatar::{AvatarMesh, LiveDriver};
use effigy_capture::{Calibration, Frame, Timestamp};
use effigy_registration::{BodyModel, RegisteredFrame, Tracking, smpl::Poser};
use effigy_viewer::{
    AvatarView, BodyView, CauseCount, KeyframesView, PerformanceView, SnapshotSlot, SourceView,
    StageTiming, TrackState, TrainingView,
};

use super::{
    avatar_stage::AvatarStage,
    clock::{Clock, percentile},
    run_log::{RunLog, TOO_LATE},
};
use crate::machine::Machine;

/// Latencies that the shown figures are of.
const RECENT: usize = 90;

/// Frames between two looks at the figures: they need not flicker.
const FIGURES_EVERY: u64 = 15;

pub(crate) struct Publisher {
    slot: Arc<SnapshotSlot>,
    source: String,
    /// What drives, as it was last told.
    drive: Option<String>,
    poser: Poser,
    triangles: Arc<Vec<[u32; 3]>>,
    no_colors: Arc<Vec<[u8; 3]>>,
    training: TrainingView,
    clock: Clock,
    frames: u64,
    figures_at: f64,
}

impl Publisher {
    pub(crate) fn new(
        slot: Arc<SnapshotSlot>,
        source: String,
        calibration: &Calibration,
        body: &Arc<BodyModel>,
        clock: Clock,
    ) -> Self {
        let source_view = source_view(&source, None);
        slot.update(|snapshot| {
            snapshot.source = Arc::new(source_view);
            snapshot.calibration = Some(Arc::new(calibration.clone()));
        });
        Self {
            slot,
            source,
            drive: None,
            poser: Poser::new(Arc::clone(body)),
            triangles: Arc::new(body.triangles.clone()),
            no_colors: Arc::default(),
            training: TrainingView::default(),
            clock,
            frames: 0,
            figures_at: 0.0,
        }
    }

    pub(crate) fn frame(
        &mut self,
        frame: &Frame,
        registered: &Arc<RegisteredFrame>,
        mesh: Option<&AvatarMesh>,
        avatar: &AvatarStage,
        log: &RunLog,
    ) {
        let body = registered.params().map(|params| {
            Arc::new(BodyView {
                id: registered.id(),
                vertices: self.poser.pose(params).vertices.clone(),
                triangles: Arc::clone(&self.triangles),
            })
        });
        let mesh = mesh.map(|mesh| self.avatar_view(mesh));
        let state = state(&registered.tracking, registered.clean.timestamp, log);
        let keyframes = Arc::new(KeyframesView {
            collected: avatar.keyframe_count(),
            wanted: avatar.keyframes_wanted(),
            hint: "turn slowly".to_owned(),
        });
        self.tell_drive(avatar);
        let training = self.training(avatar);
        let performance = self.performance(avatar, log);
        self.slot.update(|snapshot| {
            snapshot.frame = Some(Arc::new(frame.clone()));
            snapshot.clean = Some(Arc::clone(&registered.clean));
            snapshot.registered = Some(Arc::clone(registered));
            snapshot.body = body;
            if mesh.is_some() || avatar.avatar().is_none() {
                snapshot.avatar = mesh;
            }
            snapshot.playback = log.playback;
            snapshot.state = state;
            snapshot.keyframes = keyframes;
            snapshot.training = training;
            if let Some(performance) = performance {
                snapshot.performance = Arc::new(performance);
            }
        });
    }

    /// Fine-tuning goes on though no frame comes any more.
    pub(crate) fn waiting(&mut self, avatar: &AvatarStage) {
        let training = self.training(avatar);
        self.slot.update(|snapshot| snapshot.training = training);
    }

    /// The avatar in the last frame's pose.
    pub(crate) fn avatar(&mut self, mesh: &AvatarMesh, avatar: &AvatarStage) {
        let (view, training) = (self.avatar_view(mesh), self.training(avatar));
        self.slot.update(|snapshot| {
            snapshot.avatar = Some(view);
            snapshot.training = training;
        });
    }

    /// Says what drives when that changes, and why a graphics card does not any more.
    fn tell_drive(&mut self, avatar: &AvatarStage) {
        let drive = avatar.driver().map(LiveDriver::device);
        if drive == self.drive {
            return;
        }
        let view = Arc::new(source_view(&self.source, drive.as_deref()));
        self.slot.update(|snapshot| snapshot.source = view);
        if let Some(reason) = avatar.driver().and_then(LiveDriver::gave_up) {
            self.say(&format!("driving without the graphics card: {reason}"));
        }
        self.drive = drive;
    }

    fn avatar_view(&self, mesh: &AvatarMesh) -> Arc<AvatarView> {
        Arc::new(AvatarView {
            id: mesh.frame,
            vertices: mesh.vertices.clone(),
            normals: mesh.normals.clone(),
            triangles: Arc::clone(&mesh.triangles),
            colors: Arc::clone(&self.no_colors),
        })
    }

    pub(crate) fn finished(&self) {
        self.slot
            .update(|snapshot| snapshot.state = TrackState::Finished);
    }

    pub(crate) fn say(&self, line: &str) {
        self.slot
            .update(|snapshot| snapshot.message = Some(Arc::from(line)));
    }

    fn training(&mut self, avatar: &AvatarStage) -> Option<Arc<TrainingView>> {
        let view = &mut self.training;
        if let Some(now) = avatar.progress() {
            let step = f64::from(now.step);
            if now.step < view.step {
                // Another avatar, another curve.
                view.loss.clear();
                view.held_out_mm.clear();
            }
            if now.step > view.step {
                view.loss.push([step, now.loss.total()]);
                view.held_out_mm
                    .push([step, f64::from(now.held_out_residual_m) * 1e3]);
            }
            view.step = now.step;
            view.steps = now.steps;
            view.seconds_left = Some(now.left_secs as f32);
            view.running = true;
        } else if view.running {
            view.running = false;
            view.seconds_left = None;
            view.avatars_made += u32::from(avatar.avatar().is_some());
        }
        (view.running || view.avatars_made > 0).then(|| Arc::new(view.clone()))
    }

    /// A recording's play button shows the other wish.
    pub(crate) fn paused(&self, paused: bool) {
        let shown = self.slot.latest().playback;
        if shown.is_some_and(|playback| playback.paused != paused) {
            self.slot.update(|snapshot| {
                if let Some(playback) = &mut snapshot.playback {
                    playback.paused = paused;
                }
            });
        }
    }

    fn performance(&mut self, avatar: &AvatarStage, log: &RunLog) -> Option<PerformanceView> {
        self.frames += 1;
        if !self.frames.is_multiple_of(FIGURES_EVERY) {
            return None;
        }
        let now = self.clock.secs();
        let frames_per_sec = FIGURES_EVERY as f64 / (now - self.figures_at).max(1e-3);
        self.figures_at = now;
        let first = log.latencies.len().saturating_sub(RECENT);
        let recent: Vec<f32> = log.latencies[first..]
            .iter()
            .map(|latency| latency.milliseconds)
            .collect();
        let of = |share| percentile(&recent, share).unwrap_or(0.0) as f32;
        let stages = [
            ("clean", &log.timings),
            ("track", &log.timings),
            ("keyframes", &avatar.timings),
            ("drive", &avatar.timings),
        ];
        let stages = stages.into_iter().filter_map(|(name, timings)| {
            let (p50_ms, p95_ms) = timings.recent(name, RECENT)?;
            Some(StageTiming { name: name.to_owned(), p50_ms, p95_ms })
        });
        let drops = (log.dropped_so_far > 0)
            .then(|| CauseCount { cause: TOO_LATE.to_owned(), count: log.dropped_so_far });
        Some(PerformanceView {
            frames_per_sec: frames_per_sec as f32,
            latency_p50_ms: of(0.5),
            latency_p95_ms: of(0.95),
            stages: stages.collect(),
            drops: drops.into_iter().collect(),
        })
    }
}

fn source_view(source: &str, drive: Option<&str>) -> SourceView {
    let threads = Machine::this().threads;
    let drive = drive.map(|drive| format!("; drive: {drive}"));
    let device = format!("CPU, {threads} threads{}", drive.unwrap_or_default());
    SourceView { name: source.to_owned(), device }
}

fn state(tracking: &Tracking, now: Timestamp, log: &RunLog) -> TrackState {
    match *tracking {
        Tracking::Tracked { residual_rms_m, .. } => TrackState::Tracking { residual_rms_m },
        Tracking::Partial { .. } => TrackState::Partial,
        Tracking::Lost { .. } if log.tracked.is_empty() => TrackState::Searching,
        Tracking::Lost { since } => TrackState::Lost { for_secs: (now - since) as f32 },
    }
}
