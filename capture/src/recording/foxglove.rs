//! The Foxglove messages that a recording holds, as other tools know them.
//!
//! Field numbers follow <https://github.com/foxglove/foxglove-sdk/tree/main/schemas/proto>; `descriptor.rs`
//! carries the same numbers into the file, and a test keeps the two together.

use glam::{DQuat, Mat3};
use prost::Message;

use crate::{
    camera::{CameraModel, Distortion, Rigid3},
    time::Timestamp,
};

/// `google.protobuf.Timestamp`.
#[derive(Clone, PartialEq, Message)]
pub(crate) struct Time {
    #[prost(int64, tag = "1")]
    pub(crate) seconds: i64,
    #[prost(int32, tag = "2")]
    pub(crate) nanos: i32,
}

#[derive(Clone, PartialEq, Message)]
pub(crate) struct CompressedImage {
    #[prost(message, optional, tag = "1")]
    pub(crate) timestamp: Option<Time>,
    #[prost(bytes = "vec", tag = "2")]
    pub(crate) data: Vec<u8>,
    #[prost(string, tag = "3")]
    pub(crate) format: String,
    #[prost(string, tag = "4")]
    pub(crate) frame_id: String,
}

#[derive(Clone, PartialEq, Message)]
pub(crate) struct CameraCalibration {
    #[prost(message, optional, tag = "1")]
    pub(crate) timestamp: Option<Time>,
    #[prost(fixed32, tag = "2")]
    pub(crate) width: u32,
    #[prost(fixed32, tag = "3")]
    pub(crate) height: u32,
    #[prost(string, tag = "4")]
    pub(crate) distortion_model: String,
    #[prost(double, repeated, tag = "5")]
    pub(crate) d: Vec<f64>,
    #[prost(double, repeated, tag = "6")]
    pub(crate) k: Vec<f64>,
    #[prost(double, repeated, tag = "7")]
    pub(crate) r: Vec<f64>,
    #[prost(double, repeated, tag = "8")]
    pub(crate) p: Vec<f64>,
    #[prost(string, tag = "9")]
    pub(crate) frame_id: String,
}

#[derive(Clone, PartialEq, Message)]
pub(crate) struct Vector3 {
    #[prost(double, tag = "1")]
    pub(crate) x: f64,
    #[prost(double, tag = "2")]
    pub(crate) y: f64,
    #[prost(double, tag = "3")]
    pub(crate) z: f64,
}

#[derive(Clone, PartialEq, Message)]
pub(crate) struct Quaternion {
    #[prost(double, tag = "1")]
    pub(crate) x: f64,
    #[prost(double, tag = "2")]
    pub(crate) y: f64,
    #[prost(double, tag = "3")]
    pub(crate) z: f64,
    #[prost(double, tag = "4")]
    pub(crate) w: f64,
}

#[derive(Clone, PartialEq, Message)]
pub(crate) struct FrameTransform {
    #[prost(message, optional, tag = "1")]
    pub(crate) timestamp: Option<Time>,
    #[prost(string, tag = "2")]
    pub(crate) parent_frame_id: String,
    #[prost(string, tag = "3")]
    pub(crate) child_frame_id: String,
    #[prost(message, optional, tag = "4")]
    pub(crate) translation: Option<Vector3>,
    #[prost(message, optional, tag = "5")]
    pub(crate) rotation: Option<Quaternion>,
}

impl From<Timestamp> for Time {
    fn from(time: Timestamp) -> Self {
        Self { seconds: (time.0 / 1_000_000_000) as i64, nanos: (time.0 % 1_000_000_000) as i32 }
    }
}

impl CameraCalibration {
    pub(crate) fn new(camera: &CameraModel, space: &str, time: Timestamp) -> Self {
        let i = &camera.intrinsics;
        let [fx, fy, cx, cy] = [i.fx, i.fy, i.cx, i.cy].map(f64::from);
        let (distortion_model, d) = match &camera.distortion {
            Distortion::None => ("plumb_bob", vec![0.0; 5]),
            Distortion::BrownConrady([k @ .., 0.0, 0.0, 0.0]) => ("plumb_bob", doubles(k)),
            Distortion::BrownConrady(k) => ("rational_polynomial", doubles(k)),
            Distortion::KannalaBrandt(k) => ("kannala_brandt", doubles(k)),
        };
        Self {
            timestamp: Some(time.into()),
            width: i.width,
            height: i.height,
            distortion_model: distortion_model.to_owned(),
            d,
            k: vec![fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0],
            r: doubles(&Mat3::IDENTITY.to_cols_array()),
            p: vec![fx, 0.0, cx, 0.0, 0.0, fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0],
            frame_id: space.to_owned(),
        }
    }
}

impl FrameTransform {
    /// Where `child` stands in `parent`.
    pub(crate) fn new(
        parent: &str,
        child: &str,
        parent_from_child: Rigid3,
        time: Timestamp,
    ) -> Self {
        let translation = parent_from_child.translation.as_dvec3();
        let DQuat { x, y, z, w } = parent_from_child.rotation.as_dquat();
        Self {
            timestamp: Some(time.into()),
            parent_frame_id: parent.to_owned(),
            child_frame_id: child.to_owned(),
            translation: Some(Vector3 { x: translation.x, y: translation.y, z: translation.z }),
            rotation: Some(Quaternion { x, y, z, w }),
        }
    }
}

fn doubles(values: &[f32]) -> Vec<f64> {
    values.iter().copied().map(f64::from).collect()
}
