//! What an ideal camera sees: depth, normals, labels, reflectance and colour of the person and the room.

use effigy_capture::{Intrinsics, Rigid3};
use effigy_fusion::mesh::{
    TriangleMesh,
    z_buffer::{Faces, Rasterizer},
};
use effigy_registration::smpl::VertexWeights;
use glam::{Vec3, vec3};

mod color;
mod label;
mod room;

pub use color::ColorCamera;
pub use label::Label;

use crate::{person::Paint, scenario::Room};

/// An ideal image, row-major, in camera space.
#[derive(Clone, Debug)]
pub struct View {
    pub width: usize,
    pub height: usize,
    /// Along the optical axis, metres; 0 where there is nothing.
    pub depth_m: Vec<f32>,
    /// Unit normals towards the camera; zero where there is nothing.
    pub normals: Vec<Vec3>,
    /// Angle between ray and normal, and its cosine; both 0 where there is nothing.
    pub incidence_rad: Vec<f32>,
    pub cosine: Vec<f32>,
    pub labels: Vec<Label>,
    /// Share of infrared light that comes back.
    pub reflectance: Vec<f32>,
    /// sRGB before shading.
    pub colors: Vec<[u8; 3]>,
    pub camera: Intrinsics,
}

/// Draws the person in front of a room that is drawn only once.
pub struct Renderer {
    rasterizer: Rasterizer,
    faces: Faces,
    camera_from_world: Rigid3,
    empty_room: View,
    view: View,
    drawn: Vec<usize>,
    in_camera: Vec<Vec3>,
    normals_in_camera: Vec<Vec3>,
}

impl Renderer {
    pub fn new(camera: Intrinsics, world_from_camera: Rigid3, room: Room) -> Self {
        let empty_room = room::draw(camera, world_from_camera, room);
        Self {
            rasterizer: Rasterizer::with_faces(camera, Faces::Front),
            faces: Faces::Front,
            camera_from_world: world_from_camera.inverse(),
            view: empty_room.clone(),
            empty_room,
            drawn: Vec::new(),
            in_camera: Vec::new(),
            normals_in_camera: Vec::new(),
        }
    }

    /// For people in simulated clothes: cloth is seen from both sides.
    pub fn two_sided(mut self) -> Self {
        self.faces = Faces::Both;
        self.rasterizer = Rasterizer::with_faces(self.view.camera, self.faces);
        self
    }

    /// Draws one mesh with its normals, in world space; one set of skinning weights a vertex.
    pub fn render(
        &mut self,
        person_in_world: &TriangleMesh,
        paint: &Paint,
        skinning: &[VertexWeights],
    ) -> &View {
        self.restore_room();
        let camera_from_world = self.camera_from_world;
        let rotation = camera_from_world.rotation_matrix();
        self.in_camera.clear();
        self.in_camera.extend(
            person_in_world
                .vertices
                .iter()
                .map(|&v| rotation * v + camera_from_world.translation),
        );
        self.normals_in_camera.clear();
        self.normals_in_camera
            .extend(person_in_world.normals.iter().map(|&n| rotation * n));
        let raster = self
            .rasterizer
            .draw(&self.in_camera, &person_in_world.triangles);
        let view = &mut self.view;
        for pixel in 0..raster.depth.len() {
            let depth_m = raster.depth[pixel];
            let behind_room = view.depth_m[pixel] > 0.0 && view.depth_m[pixel] < depth_m;
            if depth_m <= 0.0 || behind_room {
                continue;
            }
            let Some((triangle, weights)) = raster.hit(pixel) else {
                continue;
            };
            let corners = person_in_world.triangles[triangle as usize].map(|v| v as usize);
            let nearest = corners[nearest_corner(weights)];
            let normal: Vec3 = (0..3)
                .map(|k| self.normals_in_camera[corners[k]] * weights[k])
                .sum();
            view.depth_m[pixel] = depth_m;
            view.normals[pixel] = normal.normalize_or(Vec3::NEG_Z);
            if self.faces == Faces::Both && view.normals[pixel].dot(view.ray(pixel)) > 0.0 {
                view.normals[pixel] = -view.normals[pixel];
            }
            view.measure_incidence(pixel);
            view.labels[pixel] = Label::of_weights(&skinning[nearest]);
            let material = paint.at(corners, weights);
            view.reflectance[pixel] = material.reflectance;
            view.colors[pixel] = material.color;
            self.drawn.push(pixel);
        }
        &self.view
    }

    /// The room with nobody in it.
    pub fn render_room(&mut self) -> &View {
        self.restore_room();
        &self.view
    }

    /// Only what the last image drew over has to be put back.
    fn restore_room(&mut self) {
        for &pixel in &self.drawn {
            self.view.depth_m[pixel] = self.empty_room.depth_m[pixel];
            self.view.normals[pixel] = self.empty_room.normals[pixel];
            self.view.incidence_rad[pixel] = self.empty_room.incidence_rad[pixel];
            self.view.cosine[pixel] = self.empty_room.cosine[pixel];
            self.view.labels[pixel] = self.empty_room.labels[pixel];
            self.view.reflectance[pixel] = self.empty_room.reflectance[pixel];
            self.view.colors[pixel] = self.empty_room.colors[pixel];
        }
        self.drawn.clear();
    }
}

impl View {
    /// The direction a pixel looks in, with z = 1.
    pub fn ray(&self, pixel: usize) -> Vec3 {
        let (x, y) = ((pixel % self.width) as f32, (pixel / self.width) as f32);
        vec3(
            (x - self.camera.cx) / self.camera.fx,
            (y - self.camera.cy) / self.camera.fy,
            1.0,
        )
    }

    /// The point a pixel sees, in camera space.
    pub fn point(&self, pixel: usize) -> Option<Vec3> {
        let depth_m = self.depth_m[pixel];
        (depth_m > 0.0).then(|| self.ray(pixel) * depth_m)
    }

    /// Sets a pixel's angle of incidence from its normal.
    pub fn measure_incidence(&mut self, pixel: usize) {
        let ray = self.ray(pixel);
        let cosine = -self.normals[pixel].dot(ray) * ray.length_recip();
        self.cosine[pixel] = cosine.clamp(0.0, 1.0);
        self.incidence_rad[pixel] = self.cosine[pixel].acos();
    }

    /// The colour image: a lamp above the camera's left shoulder, some light from everywhere.
    pub fn shaded(&self) -> Vec<[u8; 3]> {
        const TO_LAMP: Vec3 = Vec3::new(-0.36, -0.62, -0.70);
        self.colors
            .iter()
            .zip(&self.normals)
            .map(|(color, normal)| {
                let light =
                    0.38 + 0.30 * (-normal.z).max(0.0) + 0.40 * normal.dot(TO_LAMP).max(0.0);
                color.map(|c| (f32::from(c) * light).min(255.0) as u8)
            })
            .collect()
    }
}

fn nearest_corner(weights: Vec3) -> usize {
    if weights.x >= weights.y && weights.x >= weights.z {
        0
    } else if weights.y >= weights.z {
        1
    } else {
        2
    }
}
