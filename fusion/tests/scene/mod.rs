//! A jointed figure in a room, rendered into depth frames with a sensor's noise.
#![allow(
    dead_code,
    reason = "each test and bench uses its own part of this scene"
)]
#![allow(
    clippy::allow_attributes,
    reason = "whether `dead_code` fires depends on who includes this"
)]

use std::sync::Arc;

use effigy_capture::{
    Calibration, DepthImage, Frame, FrameId, Intrinsics, Rigid3, SensorModel, Timestamp,
};
use effigy_fusion::{
    TriangleMesh,
    mesh::{primitives::sphere, z_buffer::Rasterizer},
};
use glam::{Mat3, Vec3, vec3};

pub(crate) const AZURE: SensorModel = SensorModel::TimeOfFlight { floor_m: 0.0005, slope: 0.001 };
pub(crate) const D435: SensorModel =
    SensorModel::Stereo { baseline_m: 0.05, focal_px: 425.0, subpixel_rms_px: 0.08 };
/// A 640x576 image of 65 degrees height.
pub(crate) const CAMERA: Intrinsics =
    Intrinsics { width: 640, height: 576, fx: 504.0, fy: 504.0, cx: 320.0, cy: 288.0 };
/// The camera's height above the floor.
pub(crate) const CAMERA_HEIGHT_M: f32 = 1.1;

/// Where a figure stands: to the side of the camera's axis, in front of it, turned about the vertical.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Stand {
    pub(crate) side_m: f32,
    pub(crate) distance_m: f32,
    pub(crate) turn_rad: f32,
}

pub(crate) fn at(side_m: f32, distance_m: f32) -> Stand {
    Stand { side_m, distance_m, turn_rad: 0.4 }
}

pub(crate) fn calibration(sensor: SensorModel) -> Calibration {
    Calibration {
        sensor_name: "scene".to_owned(),
        depth: CAMERA.into(),
        color: None,
        color_from_depth: Rigid3::IDENTITY,
        metres_per_unit: 0.001,
        range_m: [0.3, 5.0],
        rate_hz: 30.0,
        sensor,
        world_from_camera: None,
    }
}

/// A figure 1.75 m tall of ellipsoids that overlap; `grain` subdivisions each.
pub(crate) fn figure(stand: Stand, grain: u32) -> TriangleMesh {
    // Centre (x, height, z) and radii, facing -z.
    let limbs = [
        (vec3(0.0, 1.63, 0.0), vec3(0.08, 0.12, 0.10)),
        (vec3(0.0, 1.48, 0.02), vec3(0.06, 0.12, 0.06)),
        (vec3(0.0, 1.2, 0.02), vec3(0.19, 0.26, 0.12)),
        (vec3(0.0, 0.95, 0.02), vec3(0.17, 0.16, 0.12)),
        (vec3(-0.09, 0.65, 0.0), vec3(0.085, 0.34, 0.09)),
        (vec3(0.09, 0.65, 0.0), vec3(0.085, 0.34, 0.09)),
        (vec3(-0.1, 0.26, 0.02), vec3(0.055, 0.26, 0.06)),
        (vec3(0.1, 0.26, 0.02), vec3(0.055, 0.26, 0.06)),
        (vec3(-0.1, 0.05, -0.06), vec3(0.05, 0.05, 0.13)),
        (vec3(0.1, 0.05, -0.06), vec3(0.05, 0.05, 0.13)),
        (vec3(-0.22, 1.25, 0.02), vec3(0.055, 0.18, 0.055)),
        (vec3(0.22, 1.25, 0.02), vec3(0.055, 0.18, 0.055)),
        (vec3(-0.27, 0.98, -0.03), vec3(0.045, 0.17, 0.05)),
        (vec3(0.27, 0.98, -0.03), vec3(0.045, 0.17, 0.05)),
        (vec3(-0.29, 0.8, -0.06), vec3(0.03, 0.09, 0.045)),
        (vec3(0.29, 0.8, -0.06), vec3(0.03, 0.09, 0.045)),
    ];
    let turn = Mat3::from_rotation_y(stand.turn_rad);
    let mut mesh = TriangleMesh::default();
    for (center, radii) in limbs {
        let ball = sphere(Vec3::ZERO, 1.0, grain);
        let offset = mesh.vertices.len() as u32;
        mesh.vertices.extend(ball.vertices.iter().map(|&direction| {
            let body = turn * (center + radii * direction);
            // World up is -y; the flip of one axis is undone by the triangles below.
            vec3(
                body.x + stand.side_m,
                CAMERA_HEIGHT_M - body.y,
                body.z + stand.distance_m,
            )
        }));
        mesh.triangles.extend(
            ball.triangles
                .iter()
                .map(|&[a, b, c]| [a, c, b].map(|v| v + offset)),
        );
    }
    mesh
}

/// The floor, and a wall at 4.2 m.
pub(crate) fn room() -> TriangleMesh {
    let y = CAMERA_HEIGHT_M;
    let vertices = vec![
        vec3(-6.0, y, 0.1),
        vec3(6.0, y, 0.1),
        vec3(6.0, y, 4.2),
        vec3(-6.0, y, 4.2),
        vec3(6.0, -4.0, 4.2),
        vec3(-6.0, -4.0, 4.2),
    ];
    TriangleMesh::new(vertices, vec![[0, 1, 2], [0, 2, 3], [3, 2, 4], [3, 4, 5]])
}

/// What a scene looks like without noise.
pub(crate) struct View {
    pub(crate) depth_m: Vec<f32>,
    /// Which of the meshes each pixel shows.
    pub(crate) mesh: Vec<Option<usize>>,
}

pub(crate) fn render(meshes: &[TriangleMesh], tilt_rad: f32) -> View {
    let mut rasterizer = Rasterizer::new(CAMERA);
    rasterizer.draw(&[], &[]);
    let tilt = Mat3::from_rotation_x(tilt_rad);
    let mut ends = Vec::new();
    for mesh in meshes {
        let first = ends.last().copied().unwrap_or(0);
        let vertices: Vec<Vec3> = mesh.vertices.iter().map(|&vertex| tilt * vertex).collect();
        rasterizer.draw_over(&vertices, &mesh.triangles, first);
        ends.push(first + mesh.triangles.len() as u32);
    }
    let raster = rasterizer.raster();
    let mesh = raster
        .triangle
        .iter()
        .map(|&triangle| ends.iter().position(|&end| triangle < end));
    View { depth_m: raster.depth.clone(), mesh: mesh.collect() }
}

/// A frame of a view with Gaussian noise of the sensor's sigma, and pixels mixed at edges.
pub(crate) fn expose(view: &View, sensor: SensorModel, number: u64) -> Frame {
    let mut random = Random(number.wrapping_mul(0x9E37_79B9).wrapping_add(1));
    let width = CAMERA.width as usize;
    let raw = |pixel: usize| {
        let mut depth_m = view.depth_m[pixel];
        let next = view.depth_m[(pixel + 1) % view.depth_m.len()];
        if !(pixel + 1).is_multiple_of(width)
            && (next - depth_m).abs() > 0.1
            && next * depth_m > 0.0
        {
            depth_m += random.unit() * (next - depth_m);
        }
        if depth_m == 0.0 {
            return 0;
        }
        let gauss: f32 = (0..12).map(|_| random.unit()).sum::<f32>() - 6.0;
        ((depth_m + gauss * sensor.sigma_m(depth_m, 0.0)) * 1000.0).round() as u16
    };
    let pixels = (0..view.depth_m.len()).map(raw).collect();
    let depth = DepthImage::new(CAMERA.width, CAMERA.height, pixels).expect("one number a pixel");
    Frame {
        id: FrameId(number),
        timestamp: Timestamp(0),
        depth: Arc::new(depth),
        color: None,
    }
}

struct Random(u64);

impl Random {
    fn unit(&mut self) -> f32 {
        self.0 = self
            .0
            .wrapping_mul(6364136223846793005)
            .wrapping_add(1442695040888963407);
        (self.0 >> 40) as f32 / (1 << 24) as f32
    }
}
