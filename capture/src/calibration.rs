//! What a source knows about itself: its cameras, units and noise.

use serde::{Deserialize, Serialize};

use crate::{
    camera::{CameraModel, Distortion, Intrinsics, Rigid3},
    codec::MAX_PIXELS,
    error::CaptureError,
};

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

/// Frames a second of anything from a time lapse to a high-speed camera.
pub(crate) const RATES_HZ: std::ops::RangeInclusive<f32> = 0.01..=1000.0;

impl Calibration {
    /// Refuses what no camera can be: sizes, focal lengths, ranges and rates that are not finite and positive.
    pub fn check(&self) -> Result<(), CaptureError> {
        check_camera(&self.depth, "depth camera")?;
        if let Some(color) = &self.color {
            check_camera(color, "colour camera")?;
        }
        check(
            positive(self.metres_per_unit),
            "metres_per_unit",
            self.metres_per_unit,
            "a positive length",
        )?;
        let [near, far] = self.range_m;
        let ordered = near.is_finite() && far.is_finite() && 0.0 <= near && near < far;
        check(ordered, "range_m", self.range_m, "0 <= near < far")?;
        check(
            RATES_HZ.contains(&self.rate_hz),
            "rate_hz",
            self.rate_hz,
            "0.01 to 1000 frames a second",
        )?;
        check_rigid(self.color_from_depth, "color_from_depth")?;
        check_rigid(
            self.world_from_camera.unwrap_or_default(),
            "world_from_camera",
        )?;
        check(
            self.sensor.is_valid(),
            "sensor",
            self.sensor,
            "figures of noise >= 0, lengths positive",
        )
    }
}

fn check_camera(camera: &CameraModel, field: &'static str) -> Result<(), CaptureError> {
    let Intrinsics { width, height, fx, fy, cx, cy } = camera.intrinsics;
    let pixels = u64::from(width) * u64::from(height);
    check(
        (1..=MAX_PIXELS).contains(&pixels),
        field,
        [width, height],
        "between 1 pixel and 16 megapixels",
    )?;
    let pinhole = positive(fx) && positive(fy) && cx.is_finite() && cy.is_finite();
    check(
        pinhole,
        field,
        camera.intrinsics,
        "positive fx and fy, finite cx and cy",
    )?;
    let coefficients: &[f32] = match &camera.distortion {
        Distortion::None => &[],
        Distortion::BrownConrady(k) => k,
        Distortion::KannalaBrandt(k) => k,
    };
    check(
        coefficients.iter().all(|k| k.is_finite()),
        field,
        camera.distortion,
        "finite coefficients",
    )
}

fn check_rigid(transform: Rigid3, field: &'static str) -> Result<(), CaptureError> {
    // f32 products of a few rotations stay within 1e-5 of unit length.
    let unit = (transform.rotation.length() - 1.0).abs() < 1e-3;
    check(
        unit && transform.translation.is_finite(),
        field,
        transform,
        "a unit quaternion and a finite translation",
    )
}

fn check(
    holds: bool,
    field: &'static str,
    found: impl std::fmt::Debug,
    expected: &'static str,
) -> Result<(), CaptureError> {
    if holds {
        return Ok(());
    }
    Err(CaptureError::BadCalibration { field, found: format!("{found:?}"), expected })
}

fn positive(value: f32) -> bool {
    value.is_finite() && value > 0.0
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

/// Nguyen's angle term at 60 degrees: what stereo's sources say of walls and people ends there.
const GRAZING_AT_60_DEGREES: f32 = 4.0;

impl SensorModel {
    fn is_valid(self) -> bool {
        match self {
            Self::Stereo { baseline_m, focal_px, subpixel_rms_px } => {
                positive(baseline_m) && positive(focal_px) && subpixel_rms_px >= 0.0
            }
            Self::StructuredLight => true,
            Self::TimeOfFlight { floor_m, slope } => floor_m >= 0.0 && slope.is_finite(),
        }
    }

    /// Standard deviation of depth in metres at a depth and an angle between ray and surface normal.
    pub fn sigma_m(self, depth_m: f32, incidence_rad: f32) -> f32 {
        // The angle enters as in Nguyen et al.: theta^2 / (pi/2 - theta)^2, kept finite at grazing rays.
        let theta = incidence_rad.clamp(0.0, 1.4);
        let grazing = (theta / (std::f32::consts::FRAC_PI_2 - theta)).powi(2);
        match self {
            Self::Stereo { baseline_m, focal_px, subpixel_rms_px } => {
                // No source has an angle term. Beyond 60 degrees windows see ever fewer of the same points in both
                // images; that this makes them worse is our own assumption.
                let slant = 1.0 + 0.05 * (grazing - GRAZING_AT_60_DEGREES).max(0.0);
                depth_m * depth_m * subpixel_rms_px / (focal_px * baseline_m) * slant
            }
            Self::StructuredLight => {
                0.0012
                    + 0.0019 * (depth_m - 0.4).powi(2)
                    + 0.0001 / depth_m.max(0.1).sqrt() * grazing
            }
            Self::TimeOfFlight { floor_m, slope } => {
                floor_m
                    + slope * (depth_m - 0.5).max(0.0)
                    + 0.0001 * depth_m.max(0.0) * depth_m.max(0.0).sqrt() * grazing
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stereo_is_as_good_at_60_degrees_as_frontal_and_worse_beyond() {
        let stereo =
            SensorModel::Stereo { baseline_m: 0.05, focal_px: 424.0, subpixel_rms_px: 0.08 };
        let of = |degrees: f32| stereo.sigma_m(2.0, degrees.to_radians());
        assert!((of(0.0) - 4.0 * 0.08 / (424.0 * 0.05)).abs() < 1e-6);
        assert!((of(60.0) / of(0.0) - 1.0).abs() < 1e-4, "{}", of(60.0));
        assert!(of(75.0) > 1.5 * of(0.0), "{}", of(75.0));
        assert!(of(90.0).is_finite());
    }
}
