//! The sensors on offer: what they are, and where the simulator puts them.

use effigy_capture::{Calibration, CameraModel, Distortion, Intrinsics, Rigid3, SensorModel};
use glam::{EulerRot, Quat, Vec3, vec3};
use serde::{Deserialize, Serialize};

use crate::noise::{
    stereo::Stereo, structured_light::StructuredLight, time_of_flight::TimeOfFlight,
};

/// A depth camera by name. Figures and sources: `docs/sensors.md`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SensorPreset {
    /// Azure Kinect, narrow field of view, unbinned: time of flight, 640x576.
    #[default]
    Azure,
    /// `RealSense` D435: active stereo, 848x480.
    D435,
    /// `RealSense` D455: active stereo with a wider baseline, 848x480.
    D455,
    /// Luxonis OAK-D at 400P: stereo with 1/8 pixel steps, 640x400.
    Oak,
    /// Kinect v1: structured light, 640x480.
    Kinect,
}

/// How a sensor spoils the truth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Defects {
    TimeOfFlight(TimeOfFlight),
    Stereo(Stereo),
    StructuredLight(StructuredLight),
}

/// Where a camera stands: in front of the origin, looking along -z.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Mount {
    pub height_m: f32,
    /// From where the person begins.
    pub distance_m: f32,
    /// How far it is tilted down.
    pub down_rad: f32,
}

const METRES_PER_UNIT: f32 = 0.001;
const RATE_HZ: f32 = 30.0;

impl SensorPreset {
    pub const ALL: [Self; 5] = [Self::Azure, Self::D435, Self::Oak, Self::Kinect, Self::D455];

    pub fn name(self) -> &'static str {
        match self {
            Self::Azure => "azure",
            Self::D435 => "d435",
            Self::D455 => "d455",
            Self::Oak => "oak",
            Self::Kinect => "kinect",
        }
    }

    pub fn calibration(self) -> Calibration {
        let intrinsics = self.intrinsics();
        Calibration {
            sensor_name: self.name().to_owned(),
            depth: intrinsics.into(),
            color: None,
            color_from_depth: Rigid3::IDENTITY,
            metres_per_unit: METRES_PER_UNIT,
            range_m: self.range_m(),
            rate_hz: RATE_HZ,
            sensor: self.sensor_model(),
            world_from_camera: Some(self.mount().world_from_camera()),
        }
    }

    pub fn intrinsics(self) -> Intrinsics {
        let (width, height, focal_px) = match self {
            Self::Azure => (640, 576, 504.0),
            Self::D435 | Self::D455 => (848, 480, 424.0),
            Self::Oak => (640, 400, 441.0),
            Self::Kinect => (640, 480, 585.0),
        };
        Intrinsics {
            width,
            height,
            fx: focal_px,
            fy: focal_px,
            cx: (width - 1) as f32 * 0.5,
            cy: (height - 1) as f32 * 0.5,
        }
    }

    /// The colour camera: a lens of its own, at the smallest size the sensor streams in.
    pub fn color_camera(self) -> CameraModel {
        let (width, height, focal_px, lens) = match self {
            Self::Azure => (
                1280,
                720,
                608.0,
                [0.52, -2.65, 4.2e-4, -1.6e-4, 1.52, 0.40, -2.47, 1.44],
            ),
            Self::D435 => (
                640,
                480,
                616.0,
                [0.12, -0.25, 6.0e-4, -3.0e-4, 0.0, 0.0, 0.0, 0.0],
            ),
            Self::D455 => (
                640,
                480,
                386.0,
                [-0.055, 0.065, -4.0e-4, 5.0e-4, -0.021, 0.0, 0.0, 0.0],
            ),
            Self::Oak => (
                640,
                360,
                462.0,
                [0.09, -0.18, 2.0e-4, 5.0e-4, 0.0, 0.0, 0.0, 0.0],
            ),
            Self::Kinect => (
                640,
                480,
                525.0,
                [0.26, -0.78, -1.0e-3, 2.0e-3, 0.92, 0.0, 0.0, 0.0],
            ),
        };
        // Nobody's lens sits exactly in the middle.
        let intrinsics = Intrinsics {
            width,
            height,
            fx: focal_px,
            fy: focal_px * 0.999,
            cx: (width - 1) as f32 * 0.5 + 3.2,
            cy: (height - 1) as f32 * 0.5 - 2.1,
        };
        CameraModel { intrinsics, distortion: Distortion::BrownConrady(lens) }
    }

    /// Where the colour camera sits beside the depth camera, and how it is turned.
    pub fn color_from_depth(self) -> Rigid3 {
        let (aside_m, turned_rad) = match self {
            // The Azure's colour camera looks up from the tilted depth camera by 6 degrees.
            Self::Azure => (vec3(-0.032, -0.002, 0.004), [0.105, 0.002, -0.001]),
            Self::D435 => (vec3(0.015, 0.0, 0.0), [0.004, -0.003, 0.002]),
            Self::D455 => (vec3(-0.059, 0.0, 0.0), [-0.003, 0.002, 0.001]),
            Self::Oak => (vec3(-0.0375, 0.0, 0.001), [0.002, 0.005, -0.001]),
            Self::Kinect => (vec3(-0.025, 0.0, -0.001), [-0.006, 0.004, 0.001]),
        };
        let [x, y, z] = turned_rad;
        Rigid3 { rotation: Quat::from_euler(EulerRot::XYZ, x, y, z), translation: aside_m }
    }

    pub fn range_m(self) -> [f32; 2] {
        match self {
            Self::Azure => [0.5, 3.86],
            Self::D435 => [0.28, 6.0],
            Self::D455 => [0.40, 6.0],
            Self::Oak => [0.35, 8.0],
            Self::Kinect => [0.5, 4.5],
        }
    }

    pub fn sensor_model(self) -> SensorModel {
        let focal_px = self.intrinsics().fx;
        match self {
            Self::Azure => SensorModel::TimeOfFlight { floor_m: 0.0005, slope: 0.001 },
            Self::D435 => {
                SensorModel::Stereo { baseline_m: 0.050, focal_px, subpixel_rms_px: 0.08 }
            }
            Self::D455 => {
                SensorModel::Stereo { baseline_m: 0.095, focal_px, subpixel_rms_px: 0.08 }
            }
            Self::Oak => SensorModel::Stereo { baseline_m: 0.075, focal_px, subpixel_rms_px: 0.10 },
            Self::Kinect => SensorModel::StructuredLight,
        }
    }

    pub fn defects(self) -> Defects {
        let model = self.sensor_model();
        match self {
            Self::Azure => Defects::TimeOfFlight(TimeOfFlight::azure(model)),
            Self::D435 | Self::D455 => {
                Defects::Stereo(Stereo { steps_per_px: 32.0, window_px: 7, ..Stereo::of(model) })
            }
            // Without a projector, plain cloth and walls leave windows with nothing to match.
            Self::Oak => Defects::Stereo(Stereo {
                steps_per_px: 8.0,
                window_px: 7,
                hole_share: 0.03,
                ..Stereo::of(model)
            }),
            Self::Kinect => Defects::StructuredLight(StructuredLight::kinect()),
        }
    }

    /// Far enough away for a tall person's raised hands and both feet to be in view.
    fn mount(self) -> Mount {
        match self {
            Self::Azure | Self::D435 | Self::D455 => {
                Mount { height_m: 1.20, distance_m: 2.45, down_rad: 0.02 }
            }
            Self::Oak => Mount { height_m: 1.20, distance_m: 3.00, down_rad: 0.0 },
            Self::Kinect => Mount { height_m: 1.20, distance_m: 3.30, down_rad: 0.0 },
        }
    }
}

impl Mount {
    pub(crate) fn world_from_camera(self) -> Rigid3 {
        // Half a turn about x makes "down, forward" of "up, backward"; less than that tilts down.
        let rotation = Quat::from_rotation_x(std::f32::consts::PI - self.down_rad);
        let translation: Vec3 = vec3(0.0, self.height_m, self.distance_m);
        Rigid3 { rotation, translation }
    }
}
