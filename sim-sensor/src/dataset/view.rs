//! A sequence in front of a camera: MetaAvatar's noiseless views, and every sensor's with its own noise.

use std::{f32::consts::PI, sync::Arc};

use effigy_capture::{Calibration, DepthImage, Frame, Intrinsics, Rigid3, Timestamp};
use effigy_fusion::mesh::{TriangleMesh, z_buffer::Rasterizer};
use glam::{Quat, Vec3};

use super::{plan::KEPT_RATE_HZ, sequence::Sequence};
use crate::{
    noise::Exposure,
    person::Paint,
    preset::SensorPreset,
    render::{Renderer, View},
    scenario::{Noise, Room},
};

/// Which sensor looks at a frame, and from where.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SensorShot {
    pub sensor: SensorPreset,
    pub noise: Noise,
    pub room: Room,
    /// How far around the person to their left the sensor stands; 0 is where a person in zero pose looks.
    pub yaw_rad: f32,
    /// Noise follows from this and from the frame's number.
    pub seed: u64,
}

impl Default for SensorShot {
    fn default() -> Self {
        Self {
            sensor: SensorPreset::default(),
            noise: Noise::Sensor,
            room: Room::FloorAndWall,
            yaw_rad: 0.0,
            seed: 1,
        }
    }
}

impl Sequence {
    /// MetaAvatar's view of a frame, without noise (seed paper, section 4.1): from `yaw_rad` to the side of where a
    /// camera at [`protocol_camera`] stands. Depth in millimetres, and where the camera stands.
    pub fn protocol_depth(&self, frame: usize, yaw_rad: f32) -> (DepthImage, Rigid3) {
        let (camera, distance_m) = protocol_camera();
        let pelvis = self.rest_joints[0] + self.frames[frame].trans;
        let turn = Quat::from_rotation_y(yaw_rad);
        let world_from_camera = Rigid3 {
            rotation: turn * Quat::from_rotation_x(PI),
            translation: pelvis + turn * Vec3::Z * distance_m,
        };
        let camera_from_world = world_from_camera.inverse();
        let mesh = self.posed_mesh(frame);
        let seen: Vec<Vec3> = mesh
            .vertices
            .iter()
            .map(|&v| camera_from_world * v)
            .collect();
        let mut rasterizer = Rasterizer::new(camera);
        let raster = rasterizer.draw(&seen, &mesh.triangles);
        let depth = raster.depth.iter().map(|z| (z * 1e3).round() as u16);
        let image = DepthImage::new(camera.width, camera.height, depth.collect());
        (
            image.expect("the raster has the camera's size"),
            world_from_camera,
        )
    }

    /// One of the posed surfaces as a colour camera sees it, with nothing around it.
    pub fn in_color(
        &self,
        posed: &TriangleMesh,
        camera: Intrinsics,
        world_from_camera: Rigid3,
    ) -> View {
        let mut renderer = self.renderer(camera, world_from_camera, Room::Empty);
        renderer.render(posed, &self.paint(), &self.weights).clone()
    }

    /// What a real sensor would deliver of a frame, with its noise, and the calibration that belongs to it
    /// (`world_from_camera` included). The sensor stands as in a simulation, around the pelvis; floor and wall
    /// turn with it, so the wall is always behind the person.
    pub fn sensor_frame(&self, frame: usize, shot: &SensorShot) -> (Frame, Calibration) {
        let mut calibration = shot.sensor.calibration();
        let mount = calibration.world_from_camera.unwrap_or_default();
        let world_from_studio = self.world_from_studio(frame, shot.yaw_rad);
        let studio_from_world = world_from_studio.inverse();
        let mut mesh = self.posed_mesh(frame);
        for vertex in &mut mesh.vertices {
            *vertex = studio_from_world * *vertex;
        }
        for normal in &mut mesh.normals {
            *normal = studio_from_world.rotation * *normal;
        }
        let intrinsics = shot.sensor.intrinsics();
        let mut renderer = self.renderer(intrinsics, mount, shot.room);
        let view = renderer.render(&mesh, &self.paint(), &self.weights);
        let mut exposure = Exposure::new(&calibration, shot.sensor.defects());
        let id = self.frames[frame].id;
        let raw = match shot.noise {
            Noise::Sensor => exposure.expose(view, shot.seed, id),
            Noise::None => exposure.truth(view),
        };
        let depth = DepthImage::new(intrinsics.width, intrinsics.height, raw)
            .expect("the view has the sensor's size");
        let exposed = Frame {
            id,
            timestamp: Timestamp::from_secs_f64(id.0 as f64 / f64::from(KEPT_RATE_HZ)),
            depth: Arc::new(depth),
            color: None,
        };
        calibration.world_from_camera = Some(world_from_studio * mount);
        (exposed, calibration)
    }

    fn renderer(&self, camera: Intrinsics, world_from_camera: Rigid3, room: Room) -> Renderer {
        let renderer = Renderer::new(camera, world_from_camera, room);
        if self.layers.iter().any(|&layer| layer > 0) {
            return renderer.two_sided();
        }
        renderer
    }

    /// From a room in which the person stands above the origin and the sensor where its mount says.
    fn world_from_studio(&self, frame: usize, yaw_rad: f32) -> Rigid3 {
        let pelvis = self.rest_joints[0] + self.frames[frame].trans;
        Rigid3 {
            rotation: Quat::from_rotation_y(yaw_rad),
            translation: Vec3::new(pelvis.x, 0.0, pelvis.z),
        }
    }

    /// What the surface is made of: the very materials of simulated garments; elsewhere what a person's parts
    /// usually are.
    fn paint(&self) -> Paint {
        let (seed, materials) = match &self.plan.scenario {
            Some(scenario) => (scenario.seed, scenario.cloth_materials()),
            None => (u64::from(self.plan.subject), Vec::new()),
        };
        // Vertices are in the order of layers.
        let end = |layer: u8| self.layers.partition_point(|&other| other <= layer);
        let on_person = end(0);
        let person = &self.weights[..on_person];
        let star = self.frames.first().map_or(&[][..], |frame| &frame.star);
        let brow_m = self.rest_joints[15].y + BROW_M;
        let hair: Vec<bool> = star.iter().map(|point| point.y > brow_m).collect();
        if materials.is_empty() {
            return Paint::of_bones(person, &hair[..on_person], seed);
        }
        let garments = (1..).zip(materials);
        let garments = garments.map(|(layer, material)| (end(layer) - end(layer - 1), material));
        Paint::of_bare_skin(person, &hair[..on_person], seed).with_garments(garments)
    }
}

/// Hair begins this far above the head's joint.
const BROW_M: f32 = 0.12;

/// MetaAvatar's camera and its distance from the body in metres: 250 x 250 pixels, f = 250 px.
pub fn protocol_camera() -> (Intrinsics, f32) {
    let intrinsics =
        Intrinsics { width: 250, height: 250, fx: 250.0, fy: 250.0, cx: 125.0, cy: 125.0 };
    (intrinsics, 3.0)
}
