//! One view of a test person, and where each of its points truly lies in star pose.

use effigy_capture::{FrameId, Timestamp};
use effigy_fusion::{clean::Cleaner, mesh::z_buffer::Rasterizer};
use effigy_registration::BodyParams;
use effigy_sim_sensor::dataset::{Sequence, protocol_camera};
use glam::Vec3;
use rand::{RngExt as _, SeedableRng as _, rngs::StdRng};
use rand_distr::{Distribution as _, StandardNormal};

use super::region::{Contacts, Region};
use crate::commands::evaluate::avatar::protocol_frame;

/// Points that count of a view.
const POINTS: usize = 5000;

/// At outlines, cleaning may fill a pixel with another surface than the one that is truly there.
const SAME_SURFACE_M: f32 = 0.03;

/// What a sensor adds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Sensor {
    Noiseless,
    /// Independent noise of a time-of-flight camera at 3 m.
    TimeOfFlight,
}

impl Sensor {
    pub(super) const ALL: [Self; 2] = [Self::Noiseless, Self::TimeOfFlight];

    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Noiseless => "noiseless",
            Self::TimeOfFlight => "5 mm of noise",
        }
    }

    /// Millimetres.
    fn sigma_mm(self) -> f32 {
        match self {
            Self::Noiseless => 0.0,
            Self::TimeOfFlight => 5.0,
        }
    }
}

/// Observed points with their truth; one of everything a point.
pub(super) struct View {
    pub(super) params: BodyParams,
    /// World space, as cleaning leaves them.
    pub(super) points: Vec<Vec3>,
    pub(super) normals: Vec<Vec3>,
    pub(super) weights: Vec<[f32; 24]>,
    pub(super) star: Vec<Vec3>,
    pub(super) regions: Vec<Region>,
}

impl View {
    /// What MetaAvatar's camera sees of a frame from this side.
    pub(super) fn new(
        sequence: &Sequence,
        frame: usize,
        yaw_rad: f32,
        sensor: Sensor,
        body: &effigy_registration::BodyModel,
        cleaner: &mut Cleaner,
    ) -> anyhow::Result<Self> {
        let (depth, world_from_camera) = sequence.protocol_depth(frame, yaw_rad);
        let mut rng = StdRng::seed_from_u64(frame as u64 ^ u64::from(yaw_rad.to_bits()));
        let mut raw = depth.pixels().to_vec();
        for value in raw.iter_mut().filter(|value| **value > 0) {
            let noise: f32 = StandardNormal.sample(&mut rng);
            *value = (f32::from(*value) + noise * sensor.sigma_mm()).round() as u16;
        }
        let exposure = protocol_frame(
            raw,
            FrameId(frame as u64),
            Timestamp::from_secs_f64(frame as f64),
        )?;
        let clean = cleaner.process(&exposure)?;

        let mesh = sequence.posed_mesh(frame);
        let star = &sequence.frames[frame].star;
        let camera_from_world = world_from_camera.inverse();
        let in_camera: Vec<Vec3> = mesh
            .vertices
            .iter()
            .map(|&vertex| camera_from_world * vertex)
            .collect();
        let mut rasterizer = Rasterizer::new(protocol_camera().0);
        let raster = rasterizer.draw(&in_camera, &mesh.triangles);

        let params = sequence.params(frame);
        let contacts = Contacts::new(body, &sequence.betas, &body.pose(&params));
        let mut view = Self {
            params,
            points: Vec::new(),
            normals: Vec::new(),
            weights: Vec::new(),
            star: Vec::new(),
            regions: Vec::new(),
        };
        let mut pixels: Vec<usize> = (0..clean.person.len())
            .filter(|&pixel| clean.person[pixel] && clean.vertices.points[pixel].is_finite())
            .collect();
        for index in 0..pixels.len().min(POINTS) {
            let other = rng.random_range(index..pixels.len());
            pixels.swap(index, other);
        }
        pixels.truncate(POINTS);
        for pixel in pixels {
            let Some((triangle, barycentric)) = raster.hit(pixel) else {
                continue;
            };
            let corners = mesh.triangles[triangle as usize].map(|v| v as usize);
            let mut weights = [0.0; 24];
            let (mut place, mut truth) = (Vec3::ZERO, Vec3::ZERO);
            for (&vertex, share) in corners.iter().zip(barycentric.to_array()) {
                place += star[vertex] * share;
                truth += mesh.vertices[vertex] * share;
                let own = effigy_avatar::skinning::dense(&sequence.weights[vertex]);
                weights
                    .iter_mut()
                    .zip(own)
                    .for_each(|(sum, w)| *sum += share * w);
            }
            let point = world_from_camera * clean.vertices.points[pixel];
            if point.distance(truth) > SAME_SURFACE_M {
                continue;
            }
            let normal = clean.normals.normals[pixel];
            let normal = if normal.is_finite() {
                world_from_camera.rotate(normal)
            } else {
                Vec3::ZERO
            };
            view.regions.push(contacts.region(&weights, point, place));
            view.points.push(point);
            view.normals.push(normal);
            view.weights.push(weights);
            view.star.push(place);
        }
        Ok(view)
    }
}
