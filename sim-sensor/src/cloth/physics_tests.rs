//! What cloth claims as a piece of matter: it falls, rests, and slides as Coulomb says.

use glam::{Quat, Vec3};

use super::{
    collider::{Collider, Obstacle},
    pattern::{ClothKind, Fabric, Pattern},
    sew::Garment,
    sheet::Sheet,
    solver::Cloth,
};

const STEP_SECS: f32 = 1.0 / 360.0;
const SKIN_M: f32 = 0.003;
const STEEP_RAD: f32 = 0.26;

/// A flat square of `side` by `side` points.
fn square(side: u32, spacing_m: f32, turn: Quat, lift_m: f32) -> Sheet {
    let middle = 0.5 * (side - 1) as f32;
    let point = |i: u32| {
        let (x, z) = ((i % side) as f32 - middle, (i / side) as f32 - middle);
        turn * Vec3::new(x * spacing_m, lift_m, z * spacing_m)
    };
    let corner = |i: u32| (i % (side - 1)) + (i / (side - 1)) * side;
    let triangles = (0..(side - 1) * (side - 1)).map(corner).flat_map(|a| {
        let (b, c, d) = (a + 1, a + side, a + side + 1);
        [[a, c, b], [b, c, d]]
    });
    Sheet { points: (0..side * side).map(point).collect(), triangles: triangles.collect() }
}

fn napkin(fabric: Fabric, turn: Quat, lift_m: f32) -> Cloth {
    let rest = square(7, 0.02, turn, lift_m);
    let pattern = Pattern { fabric, ..ClothKind::Dress.patterns(0.5, 1)[0] };
    let laid_out = rest.points.clone();
    let (points, edges) = (rest.points.len(), rest.edges().len());
    Cloth::new(
        &Garment {
            pattern,
            rest,
            laid_out,
            weights: Vec::new(),
            home: Vec::new(),
            held: Vec::new(),
            arms: vec![None; points],
            rings: Vec::new(),
        },
        &vec![1.0; edges],
    )
}

fn fabric(friction: f32, drag: f32) -> Fabric {
    Fabric { friction, drag, ..ClothKind::Dress.patterns(0.5, 1)[0].fabric }
}

fn middle(cloth: &Cloth) -> Vec3 {
    cloth.points.iter().sum::<Vec3>() / cloth.points.len() as f32
}

/// How far a napkin comes down a slope in half a second.
fn slid_m(friction: f32) -> f32 {
    let turn = Quat::from_rotation_z(STEEP_RAD);
    let slope = Collider::new(&square(9, 0.25, turn, 0.0));
    let mut cloth = napkin(fabric(friction, 0.0), turn, SKIN_M);
    cloth.forget_searches(1);
    let start = middle(&cloth);
    for _ in 0..180 {
        cloth.step(STEP_SECS, 4, &[Obstacle::body(&slope, SKIN_M)]);
    }
    (middle(&cloth) - start).dot(turn * Vec3::NEG_X)
}

#[test]
fn friction_holds_cloth_on_a_slope_or_lets_it_slide_as_coulomb_says() {
    // The slope's tangent is 0.27.
    let held_m = slid_m(0.4);
    assert!(held_m.abs() < 0.001, "{held_m} m");
    for friction in [0.0, 0.1, 0.2] {
        let acceleration = 9.81 * (STEEP_RAD.sin() - friction * STEEP_RAD.cos());
        let expected_m = 0.5 * acceleration * 0.25;
        let found_m = slid_m(friction);
        assert!(
            (found_m / expected_m - 1.0).abs() < 0.05,
            "friction {friction}: {found_m} m, expected {expected_m} m"
        );
    }
}

#[test]
fn cloth_that_falls_on_a_table_comes_to_rest_on_it_and_is_no_longer_than_it_was() {
    let table = Collider::new(&square(9, 0.25, Quat::IDENTITY, 0.0));
    let mut cloth = napkin(fabric(0.2, 2.0), Quat::IDENTITY, 0.10);
    cloth.forget_searches(1);
    for _ in 0..360 {
        cloth.step(STEP_SECS, 4, &[Obstacle::body(&table, SKIN_M)]);
    }
    for (point, velocity) in cloth.points.iter().zip(&cloth.velocities) {
        assert!((point.y - SKIN_M).abs() < 1e-4, "lies at {} m", point.y);
        assert!(
            velocity.length() < 1e-3,
            "still moves at {} m/s",
            velocity.length()
        );
    }
    let worst = cloth.strains().map(f32::abs).fold(0.0, f32::max);
    assert!(worst < 0.01, "an edge has changed by {worst}");
}

/// Where limbs run into each other cloth is inside of something at times. Out at once, as it used to be, 2 cm are 7 m/s.
#[test]
fn cloth_comes_out_of_a_surface_step_by_step_and_keeps_up_with_one_that_moves() {
    let table = square(9, 0.25, Quat::IDENTITY, 0.0);
    let mut still = Collider::new(&table);
    let mut cloth = napkin(fabric(0.2, 2.0), Quat::IDENTITY, -0.02);
    cloth.forget_searches(1);
    let mut heights_m = vec![-0.02];
    for _ in 0..12 {
        cloth.step(STEP_SECS, 4, &[Obstacle::body(&still, SKIN_M)]);
        heights_m.push(middle(&cloth).y);
    }
    let furthest_m = heights_m
        .windows(2)
        .map(|two| two[1] - two[0])
        .fold(0.0, f32::max);
    assert!(furthest_m < 0.006, "{furthest_m} m in one step");
    assert!(
        (heights_m[12] - SKIN_M).abs() < 1e-3,
        "out in 12 steps: {heights_m:?}"
    );
    let mut lift_m = 0.0;
    for _ in 0..12 {
        lift_m += 0.006;
        still.advance(table.points.iter().map(|&point| point + Vec3::Y * lift_m));
        cloth.step(STEP_SECS, 4, &[Obstacle::body(&still, SKIN_M)]);
    }
    let above_m = middle(&cloth).y - lift_m;
    assert!(
        (above_m - SKIN_M).abs() < 1e-3,
        "a table that rises fast carries it: {above_m} m"
    );
}
