//! Rendered people come back to where they were before they were posed.

use effigy_fusion::mesh::{
    closest_point::ClosestPoint, normals::vertex_normals, sample::sample_surface,
};

use super::*;
use crate::testing::{CAMERA, Suit, everyday_poses, standing};

fn canonicaliser(suit: &Suit) -> Canonicaliser {
    Canonicaliser::new(
        Arc::clone(&suit.model),
        &suit.subject.betas,
        CanonicaliseConfig::default(),
    )
    .unwrap()
    .with_camera(&CameraModel::from(CAMERA))
}

/// Distances in metres, sorted, signed by the truth surface.
fn signed_m(suit: &Suit, samples: &CanonicalSamples, points: &[Vec3]) -> Vec<f32> {
    let truth = ClosestPoint::from_mesh(&suit.in_canonical(&samples.theta)).unwrap();
    let mut distances: Vec<f32> = points
        .iter()
        .map(|&point| truth.signed_distance(suit.subject.unit_box.canonical_from_unit(point)))
        .collect();
    distances.sort_by(f32::total_cmp);
    distances
}

/// Distances of a person's surface points from the truth in metres, sorted.
fn errors_m(suit: &Suit, samples: &CanonicalSamples) -> Vec<f32> {
    let mut errors = signed_m(suit, samples, &samples.points_in_unit);
    for error in &mut errors {
        *error = error.abs();
    }
    errors.sort_by(f32::total_cmp);
    errors
}

#[test]
fn surface_points_land_on_the_canonical_surface_within_millimetres() {
    let suit = Suit::new(0.01);
    for (number, params) in everyday_poses().iter().enumerate() {
        let frame = suit.frame(params, number as u64);
        let (samples, counts) = canonicaliser(&suit).process(&frame).unwrap();
        let errors = errors_m(&suit, &samples);
        let mean = errors.iter().sum::<f32>() / errors.len() as f32;
        let p95 = errors[errors.len() * 95 / 100];
        println!(
            "pose {number}: {counts:?}, mean {:.2} mm, p95 {:.2} mm",
            mean * 1e3,
            p95 * 1e3
        );
        assert!(counts.kept > 3000);
        assert!(mean < 0.002, "mean {mean}");
        assert!(p95 < 0.006, "p95 {p95}");
    }
}

#[test]
fn normals_turn_with_the_legs() {
    let suit = Suit::new(0.01);
    let frame = suit.frame(&everyday_poses()[0], 0);
    let (samples, _) = canonicaliser(&suit).process(&frame).unwrap();
    let truth = suit.in_canonical(&samples.theta);
    let closest = ClosestPoint::from_mesh(&truth).unwrap();
    let truth_normals = vertex_normals(&truth.vertices, &truth.triangles);
    let mut agreeing = 0;
    for (point, normal) in samples.points_in_unit.iter().zip(&samples.normals) {
        let hit = closest.query(suit.subject.unit_box.canonical_from_unit(*point));
        let corners = truth.triangles[hit.triangle as usize];
        let expected: Vec3 = (0..3)
            .map(|corner| truth_normals[corners[corner] as usize] * hit.barycentric[corner])
            .sum();
        agreeing += usize::from(expected.normalize_or_zero().dot(*normal) > 0.97);
    }
    println!(
        "{agreeing} of {} normals agree",
        samples.points_in_unit.len()
    );
    // The rest lie where the suit folds in joints.
    assert!(agreeing as f32 > 0.95 * samples.points_in_unit.len() as f32);
}

#[test]
fn free_points_lie_outside_in_canonical_space_too() {
    let suit = Suit::new(0.01);
    for (number, params) in everyday_poses().iter().enumerate() {
        let frame = suit.frame(params, number as u64);
        let (samples, counts) = canonicaliser(&suit).process(&frame).unwrap();
        let distances = signed_m(&suit, &samples, &samples.free_in_unit);
        let inside = distances
            .iter()
            .filter(|&&distance| distance < -0.002)
            .count();
        println!(
            "pose {number}: {} free, {inside} inside, worst {:?}",
            counts.free,
            distances.first()
        );
        assert!(counts.free > 1000);
        assert!(
            inside * 100 <= distances.len(),
            "{inside} of {}",
            distances.len()
        );
    }
}

/// What is known of a surface lands where what is seen of it does.
#[test]
fn a_known_surface_lands_on_the_canonical_one_and_belongs_to_the_same_person() {
    let suit = Suit::new(0.01);
    let params = everyday_poses()[0];
    let surface = sample_surface(&suit.in_world(&params), 3000, 1);
    let canonicaliser = canonicaliser(&suit);
    let (samples, counts) = canonicaliser.process_surface(&params, &surface);
    let errors = errors_m(&suit, &samples);
    let p95 = errors[errors.len() * 95 / 100];
    println!("{counts:?}, p95 {p95} m");
    assert!(counts.kept > 2700 && counts.observed == 3000, "{counts:?}");
    assert!(p95 < 0.006, "p95 {p95}");
    let (seen, _) = canonicaliser.process(&suit.frame(&params, 0)).unwrap();
    assert_eq!((seen.theta, seen.pose), (samples.theta, samples.pose));
    assert!(samples.weights.iter().all(|&weight| weight == 1.0));
}

/// The arm hangs 2 cm beside the torso: its points must stay the arm's.
#[test]
fn a_hanging_arm_keeps_its_own_points() {
    let suit = Suit::new(0.01);
    let v = Vec3::new;
    let frame = suit.frame(
        &standing(&[(16, v(0.0, 0.0, -1.35)), (17, v(0.0, 0.0, 1.35))]),
        5,
    );
    let (samples, _) = canonicaliser(&suit).process(&frame).unwrap();
    let errors = signed_m(&suit, &samples, &samples.points_in_unit);
    let wild = errors.iter().filter(|error| error.abs() > 0.015).count();
    println!("{wild} of {} wild", errors.len());
    assert!(wild * 50 < errors.len(), "{wild} of {}", errors.len());
}

#[test]
fn points_far_from_the_body_are_dropped_and_lost_frames_give_nothing() {
    let suit = Suit::new(0.01);
    let mut params = everyday_poses()[0];
    let mut frame = suit.frame(&params, 0);
    // Tracking says half a metre to the side.
    params.trans.x += 0.5;
    if let effigy_registration::Tracking::Tracked { params: tracked, .. } = &mut frame.tracking {
        *tracked = params;
    }
    let (_, counts) = canonicaliser(&suit).process(&frame).unwrap();
    assert!(counts.far_from_body > counts.kept);
    frame.tracking = effigy_registration::Tracking::Lost { since: effigy_capture::Timestamp(0) };
    assert!(canonicaliser(&suit).process(&frame).is_none());
}

#[test]
fn the_same_frame_gives_the_same_samples() {
    let suit = Suit::new(0.01);
    let frame = suit.frame(&everyday_poses()[1], 3);
    let (a, _) = canonicaliser(&suit).process(&frame).unwrap();
    let (b, _) = canonicaliser(&suit).process(&frame).unwrap();
    assert_eq!(a.points_in_unit, b.points_in_unit);
    assert_eq!(a.free_in_unit, b.free_in_unit);
}
