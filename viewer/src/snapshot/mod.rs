//! Everything the window shows at one moment: latest values, shared by `Arc`.

mod slot;
mod views;

use std::sync::Arc;

use effigy_capture::{Calibration, Frame};
use effigy_fusion::CleanFrame;
use effigy_registration::RegisteredFrame;

pub use slot::SnapshotSlot;
pub use views::{
    AvatarView, BodyView, CauseCount, KeyframesView, PerformanceView, PlaybackView, SourceView,
    StageTiming, TrackState, TrainingView,
};

/// The latest of each; a clone costs a few reference counts. What is not there yet is `None`.
#[derive(Clone, Debug, Default)]
pub struct Snapshot {
    pub source: Arc<SourceView>,
    pub calibration: Option<Arc<Calibration>>,
    /// Set for recordings: where replay stands.
    pub playback: Option<PlaybackView>,
    pub state: TrackState,
    pub frame: Option<Arc<Frame>>,
    pub clean: Option<Arc<CleanFrame>>,
    pub registered: Option<Arc<RegisteredFrame>>,
    /// The fitted body of the registered frame.
    pub body: Option<Arc<BodyView>>,
    pub avatar: Option<Arc<AvatarView>>,
    pub keyframes: Arc<KeyframesView>,
    pub training: Option<Arc<TrainingView>>,
    pub performance: Arc<PerformanceView>,
    /// The program ends: the window closes.
    pub closing: bool,
    /// One line of news for people: "avatar saved to out/avatar.glb".
    pub message: Option<Arc<str>>,
}
