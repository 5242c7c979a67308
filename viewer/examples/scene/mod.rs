//! A made-up moment in front of a depth camera: a moving body in a room, seen with a little noise.

use std::sync::Arc;

use effigy_capture::{DepthImage, Frame, FrameId, Intrinsics, Rigid3, Timestamp};
use effigy_fusion::{
    CleanFrame, DepthMap, NormalMap, VertexMap, clean::PersonVisibility, mesh::z_buffer::Rasterizer,
};
use effigy_registration::smpl::{BodyModel, BodyParams, builtin};
use effigy_viewer::{AvatarView, BodyView};
use glam::{Quat, Vec2, Vec3, vec3};

pub(crate) const CAMERA: Intrinsics =
    Intrinsics { width: 640, height: 576, fx: 504.0, fy: 504.0, cx: 319.5, cy: 287.5 };
const WALL_Z_M: f32 = -1.6;

/// Everything there is to see at one moment, in the spaces of the crate's own types.
pub(crate) struct Moment {
    pub(crate) frame: Arc<Frame>,
    pub(crate) clean: Arc<CleanFrame>,
    pub(crate) body: Arc<BodyView>,
    pub(crate) avatar: Arc<AvatarView>,
}

pub(crate) struct Scene {
    pub(crate) world_from_camera: Rigid3,
    body: Arc<BodyModel>,
    triangles: Arc<Vec<[u32; 3]>>,
}

impl Scene {
    pub(crate) fn new() -> Self {
        let world_from_camera = Rigid3 {
            rotation: Quat::from_rotation_x(std::f32::consts::PI),
            translation: vec3(0.0, 1.0, 2.3),
        };
        let body = builtin::body();
        let triangles = Arc::new(body.triangles.clone());
        Self { world_from_camera, body, triangles }
    }

    pub(crate) fn at(&self, number: u64) -> Moment {
        let seconds = number as f32 / 30.0;
        let id = FrameId(number);
        let posed = self.posed(seconds);
        let clothed = clothed(&posed, &self.triangles);
        let (depth, person) = self.depth(&clothed, number);
        let units = depth.metres.iter().map(|m| {
            if m.is_finite() {
                (m * 1000.0) as u16
            } else {
                0
            }
        });
        let image =
            DepthImage::new(CAMERA.width, CAMERA.height, units.collect()).expect("one a pixel");
        let timestamp = Timestamp::from_secs_f64(f64::from(seconds));
        let normals = effigy_fusion::mesh::normals::vertex_normals(&clothed, &self.triangles);
        let triangles = Arc::clone(&self.triangles);
        let avatar =
            AvatarView { id, vertices: clothed, normals, triangles, colors: Arc::default() };
        Moment {
            frame: Arc::new(Frame { id, timestamp, depth: Arc::new(image), color: None }),
            clean: Arc::new(clean_frame(id, timestamp, depth, person)),
            body: Arc::new(BodyView {
                id,
                vertices: posed,
                triangles: Arc::clone(&self.triangles),
            }),
            avatar: Arc::new(avatar),
        }
    }

    /// Looks left and right, arms half down and swinging, feet on the floor.
    fn posed(&self, seconds: f32) -> Vec<Vec3> {
        let mut params = BodyParams::ZERO;
        let swing = (1.7 * seconds).sin();
        params.theta[0] = vec3(0.0, 0.7 * (0.8 * seconds).sin(), 0.0);
        params.theta[15] = vec3(0.1 * swing, 0.25 * swing, 0.0);
        params.theta[16] = vec3(0.0, 0.2 * swing, -0.95 + 0.2 * swing);
        params.theta[17] = vec3(0.0, 0.2 * swing, 0.95 + 0.2 * swing);
        params.theta[18] = vec3(0.0, -0.35 - 0.3 * swing, 0.0);
        params.theta[19] = vec3(0.0, 0.35 - 0.3 * swing, 0.0);
        let mut vertices = self.body.pose(&params).vertices;
        let lowest = vertices.iter().map(|v| v.y).fold(f32::MAX, f32::min);
        for vertex in &mut vertices {
            vertex.y -= lowest;
        }
        vertices
    }

    /// What the camera measures, and which of it is the person.
    fn depth(&self, surface: &[Vec3], number: u64) -> (DepthMap, Vec<bool>) {
        let camera_from_world = self.world_from_camera.inverse();
        let in_camera: Vec<Vec3> = surface.iter().map(|v| camera_from_world * *v).collect();
        let mut rasterizer = Rasterizer::new(CAMERA);
        let raster = rasterizer.draw(&in_camera, &self.triangles);
        let person: Vec<bool> = raster.depth.iter().map(|d| *d > 0.0).collect();
        let mut random = number.wrapping_mul(0x9E37_79B9) | 1;
        let metres = raster.depth.iter().enumerate().map(|(pixel, drawn)| {
            let exact = if *drawn > 0.0 {
                *drawn
            } else {
                self.room_depth(pixel)
            };
            // Two uniform numbers make a triangular distribution of about 1 mm.
            let noise = (0..2).map(|_| uniform(&mut random) - 0.5).sum::<f32>();
            exact + 0.0025 * noise
        });
        let metres = metres.collect();
        (
            DepthMap { width: CAMERA.width as usize, height: CAMERA.height as usize, metres },
            person,
        )
    }

    fn room_depth(&self, pixel: usize) -> f32 {
        let width = CAMERA.width as usize;
        let at = Vec2::new((pixel % width) as f32, (pixel / width) as f32);
        let ray = self.world_from_camera.rotate(CAMERA.unproject(at, 1.0));
        let origin = self.world_from_camera.translation;
        let floor = if ray.y < 0.0 {
            -origin.y / ray.y
        } else {
            f32::MAX
        };
        let wall = (WALL_Z_M - origin.z) / ray.z;
        floor.min(wall)
    }
}

/// Moves vertices outwards in folds, as loose clothes would.
fn clothed(vertices: &[Vec3], triangles: &[[u32; 3]]) -> Vec<Vec3> {
    let normals = effigy_fusion::mesh::normals::vertex_normals(vertices, triangles);
    let grow = |(v, n): (&Vec3, &Vec3)| {
        let folds = (60.0 * v.y + 25.0 * v.x).sin() * (31.0 * v.x - 18.0 * v.z).sin();
        let sleeve = ((v.y - 0.25) / 0.1).clamp(0.0, 1.0) * ((1.42 - v.y) / 0.05).clamp(0.0, 1.0);
        *v + *n * sleeve * (0.014 + 0.006 * folds)
    };
    vertices.iter().zip(&normals).map(grow).collect()
}

fn clean_frame(
    id: FrameId,
    timestamp: Timestamp,
    depth: DepthMap,
    person: Vec<bool>,
) -> CleanFrame {
    let (width, height) = (depth.width, depth.height);
    let at = |x: usize, y: usize| {
        CAMERA.unproject(Vec2::new(x as f32, y as f32), depth.metres[y * width + x])
    };
    let points: Vec<Vec3> = (0..width * height)
        .map(|i| at(i % width, i / width))
        .collect();
    let normals = (0..width * height).map(|i| {
        let (x, y) = (
            (i % width).clamp(2, width - 3),
            (i / width).clamp(2, height - 3),
        );
        let across = at(x + 2, y) - at(x - 2, y);
        let down = at(x, y + 2) - at(x, y - 2);
        down.cross(across).normalize_or_zero()
    });
    let normals = normals.collect();
    let sigma_m = vec![0.001; width * height];
    CleanFrame {
        id,
        timestamp,
        vertices: VertexMap { width, height, points },
        normals: NormalMap { width, height, normals },
        depth,
        person,
        sigma_m,
        floor: None,
        visibility: PersonVisibility::Whole,
    }
}

/// A small congruential generator: the example shall look the same every time.
fn uniform(state: &mut u64) -> f32 {
    *state = state
        .wrapping_mul(6364136223846793005)
        .wrapping_add(1442695040888963407);
    (*state >> 40) as f32 / (1_u64 << 24) as f32
}
