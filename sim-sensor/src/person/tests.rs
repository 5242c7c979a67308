//! What clothes claim: they stay outside the body, and fold with the pose.

use effigy_registration::{motion::Routine, smpl::builtin};

use super::*;
use crate::population;

fn person(kind: OutfitKind, seed: u64) -> Person {
    Person::sample(builtin::body(), kind, seed)
}

fn poses(person: &Person) -> Vec<[Vec3; JOINT_COUNT]> {
    let rest = person.rest_body();
    let motion = Routine::Mixture.motion(&rest, 2.0, 1);
    motion.poses.iter().map(|pose| pose.theta).collect()
}

/// Root mean square over the vertices that `chosen` picks.
fn rms(offsets: &[Vec3], chosen: impl Fn(usize) -> bool) -> f32 {
    let squares: Vec<f32> = (0..offsets.len())
        .filter(|&v| chosen(v))
        .map(|v| offsets[v].length_squared())
        .collect();
    assert!(squares.len() > 100, "the region has vertices");
    (squares.iter().sum::<f32>() / squares.len() as f32).sqrt()
}

#[test]
fn clothes_stay_outside_the_body() {
    for (kind, seed) in [
        (OutfitKind::CloseFitting, 1),
        (OutfitKind::Loose, 2),
        (OutfitKind::Random, 3),
    ] {
        let person = person(kind, seed);
        for theta in poses(&person) {
            let minimal = person.mesh(person.minimal_zero_pose(&theta));
            let clothed = person.clothed_zero_pose(&theta);
            for (v, vertex) in clothed.iter().enumerate() {
                let outwards_m = (vertex - minimal.vertices[v]).dot(minimal.normals[v]);
                assert!(
                    outwards_m > -0.002,
                    "{kind:?}: vertex {v} is {outwards_m} m inside"
                );
            }
        }
    }
}

#[test]
fn loose_clothes_fold_with_the_pose_and_tight_ones_hardly() {
    let changes = |kind| {
        let person = person(kind, 4);
        let mut bent = [Vec3::ZERO; JOINT_COUNT];
        for (joint, bend) in [
            (16, Vec3::new(0.0, 0.0, -1.1)),
            (17, Vec3::new(0.0, 0.0, 1.1)),
            (18, Vec3::new(0.0, -1.6, 0.0)),
            (19, Vec3::new(0.0, 1.6, 0.0)),
            (1, Vec3::new(-1.2, 0.0, 0.0)),
            (2, Vec3::new(-1.2, 0.0, 0.0)),
            (4, Vec3::new(1.6, 0.0, 0.0)),
            (5, Vec3::new(1.6, 0.0, 0.0)),
        ] {
            bent[joint] = bend;
        }
        let offsets = |theta: &[Vec3; JOINT_COUNT]| -> Vec<Vec3> {
            let clothed = person.clothed_zero_pose(theta);
            clothed
                .iter()
                .zip(person.minimal_zero_pose(theta))
                .map(|(c, m)| c - m)
                .collect()
        };
        let straight = offsets(&[Vec3::ZERO; JOINT_COUNT]);
        let change: Vec<Vec3> = offsets(&bent)
            .iter()
            .zip(straight)
            .map(|(b, s)| b - s)
            .collect();
        let chart = Chart::new(&person.body, person.minimal.clone(), &person.rest_joints);
        let sleeves = rms(&change, |v| {
            person.tailoring.cuts[v].shirt > 0.9 && chart.places[v].arm > 0.3
        });
        let legs = rms(&change, |v| {
            person.tailoring.cuts[v].trousers > 0.9 && chart.places[v].leg > 0.1
        });
        [sleeves, legs]
    };
    let [loose, close] = [
        changes(OutfitKind::Loose),
        changes(OutfitKind::CloseFitting),
    ];
    assert!(loose[0] > 0.005, "sleeves change by {} m rms", loose[0]);
    assert!(
        loose[1] > 0.005,
        "trouser legs change by {} m rms",
        loose[1]
    );
    assert!(
        close[0] < 0.003 && close[1] < 0.003,
        "close-fitting: {close:?} m rms"
    );
    println!("pose-dependent change, m rms (sleeves, legs): loose {loose:?}, close {close:?}");
}

#[test]
fn bare_people_are_their_minimal_body() {
    let person = person(OutfitKind::Bare, 1);
    let theta = [Vec3::splat(0.1); JOINT_COUNT];
    assert_eq!(
        person.clothed_zero_pose(&theta),
        person.minimal_zero_pose(&theta)
    );
}

#[test]
fn people_are_adults_of_different_heights_and_the_same_from_the_same_seed() {
    let heights: Vec<f32> = (0..12)
        .map(|seed| person(OutfitKind::Bare, seed).height_m())
        .collect();
    for height in &heights {
        assert!((1.49..1.96).contains(height), "{heights:?}");
    }
    let spread = heights.iter().fold(0.0f32, |m, h| m.max(*h))
        - heights.iter().fold(9.0f32, |m, h| m.min(*h));
    assert!(spread > 0.08, "a population is not one size: {heights:?}");
    let theta = [Vec3::splat(0.05); JOINT_COUNT];
    let again = || person(OutfitKind::Random, 7).clothed_canonical(&theta);
    assert_eq!(again(), again());
}

#[test]
fn population_normals_belong_to_the_canonical_surface() {
    let people: Vec<_> = population::samples(builtin::body(), 3, 1, 2).collect();
    let sample = &people[0].samples[1];
    let mesh = &sample.clothed_canonical;
    let mut agree = 0;
    for triangle in &mesh.triangles {
        let [a, b, c] = triangle.map(|v| mesh.vertices[v as usize]);
        let face = (b - a).cross(c - a).normalize_or(Vec3::ZERO);
        let vertex: Vec3 = triangle.iter().map(|&v| mesh.normals[v as usize]).sum();
        agree += usize::from(face.dot(vertex) > 0.0);
    }
    assert!(
        agree as f32 > 0.98 * mesh.triangles.len() as f32,
        "{agree} of {}",
        mesh.triangles.len()
    );
    assert_eq!(sample.minimal_canonical.len(), mesh.vertices.len());
    // In star pose the ankles are far apart whatever the pose was.
    let ankles = people[0].person.body.joints(&sample.minimal_canonical);
    assert!(ankles[7].distance(ankles[8]) > 0.9, "star pose");
}

/// Over naked skin, on somebody who wears shoes and hair only.
#[test]
fn hair_stands_off_the_skull_shoes_have_soles_and_hands_stay_bare() {
    let seed = 5;
    let betas = sample_betas(&builtin::body(), seed);
    let person = Person::new(builtin::body(), betas, Outfit::UNDER, seed);
    let still = [Vec3::ZERO; JOINT_COUNT];
    let (bare, worn) = (
        person.minimal_zero_pose(&still),
        person.clothed_zero_pose(&still),
    );
    let off_m: Vec<f32> = bare
        .iter()
        .zip(&worn)
        .map(|(b, w)| b.distance(*w))
        .collect();
    let of_bone = |bones: &[u8], v: usize| bones.contains(&person.body.skinning[v].main_bone());
    let on =
        |bones: &[u8]| -> Vec<usize> { (0..bare.len()).filter(|&v| of_bone(bones, v)).collect() };
    // Hair: 14 mm, uneven by a quarter; the crown has it and the chin does not.
    let head = on(&[15]);
    let highest = |v: &&usize| (bare[**v].y * 1e6) as i64;
    let crown = *head.iter().max_by_key(highest).unwrap();
    let chin = *head.iter().min_by_key(highest).unwrap();
    assert!((0.008..0.020).contains(&off_m[crown]), "{} m", off_m[crown]);
    assert!(off_m[chin] < 1e-4, "{} m", off_m[chin]);
    // Soles: 16 mm under the foot, and flat.
    let lowest = |points: &[Vec3]| {
        let feet = on(&[7, 8, 10, 11]).into_iter();
        feet.map(|v| points[v].y).fold(f32::MAX, f32::min)
    };
    let sole_m = lowest(&bare) - lowest(&worn);
    assert!((0.012..0.020).contains(&sole_m), "{sole_m} m");
    // Hands and forearms: skin.
    for v in on(&[18, 19, 20, 21, 22, 23]) {
        assert!(off_m[v] < 1e-6, "vertex {v} is {} m off the skin", off_m[v]);
    }
    assert!(on(&[20, 21, 22, 23]).len() > 200, "hands have fingers");
}
