//! How a data set's frame looks to a camera somewhere around the person.

use std::sync::Arc;

use effigy_capture::{
    Calibration, CameraModel, DepthImage, Distortion, Frame, FrameId, Rigid3, SensorModel,
    Timestamp,
};
use effigy_fusion::clean::{CleanConfig, Cleaner};
use effigy_registration::{RegisteredFrame, Tracking};
use effigy_sim_sensor::{
    Room,
    dataset::{SensorShot, Sequence, protocol_camera},
};

use super::{moment::moment, plan::Camera, subject::Lesson};

/// Frames of a snippet on either side of its keyframe.
const SNIPPET_REACH: i32 = 5;

/// Of sensors.
pub(super) const RATE_HZ: f32 = 30.0;

/// A camera that can be put to any side of the person, and the cleaning of its frames.
pub(crate) struct Views {
    camera: Camera,
    calibration: Calibration,
    cleaner: Cleaner,
    seed: u64,
    taken: u64,
}

impl Views {
    /// `seed` is the noise's.
    pub(crate) fn new(camera: Camera, clean: &CleanConfig, seed: u64) -> Self {
        let calibration = match camera {
            Camera::Paper => protocol_calibration(),
            Camera::Sensor(preset) => {
                Calibration { world_from_camera: None, ..preset.calibration() }
            }
        };
        let cleaner = Cleaner::new(calibration.clone(), clean.clone());
        Self { camera, calibration, cleaner, seed, taken: 0 }
    }

    pub(crate) fn camera(&self) -> &CameraModel {
        &self.calibration.depth
    }

    pub(super) fn cleaner(&mut self) -> &mut Cleaner {
        &mut self.cleaner
    }

    /// A lesson's frame with its true pose.
    pub(crate) fn keyframe(&mut self, lesson: &Lesson<'_>) -> anyhow::Result<RegisteredFrame> {
        self.in_true_pose(lesson.sequence, lesson.frame, lesson.yaw_rad)
    }

    /// The frames around it in time, with theirs: between the data set's frames where a sensor takes one.
    pub(super) fn neighbours(
        &mut self,
        lesson: &Lesson<'_>,
    ) -> anyhow::Result<Vec<RegisteredFrame>> {
        let steps = (-SNIPPET_REACH..=SNIPPET_REACH).filter(|&step| step != 0);
        steps
            .map(|step| {
                let between = lesson.moved_by(step as f32 / RATE_HZ);
                self.in_true_pose(&between, 0, lesson.yaw_rad)
            })
            .collect()
    }

    fn in_true_pose(
        &mut self,
        sequence: &Sequence,
        frame: usize,
        yaw_rad: f32,
    ) -> anyhow::Result<RegisteredFrame> {
        let (exposure, world_from_camera) = self.expose(sequence, frame, yaw_rad);
        let tracking = Tracking::Tracked {
            params: sequence.params(frame),
            residual_rms_m: 0.0,
            joint_confidence: [1.0; 24],
        };
        let clean = Arc::new(self.cleaner.process(&exposure)?);
        Ok(RegisteredFrame { clean, world_from_camera, tracking })
    }

    /// The camera's next frame, and where it stands in the data set's world.
    pub(super) fn expose(
        &mut self,
        sequence: &Sequence,
        frame: usize,
        yaw_rad: f32,
    ) -> (Frame, Rigid3) {
        let (depth, world_from_camera) = match self.camera {
            Camera::Paper => {
                let (depth, world_from_camera) = sequence.protocol_depth(frame, yaw_rad);
                (Arc::new(depth), world_from_camera)
            }
            Camera::Sensor(sensor) => {
                // Moments between the data set's frames share a number: a seed of its own gives each its own noise.
                let seed = self.seed.wrapping_mul(1_000_003).wrapping_add(self.taken);
                let room = Room::Floor;
                let shot = SensorShot { sensor, room, yaw_rad, seed, ..SensorShot::default() };
                let (seen, calibration) = sequence.sensor_frame(frame, &shot);
                (
                    seen.depth,
                    calibration.world_from_camera.unwrap_or_default(),
                )
            }
        };
        let exposure = Frame {
            id: FrameId(self.taken),
            timestamp: Timestamp::from_secs_f64(self.taken as f64 / f64::from(RATE_HZ)),
            depth,
            color: None,
        };
        self.taken += 1;
        (exposure, world_from_camera)
    }
}

impl Lesson<'_> {
    /// The sequence's moment so many seconds later, as a sequence of one frame.
    pub(super) fn moved_by(&self, secs: f32) -> Sequence {
        let scenario = self.sequence.plan.scenario.as_ref();
        let rate_hz = scenario.map_or(RATE_HZ, effigy_sim_sensor::Scenario::rate_hz);
        moment(self.sequence, self.frame as f32 + secs * rate_hz)
    }
}

/// Raw depth of MetaAvatar's camera as a frame.
pub(in crate::commands::evaluate) fn protocol_frame(
    raw: Vec<u16>,
    id: FrameId,
    timestamp: Timestamp,
) -> anyhow::Result<Frame> {
    let (camera, _) = protocol_camera();
    let depth = Arc::new(DepthImage::new(camera.width, camera.height, raw)?);
    Ok(Frame { id, timestamp, depth, color: None })
}

pub(in crate::commands::evaluate) fn protocol_calibration() -> Calibration {
    let (intrinsics, _) = protocol_camera();
    Calibration {
        sensor_name: "MetaAvatar's protocol".to_owned(),
        depth: CameraModel { intrinsics, distortion: Distortion::None },
        color: None,
        color_from_depth: Rigid3::IDENTITY,
        metres_per_unit: 1e-3,
        range_m: [1.0, 10.0],
        rate_hz: RATE_HZ,
        // No noise but the millimetres' own.
        sensor: SensorModel::TimeOfFlight { floor_m: 3e-4, slope: 0.0 },
        world_from_camera: None,
    }
}
