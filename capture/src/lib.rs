//! Frames and where they come from: cameras, calibration, sources, recording and replay.
//!
//! In: a sensor, a file, a folder. Out: [`Frame`]s with one clock and one [`Calibration`] a source.
//! Everything here is in sensor units or in the depth camera's space (x right, y down, z forward, metres).

pub mod calibration;
pub mod camera;
mod codec;
pub mod error;
pub mod frame;
pub mod image;
pub mod import;
pub mod recording;
pub mod replay;
pub mod source;
pub mod time;

pub use calibration::{Calibration, SensorModel};
pub use camera::{CameraModel, Distortion, Intrinsics, Rigid3};
pub use error::CaptureError;
pub use frame::Frame;
pub use image::{ColorImage, DepthImage};
pub use source::FrameSource;
pub use time::{FrameId, Timestamp};
