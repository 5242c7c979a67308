//! Clouds of simulated people for the skinning networks: what a depth camera sees of them and whole surfaces, with
//! the errors of sensors and of registration.

use anyhow::bail;
use effigy_avatar::skinning::{
    Warp, dense,
    network::train::{CloudKind, CloudSource, TrainingCloud},
};
use effigy_capture::Rigid3;
use effigy_fusion::{
    TriangleMesh,
    mesh::{sample::sample_surface, z_buffer::Rasterizer},
};
use effigy_registration::BodyParams;
use effigy_sim_sensor::dataset::{Dataset, Sequence, Split, protocol_camera};
use glam::{Quat, Vec3};
use rand::{Rng as _, RngExt as _, SeedableRng as _, rngs::StdRng};
use rand_distr::{Distribution as _, StandardNormal};

/// Of so many training people, one is held out, in all they do.
const HELD_OUT_EVERY: usize = 10;

/// All training sequences of a data set.
pub(crate) struct Clouds {
    sequences: Vec<Sequence>,
    training: Vec<usize>,
    held_out: Vec<usize>,
    points: usize,
    seed: u64,
}

/// A place on a triangle.
struct Place {
    corners: [u32; 3],
    barycentric: Vec3,
}

impl Clouds {
    /// Reads the training people, never the test people.
    pub(crate) fn load(dataset: &Dataset, points: usize, seed: u64) -> anyhow::Result<Self> {
        let people = dataset.manifest().wearers(Split::Train);
        if people.len() < HELD_OUT_EVERY {
            bail!(
                "{} training people in this data set, expected {HELD_OUT_EVERY} or more; make one with `effigy dataset make --preset prior`",
                people.len()
            );
        }
        let (mut sequences, mut training, mut held_out) = (Vec::new(), Vec::new(), Vec::new());
        for (number, entries) in people.into_iter().enumerate() {
            let is_held_out = number % HELD_OUT_EVERY == HELD_OUT_EVERY - 1;
            for entry in entries {
                let part = if is_held_out {
                    &mut held_out
                } else {
                    &mut training
                };
                part.push(sequences.len());
                sequences.push(dataset.load(entry)?);
            }
        }
        Ok(Self { sequences, training, held_out, points, seed })
    }

    pub(crate) fn training_count(&self) -> usize {
        self.training.len()
    }

    pub(crate) fn held_out_count(&self) -> usize {
        self.held_out.len()
    }
}

impl CloudSource for Clouds {
    fn people(&self) -> Vec<[f32; 10]> {
        self.sequences
            .iter()
            .map(|sequence| sequence.betas)
            .collect()
    }

    fn training(&self, number: u64) -> TrainingCloud {
        let key = self.seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ (number << 1);
        let mut rng = StdRng::seed_from_u64(key);
        let person = self.training[rng.random_range(0..self.training.len())];
        let frame = rng.random_range(0..self.sequences[person].frames.len());
        self.cloud(person, frame, &mut rng)
    }

    fn held_out(&self, number: u64) -> TrainingCloud {
        // Always the same, whatever the seed.
        let mut rng = StdRng::seed_from_u64((number << 1) | 1);
        let person = self.held_out[number as usize % self.held_out.len()];
        let frame = rng.random_range(0..self.sequences[person].frames.len());
        self.cloud(person, frame, &mut rng)
    }
}

impl Clouds {
    fn cloud(&self, person: usize, frame: usize, rng: &mut StdRng) -> TrainingCloud {
        let sequence = &self.sequences[person];
        let posed = sequence.posed_mesh(frame);
        let star = sequence.star_mesh(frame);
        let kind = if rng.random_bool(0.7) {
            CloudKind::SingleView
        } else {
            CloudKind::Surface
        };
        let (places, camera) = match kind {
            CloudKind::SingleView => {
                let pelvis = sequence.rest_joints[0] + sequence.frames[frame].trans;
                let camera = random_camera(pelvis, rng);
                (
                    seen(&posed, camera, self.points, rng),
                    Some(camera.translation),
                )
            }
            CloudKind::Surface => (spread(&posed, self.points, rng), None),
        };
        let truth_posed: Vec<Vec3> = at(&places, &posed.vertices);
        let mut cloud = TrainingCloud {
            kind,
            person,
            points: truth_posed.clone(),
            normals: unit(at(&places, &posed.normals)),
            truth_posed,
            star: at(&places, &star.vertices),
            star_normals: unit(at(&places, &star.normals)),
            weights: places
                .iter()
                .map(|place| weights(sequence, place))
                .collect(),
            registered: registered(sequence.params(frame), rng),
            warp: Warp::new(
                &BodyParams { trans: sequence.frames[frame].trans, ..sequence.params(frame) },
                &sequence.rest_joints,
            ),
        };
        add_sensor_errors(&mut cloud, camera, rng);
        cloud
    }
}

/// Some metres away, anywhere around the person, looking at the pelvis from a little above or below.
fn random_camera(pelvis: Vec3, rng: &mut StdRng) -> Rigid3 {
    let (_, protocol_m) = protocol_camera();
    let distance_m = protocol_m * rng.random_range(0.75..1.1);
    let turn = Quat::from_rotation_y(rng.random_range(0.0..std::f32::consts::TAU))
        * Quat::from_rotation_x(rng.random_range(-0.45..0.2));
    Rigid3 {
        rotation: turn * Quat::from_rotation_x(std::f32::consts::PI),
        translation: pelvis + turn * Vec3::Z * distance_m,
    }
}

/// Random pixels of what the camera sees.
fn seen(posed: &TriangleMesh, camera: Rigid3, count: usize, rng: &mut StdRng) -> Vec<Place> {
    let camera_from_world = camera.inverse();
    let vertices: Vec<Vec3> = posed
        .vertices
        .iter()
        .map(|&v| camera_from_world * v)
        .collect();
    let mut rasterizer = Rasterizer::new(protocol_camera().0);
    let raster = rasterizer.draw(&vertices, &posed.triangles);
    let hits: Vec<_> = (0..raster.depth.len())
        .filter_map(|pixel| raster.hit(pixel))
        .collect();
    if hits.is_empty() {
        return spread(posed, count, rng);
    }
    let pick = |_| {
        let (triangle, barycentric) = hits[rng.random_range(0..hits.len())];
        Place { corners: posed.triangles[triangle as usize], barycentric }
    };
    (0..count).map(pick).collect()
}

/// Points all over the surface.
fn spread(posed: &TriangleMesh, count: usize, rng: &mut StdRng) -> Vec<Place> {
    let samples = sample_surface(posed, count, rng.next_u64());
    samples
        .iter()
        .map(|sample| Place {
            corners: posed.triangles[sample.triangle as usize],
            barycentric: sample.barycentric,
        })
        .collect()
}

/// What lies at the places, given what lies at the vertices.
fn at(places: &[Place], vertices: &[Vec3]) -> Vec<Vec3> {
    let mix = |Place { corners: [a, b, c], barycentric }: &Place| {
        vertices[*a as usize] * barycentric.x
            + vertices[*b as usize] * barycentric.y
            + vertices[*c as usize] * barycentric.z
    };
    places.iter().map(mix).collect()
}

fn unit(normals: Vec<Vec3>) -> Vec<Vec3> {
    normals.into_iter().map(Vec3::normalize_or_zero).collect()
}

fn weights(sequence: &Sequence, place: &Place) -> [f32; 24] {
    let mut sum = [0.0; 24];
    for (&vertex, share) in place.corners.iter().zip(place.barycentric.to_array()) {
        let of_vertex = dense(&sequence.weights[vertex as usize]);
        for (sum, weight) in sum.iter_mut().zip(of_vertex) {
            *sum += share * weight;
        }
    }
    sum
}

fn normal(rng: &mut StdRng) -> f32 {
    StandardNormal.sample(rng)
}

fn normal_vector(rng: &mut StdRng) -> Vec3 {
    Vec3::from_array(std::array::from_fn(|_| normal(rng)))
}

/// The parameters as a tracker might give them: from exact to a few degrees and millimetres off.
fn registered(mut params: BodyParams, rng: &mut StdRng) -> BodyParams {
    const ANGLE_RAD: f32 = 0.05;
    const PLACE_M: f32 = 0.01;
    // A third of the frames are registered exactly.
    let amount = rng.random_range(-0.5_f32..1.0).max(0.0);
    for joint in &mut params.theta {
        *joint += normal_vector(rng) * (ANGLE_RAD * amount);
    }
    params.trans += normal_vector(rng) * (PLACE_M * amount);
    params
}

/// Noise along the rays, normals that err, and normals that are missing.
fn add_sensor_errors(cloud: &mut TrainingCloud, camera: Option<Vec3>, rng: &mut StdRng) {
    const MOST_SIGMA_M: f32 = 0.006;
    const NORMAL_ERROR: f32 = 0.25;
    const MISSING_NORMALS: f64 = 0.05;
    let amount = rng.random_range(-0.3_f32..1.0).max(0.0);
    for index in 0..cloud.points.len() {
        let point = cloud.points[index];
        if let Some(camera) = camera {
            let ray = (point - camera).normalize_or_zero();
            cloud.points[index] += ray * (normal(rng) * amount * MOST_SIGMA_M);
            // Depth shows the side that is seen.
            if cloud.normals[index].dot(ray) > 0.0 {
                cloud.normals[index] = -cloud.normals[index];
            }
        }
        let error = normal_vector(rng) * (amount * NORMAL_ERROR);
        cloud.normals[index] = (cloud.normals[index] + error).normalize_or_zero();
        if rng.random_bool(MISSING_NORMALS) {
            cloud.normals[index] = Vec3::ZERO;
        }
    }
}
