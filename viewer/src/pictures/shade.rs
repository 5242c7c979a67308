//! A mesh as clay under two lights that move with the camera, so that every side of a turntable is lit.

use effigy_fusion::mesh::z_buffer::{Raster, Rasterizer};
use glam::{Vec3, vec3};
use image::Rgb;

use super::{
    MeshView, Picture, PictureCamera,
    crevices::crevices,
    palette::{self, linear_from_srgb, srgb_from_linear},
};

/// Samples a side of an output pixel.
const SAMPLES: u32 = 2;
/// Directions towards the lights in camera space (x right, y down, z forward), and their strengths.
pub(crate) const KEY: Light =
    Light { towards: vec3(-0.66, -0.58, -0.48), strength: vec3(0.88, 0.85, 0.80) };
pub(crate) const FILL: Light =
    Light { towards: vec3(0.72, -0.08, -0.69), strength: vec3(0.15, 0.18, 0.23) };
/// Light from everywhere, from the ground and from the sky.
pub(crate) const GROUND: Vec3 = vec3(0.045, 0.042, 0.04);
pub(crate) const SKY: Vec3 = vec3(0.13, 0.14, 0.16);
/// How far the key light reaches around the edge of the lit side.
pub(crate) const WRAP: f32 = 0.12;
/// A bright edge that parts the figure from the dark ground.
pub(crate) const RIM: f32 = 0.16;
/// What the deepest crevice keeps of its light.
const CREVICE_FLOOR: f32 = 0.4;

pub(crate) struct Light {
    pub(crate) towards: Vec3,
    pub(crate) strength: Vec3,
}

/// How a mesh is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Clay {
    /// Where the mesh brings no colours of its own.
    pub albedo: [u8; 3],
    pub background: [u8; 3],
}

impl Default for Clay {
    fn default() -> Self {
        Self { albedo: palette::CLAY, background: palette::PANEL }
    }
}

impl Clay {
    /// The colour of the fitted body in every picture.
    pub fn body() -> Self {
        Self { albedo: palette::BODY, ..Self::default() }
    }
}

/// Draws a mesh with smooth edges.
pub fn render_mesh(mesh: MeshView<'_>, camera: &PictureCamera, clay: Clay) -> Picture {
    let fine = camera.enlarged(SAMPLES);
    let lit = LitMesh::new(mesh, &fine, clay.albedo);
    let background = Vec3::from(clay.background.map(linear_from_srgb));
    let sample = |x: u32, y: u32| {
        let pixel = (y * fine.intrinsics.width + x) as usize;
        lit.light(pixel).unwrap_or(background)
    };
    Picture::from_fn(camera.intrinsics.width, camera.intrinsics.height, |x, y| {
        let corners = (0..SAMPLES * SAMPLES)
            .map(|i| sample(x * SAMPLES + i % SAMPLES, y * SAMPLES + i / SAMPLES));
        let mean = corners.sum::<Vec3>() / (SAMPLES * SAMPLES) as f32;
        Rgb(mean.to_array().map(srgb_from_linear))
    })
}

/// A mesh drawn into a raster, ready to say the light of each pixel.
pub(super) struct LitMesh<'a> {
    mesh: MeshView<'a>,
    raster: Raster,
    normals_in_camera: Vec<Vec3>,
    vertices_in_camera: Vec<Vec3>,
    crevices: Vec<f32>,
    albedo: Vec3,
    focal_px: [f32; 2],
    center_px: [f32; 2],
}

impl<'a> LitMesh<'a> {
    pub(super) fn new(mesh: MeshView<'a>, camera: &PictureCamera, albedo: [u8; 3]) -> Self {
        let camera_from_world = camera.camera_from_world;
        let vertices_in_camera: Vec<Vec3> = mesh
            .vertices
            .iter()
            .map(|&v| camera_from_world * v)
            .collect();
        let mut normals_in_camera = mesh.normals_or_computed();
        for normal in &mut normals_in_camera {
            *normal = camera_from_world.rotate(*normal);
        }
        let i = camera.intrinsics;
        let raster = Rasterizer::new(i)
            .draw(&vertices_in_camera, mesh.triangles)
            .clone();
        let crevices = crevices(&raster, i.fy);
        Self {
            mesh,
            raster,
            normals_in_camera,
            vertices_in_camera,
            crevices,
            albedo: Vec3::from(albedo.map(linear_from_srgb)),
            focal_px: [i.fx, i.fy],
            center_px: [i.cx, i.cy],
        }
    }

    pub(super) fn covers(&self, pixel: usize) -> bool {
        self.raster.depth[pixel] > 0.0
    }

    /// Linear light of a pixel, where there is something.
    pub(super) fn light(&self, pixel: usize) -> Option<Vec3> {
        let (triangle, weights) = self.raster.hit(pixel)?;
        let corners = self.mesh.triangles[triangle as usize].map(|i| i as usize);
        let away = self.ray(pixel);
        let normal = self.normal(corners, weights, away);
        let open = CREVICE_FLOOR + (1.0 - CREVICE_FLOOR) * self.crevices[pixel];
        let light = shade(normal, away) * open;
        Some(light * self.albedo_at(corners, weights))
    }

    /// Unit normal towards the camera: the vertices', or where there are none the triangle's.
    fn normal(&self, corners: [usize; 3], weights: Vec3, away: Vec3) -> Vec3 {
        let smooth = blend(corners.map(|i| self.normals_in_camera[i]), weights);
        let [a, b, c] = corners.map(|i| self.vertices_in_camera[i]);
        let flat = (b - a).cross(c - a).normalize_or(-away);
        let normal = smooth.try_normalize().unwrap_or(flat);
        if normal.dot(away) > 0.0 && flat.dot(away) > 0.0 {
            -normal
        } else {
            normal
        }
    }

    fn albedo_at(&self, corners: [usize; 3], weights: Vec3) -> Vec3 {
        if self.mesh.colors.len() != self.mesh.vertices.len() {
            return self.albedo;
        }
        blend(
            corners.map(|i| Vec3::from(self.mesh.colors[i].map(linear_from_srgb))),
            weights,
        )
    }

    /// Unit direction from the camera through a pixel.
    fn ray(&self, pixel: usize) -> Vec3 {
        let (x, y) = (pixel % self.raster.width, pixel / self.raster.width);
        vec3(
            (x as f32 - self.center_px[0]) / self.focal_px[0],
            (y as f32 - self.center_px[1]) / self.focal_px[1],
            1.0,
        )
        .normalize_or_zero()
    }
}

/// Lambert for the two lights, softened at the key light's terminator, and the rim; `normal` and the ray
/// away from the camera are unit vectors in camera space.
fn shade(normal: Vec3, away: Vec3) -> Vec3 {
    let key = ((normal.dot(KEY.towards) + WRAP) / (1.0 + WRAP)).max(0.0);
    let fill = normal.dot(FILL.towards).max(0.0);
    let up = 0.5 - 0.5 * normal.y;
    let grazing = (1.0 + normal.dot(away)).clamp(0.0, 1.0);
    KEY.strength * key + FILL.strength * fill + GROUND.lerp(SKY, up) + RIM * grazing.powi(4)
}

fn blend([a, b, c]: [Vec3; 3], weights: Vec3) -> Vec3 {
    a * weights.x + b * weights.y + c * weights.z
}
