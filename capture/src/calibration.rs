//! What a source knows about itself: its cameras, units and noise.

use serde::{Deserialize, Serialize};

use crate::camera::{CameraModel, Rigid3};

/// Everything that stays the same from frame to frame of one source.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Calibration {
    /// What the sensor is, for people: "azure", "d435".
    pub sensor_name: String,
    pub depth: CameraModel,
    pub color: Option<CameraModel>,
    pub color_from_depth: Rigid3,
    pub metres_per_unit: f32,
    /// Nearest and farthest depth the sensor can be trusted with.
    pub range_m: [f32; 2],
    pub rate_hz: f32,
    pub sensor: SensorModel,
    /// Where the depth camera stands in the world (y up, floor at y = 0), if anybody knows.
    pub world_from_camera: Option<Rigid3>,
}

/// How a sensor errs; from it comes the sigma of each pixel. Sources: `docs/sensors.md`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum SensorModel {
    /// Triangulation between two imagers: sigma grows with the square of depth.
    Stereo { baseline_m: f32, focal_px: f32, subpixel_rms_px: f32 },
    /// Kinect v1's projected pattern (Nguyen, Izadi and Lovell 2012).
    StructuredLight,
    /// Phase measurement: `sigma_m = floor_m + slope * max(0, depth - 0.5 m)`.
    TimeOfFlight { floor_m: f32, slope: f32 },
}

impl SensorModel {
    /// Standard deviation of depth in metres at a depth and an angle between ray and surface normal.
    pub fn sigma_m(&self, depth_m: f32, incidence_rad: f32) -> f32 {
        // The angle enters as in Nguyen et al.: theta^2 / (pi/2 - theta)^2, kept finite at grazing rays.
        let theta = incidence_rad.clamp(0.0, 1.4);
        let grazing = (theta / (std::f32::consts::FRAC_PI_2 - theta)).powi(2);
        match *self {
            Self::Stereo { baseline_m, focal_px, subpixel_rms_px } => {
                depth_m * depth_m * subpixel_rms_px / (focal_px * baseline_m)
                    * (1.0 + 0.05 * grazing)
            }
            Self::StructuredLight => {
                0.0012
                    + 0.0019 * (depth_m - 0.4).powi(2)
                    + 0.0001 / depth_m.max(0.1).sqrt() * grazing
            }
            Self::TimeOfFlight { floor_m, slope } => {
                floor_m
                    + slope * (depth_m - 0.5).max(0.0)
                    + 0.0001 * depth_m.max(0.0).powf(1.5) * grazing
            }
        }
    }
}
