//! People of a real recording, of whom no truth is known: how well the body that is fitted explains the picture.

use std::{path::Path, sync::Arc};

use anyhow::Context as _;
use effigy_capture::{Frame, FrameId, Timestamp, source};
use effigy_fusion::{
    CleanFrame, Cleaner,
    mesh::z_buffer::{Faces, Rasterizer},
};
use effigy_registration::{BodyModel, RegisteredFrame, Tracker, Tracking};
use glam::Vec3;
use serde::Serialize;

use super::{Options, suite::DATA};

/// Among the data sets that strangers come from.
const RECORDING: &str = "pcl/five_people.pcd";
/// The one frame is shown this often, so that the shape is learned as it is of somebody who stands still.
const SHOWN: u64 = 60;
const RATE_HZ: f64 = 30.0;
/// Whatever was measured this far before the body hides it.
const BEFORE_M: f32 = 0.10;

/// One person, from the left.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct RealRow {
    recording: &'static str,
    person: usize,
    distance_m: f32,
    /// `tracked`, or `partial`, as it should be of somebody whose legs are out of the picture, or `lost`.
    state: &'static str,
    /// Of the matched depth to the body, clothes included.
    residual_mm: Option<f32>,
    /// Intersection over union of the person's pixels and the drawn body's, where nothing is before it.
    silhouette_iou: Option<f32>,
}

impl RealRow {
    pub(super) fn line(&self) -> String {
        let figure = |value: Option<f32>, decimals| {
            value.map_or_else(|| "-".to_owned(), |value| format!("{value:.decimals$}"))
        };
        format!(
            "{} person {} at {:.1} m: {}, residual {} mm, silhouette {}",
            self.recording,
            self.person,
            self.distance_m,
            self.state,
            figure(self.residual_mm, 1),
            figure(self.silhouette_iou, 3),
        )
    }
}

/// Everybody in the recording, each followed by themselves; nobody without the recording.
pub(super) fn rows(body: &Arc<BodyModel>, options: &Options) -> anyhow::Result<Vec<RealRow>> {
    let path = Path::new(DATA).join(RECORDING);
    if !path.exists() {
        return Ok(Vec::new());
    }
    let mut source = source::open(&path)?;
    let calibration = source.calibration().clone();
    let frame = source.next_frame()?.context("a cloud is a frame")?;
    let cleaner = Cleaner::new(calibration.clone(), options.clean.clone());
    let mut look = cleaner.clone();
    look.process(&frame)?;
    let mut people: Vec<Vec3> = look.bodies().iter().map(|body| body.centroid).collect();
    people.sort_by(|a, b| (a.x / a.z).total_cmp(&(b.x / b.z)));
    let camera = calibration.depth.intrinsics;
    let mut rows = Vec::new();
    for (number, person) in people.iter().enumerate() {
        let place = camera.project(*person);
        let mut cleaner = cleaner.clone();
        cleaner.pick([
            place.x / camera.width as f32,
            place.y / camera.height as f32,
        ]);
        let mut tracker = Tracker::new(
            Arc::clone(body),
            calibration.depth,
            options.track.clone(),
            None,
        );
        let mut registered = None;
        for shown in 0..SHOWN {
            let timestamp = Timestamp::from_secs_f64(shown as f64 / RATE_HZ);
            let frame = Frame { id: FrameId(shown), timestamp, ..frame.clone() };
            registered = Some(tracker.process(Arc::new(cleaner.process(&frame)?)));
        }
        let registered = registered.context("the frame was shown")?;
        let drawn = Rasterizer::with_faces(camera, Faces::Front);
        rows.push(RealRow {
            recording: "five_people",
            person: number + 1,
            distance_m: person.length(),
            state: match registered.tracking {
                Tracking::Tracked { .. } => "tracked",
                Tracking::Partial { .. } => "partial",
                Tracking::Lost { .. } => "lost",
            },
            residual_mm: residual_mm(&registered.tracking),
            silhouette_iou: silhouette(body, &registered, drawn),
        });
    }
    Ok(rows)
}

fn residual_mm(tracking: &Tracking) -> Option<f32> {
    match tracking {
        Tracking::Tracked { residual_rms_m, .. } => Some(1e3 * residual_rms_m),
        Tracking::Partial { .. } | Tracking::Lost { .. } => None,
    }
}

/// How well the drawn body covers the person's pixels.
fn silhouette(
    body: &BodyModel,
    registered: &RegisteredFrame,
    mut rasterizer: Rasterizer,
) -> Option<f32> {
    let camera_from_world = registered.world_from_camera.inverse();
    let vertices = body.pose(registered.params()?).vertices;
    let in_camera: Vec<Vec3> = vertices.iter().map(|&v| camera_from_world * v).collect();
    let drawn = &rasterizer.draw(&in_camera, &body.triangles).depth;
    let CleanFrame { depth, person, .. } = &*registered.clean;
    let (mut both, mut either) = (0_u32, 0_u32);
    for ((&drawn_m, &measured_m), &person) in drawn.iter().zip(&depth.metres).zip(person) {
        // Another's pixel, or nothing measured: NaN hides nothing.
        let hidden = !person && measured_m < drawn_m - BEFORE_M;
        let drawn = drawn_m > 0.0 && !hidden;
        both += u32::from(drawn && person);
        either += u32::from(drawn || person);
    }
    Some(both as f32 / either.max(1) as f32)
}
