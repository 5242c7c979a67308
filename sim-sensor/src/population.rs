//! Many people in many poses, for learning what clothed people look like.

use std::sync::Arc;

use effigy_fusion::mesh::TriangleMesh;
use effigy_registration::{
    BodyModel,
    motion::{MotionPose, Routine},
    smpl::JOINT_COUNT,
};
use glam::{Quat, Vec3};

use crate::{
    person::{OutfitKind, Person},
    random::Randomness,
};

/// One person of the population, and poses of theirs.
#[derive(Clone, Debug)]
pub struct PersonSamples {
    pub person: Person,
    pub samples: Vec<PopulationSample>,
}

/// One pose of one person, in canonical (star-pose) space; vertices of both surfaces correspond.
#[derive(Clone, Debug)]
pub struct PopulationSample {
    pub betas: [f32; 10],
    pub theta: [Vec3; JOINT_COUNT],
    /// Zero-pose joints of the minimal body.
    pub rest_joints: [Vec3; JOINT_COUNT],
    /// The outer surface of this pose, with the normals of this very surface.
    pub clothed_canonical: TriangleMesh,
    /// The minimal body of this pose, correctives included.
    pub minimal_canonical: Vec<Vec3>,
}

/// People one after the other; `n_poses` each. Lazy, so that memory holds one person at a time.
pub fn samples(
    body: Arc<BodyModel>,
    seed: u64,
    n_people: usize,
    n_poses: usize,
) -> impl Iterator<Item = PersonSamples> {
    (0..n_people).map(move |number| person(body.clone(), seed, number, n_poses))
}

/// One person by number: the same whoever asks, and in whatever order.
pub fn person(body: Arc<BodyModel>, seed: u64, number: usize, n_poses: usize) -> PersonSamples {
    let person_seed = seed.wrapping_mul(1_000_003).wrapping_add(number as u64);
    let person = Person::sample(body, OutfitKind::Random, person_seed);
    let samples = poses(&person, person_seed, n_poses)
        .into_iter()
        .map(|pose| sample(&person, &pose.theta))
        .collect();
    PersonSamples { person, samples }
}

/// Poses for learning: moments of every routine, with joints perturbed.
pub fn poses(person: &Person, seed: u64, n_poses: usize) -> Vec<MotionPose> {
    const RATE_HZ: f32 = 10.0;
    let random = Randomness::new(seed, 0, 0x90);
    let rest = person.rest_body();
    let routines = [
        Routine::Mixture,
        Routine::WalkInPlace,
        Routine::RaiseArms,
        Routine::Squat,
        Routine::Wave,
    ];
    let motions = routines.map(|routine| routine.motion(&rest, RATE_HZ, seed));
    (0..n_poses)
        .map(|i| {
            let motion = &motions[i % motions.len()];
            let secs = random.uniform(i as u64) * motion.duration_secs();
            let mut pose = motion.at(secs).expect("routines have poses");
            perturb(&mut pose, random, i as u64);
            pose
        })
        .collect()
}

fn sample(person: &Person, theta: &[Vec3; JOINT_COUNT]) -> PopulationSample {
    PopulationSample {
        betas: person.betas,
        theta: *theta,
        rest_joints: person.rest_joints,
        clothed_canonical: person.mesh(person.clothed_canonical(theta)),
        minimal_canonical: person.minimal_canonical(theta),
    }
}

/// Bends every joint a little; arms, spine and hips more than others.
fn perturb(pose: &mut MotionPose, random: Randomness, number: u64) {
    for (joint, theta) in pose.theta.iter_mut().enumerate() {
        let sigma_rad = match joint {
            0 | 7 | 8 | 10 | 11 | 22 | 23 => 0.0,
            3 | 6 | 9 | 12 | 15 | 13 | 14 => 0.08,
            1 | 2 => 0.12,
            16 | 17 => 0.25,
            18 | 19 => 0.20,
            _ => 0.10,
        };
        let at = (number + 1) * 1024 + joint as u64 * 4;
        let extra = Vec3::new(
            random.gaussian(at),
            random.gaussian(at + 1),
            random.gaussian(at + 2),
        );
        let bent = match joint {
            // Knees and elbows are hinges; they bend one way.
            4 | 5 => Quat::from_rotation_x(0.12 * extra.x.abs()) * Quat::from_scaled_axis(*theta),
            18 => Quat::from_rotation_y(-0.3 * extra.y.abs()) * Quat::from_scaled_axis(*theta),
            19 => Quat::from_rotation_y(0.3 * extra.y.abs()) * Quat::from_scaled_axis(*theta),
            _ => Quat::from_scaled_axis(*theta) * Quat::from_scaled_axis(extra * sigma_rad),
        };
        *theta = bent.to_scaled_axis();
    }
}
