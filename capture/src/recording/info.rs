//! What a recording holds, for people and reports.

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
};

use serde::Serialize;

use super::{damage::Damage, reader::Recording};
use crate::{calibration::Calibration, error::CaptureError};

/// A summary of a recording.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Info {
    pub path: PathBuf,
    pub file_bytes: u64,
    pub sensor_name: String,
    pub depth_px: [u32; 2],
    pub color_px: Option<[u32; 2]>,
    pub frames: usize,
    pub duration_secs: f64,
    /// Frames a second as recorded, which may differ from the sensor's nominal rate.
    pub rate_hz: f64,
    pub first_id: Option<u64>,
    pub last_id: Option<u64>,
    pub metadata: BTreeMap<String, String>,
    /// How often each kind of event happened.
    pub events: BTreeMap<String, usize>,
    pub damage: Option<Damage>,
    pub calibration: Calibration,
}

/// Opens a recording, reads all of it once, and sums it up.
pub fn info(path: &Path) -> Result<Info, CaptureError> {
    let mut recording = Recording::open(path)?;
    let damage = recording.verify()?;
    let calibration = recording.calibration();
    let px = |camera: &crate::CameraModel| [camera.intrinsics.width, camera.intrinsics.height];
    let (frames, duration_secs) = (recording.frame_count(), recording.duration_secs());
    let mut events = BTreeMap::new();
    for event in recording.events() {
        *events.entry(event.name.clone()).or_default() += 1;
    }
    let metadata = recording
        .metadata_keys()
        .filter_map(|key| Some((key.to_owned(), recording.metadata(key)?.to_owned())));
    Ok(Info {
        path: path.to_owned(),
        file_bytes: recording.file_bytes(),
        sensor_name: calibration.sensor_name.clone(),
        depth_px: px(&calibration.depth),
        color_px: calibration.color.as_ref().map(px),
        frames,
        duration_secs,
        rate_hz: if duration_secs > 0.0 {
            (frames - 1) as f64 / duration_secs
        } else {
            0.0
        },
        first_id: recording.frame_at(0).map(|(id, _)| id.0),
        last_id: recording
            .frame_at(frames.wrapping_sub(1))
            .map(|(id, _)| id.0),
        metadata: metadata.collect(),
        events,
        damage,
        calibration: calibration.clone(),
    })
}
