//! The parts of a snapshot that are made for looking at.

use std::sync::Arc;

use effigy_capture::FrameId;
use glam::Vec3;

/// Where frames come from.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct SourceView {
    /// "simulated azure", "recording walk.mcap".
    pub name: String,
    /// What computes: "CPU, 2 cores".
    pub device: String,
}

/// Where a replay stands.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PlaybackView {
    pub frame: u64,
    pub frame_count: Option<u64>,
    pub paused: bool,
    pub looping: bool,
}

/// Registration's state, as a person wants to know it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum TrackState {
    /// Nobody has been found yet.
    #[default]
    Searching,
    Tracking {
        residual_rms_m: f32,
    },
    /// Somebody is in view, but too little of them.
    Partial,
    Lost {
        for_secs: f32,
    },
    /// The source has ended.
    Finished,
}

impl TrackState {
    pub fn label(self) -> &'static str {
        match self {
            Self::Searching => "Searching",
            Self::Tracking { .. } => "Tracking",
            Self::Partial => "Partly visible",
            Self::Lost { .. } => "Lost",
            Self::Finished => "Finished",
        }
    }

    /// What the person in front of the camera may do about it.
    pub fn advice(self) -> &'static str {
        match self {
            Self::Searching => "Step into view, whole body, facing the camera",
            Self::Tracking { .. } => "",
            Self::Partial => "Step back until head and feet are in view",
            Self::Lost { .. } => "Face the camera and stand still for a moment",
            Self::Finished => "The source has ended",
        }
    }
}

/// The bare body in a pose, in world space.
#[derive(Clone, Debug)]
pub struct BodyView {
    pub id: FrameId,
    pub vertices: Vec<Vec3>,
    pub triangles: Arc<Vec<[u32; 3]>>,
}

/// The avatar in a pose, in world space.
#[derive(Clone, Debug)]
pub struct AvatarView {
    /// The frame whose pose it shows.
    pub id: FrameId,
    pub vertices: Vec<Vec3>,
    /// One unit normal a vertex, or none at all.
    pub normals: Vec<Vec3>,
    /// The same `Arc` as long as the topology stays.
    pub triangles: Arc<Vec<[u32; 3]>>,
    /// One sRGB colour a vertex, or none at all.
    pub colors: Arc<Vec<[u8; 3]>>,
}

/// How far the collection of keyframes is.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct KeyframesView {
    pub collected: usize,
    pub wanted: usize,
    /// What would bring the next one: "turn slowly".
    pub hint: String,
}

/// How far fine-tuning is.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TrainingView {
    pub step: u32,
    pub steps: u32,
    /// Training loss by step.
    pub loss: Vec<[f64; 2]>,
    /// Residual on held-out points by step, in millimetres.
    pub held_out_mm: Vec<[f64; 2]>,
    pub seconds_left: Option<f32>,
    pub running: bool,
    /// How often an avatar has been swapped in.
    pub avatars_made: u32,
}

/// How the pipeline performs.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PerformanceView {
    pub frames_per_sec: f32,
    /// From a frame's delivery to the picture's data.
    pub latency_p50_ms: f32,
    pub latency_p95_ms: f32,
    /// In the order a frame meets them.
    pub stages: Vec<StageTiming>,
    pub drops: Vec<CauseCount>,
}

#[derive(Clone, Debug, Default, PartialEq)]
pub struct StageTiming {
    pub name: String,
    pub p50_ms: f32,
    pub p95_ms: f32,
}

/// How many frames were dropped for one cause.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct CauseCount {
    pub cause: String,
    pub count: u64,
}
