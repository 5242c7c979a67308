//! Bent limbs keep their thickness.
#![expect(clippy::print_stdout, reason = "says what it measured")]

use effigy_registration::smpl::{BodyModel, BodyParams, PoseDirection, builtin};
use glam::{Mat3, Quat, Vec3};

/// Least share of the rest thickness or section that a turned limb keeps.
const KEPT: f32 = 0.8;

#[test]
fn bent_elbows_keep_four_fifths_of_their_thickness() {
    bent_limb_keeps_its_thickness(18, Vec3::NEG_Y, Vec3::NEG_Z);
    bent_limb_keeps_its_thickness(19, Vec3::Y, Vec3::NEG_Z);
}

#[test]
fn bent_knees_keep_four_fifths_of_their_thickness() {
    bent_limb_keeps_its_thickness(4, Vec3::X, Vec3::Z);
    bent_limb_keeps_its_thickness(5, Vec3::X, Vec3::Z);
}

#[test]
fn twisted_wrists_keep_four_fifths_of_their_section() {
    let body = builtin::body();
    let rest = section_area(&body, &BodyParams::ZERO, 20, Vec3::X);
    let twisted = turned(20, Vec3::X * 90_f32.to_radians());
    let kept = section_area(&body, &twisted, 20, Vec3::X) / rest;
    let plain = section_area(&without_correctives(&body), &twisted, 20, Vec3::X) / rest;
    println!("wrist, 90 degrees of twist: {kept:.2} of rest, {plain:.2} without correctives");
    assert!(kept > KEPT);
}

#[test]
fn correctives_turn_no_more_faces_over_than_a_crease_needs() {
    let body = builtin::body();
    let plain = without_correctives(&body);
    for (joint, axis) in [
        (18, Vec3::NEG_Y),
        (4, Vec3::X),
        (16, Vec3::NEG_Z),
        (1, Vec3::NEG_X),
    ] {
        let params = turned(joint, axis * 90_f32.to_radians());
        let (over, before) = (turned_over(&body, &params), turned_over(&plain, &params));
        println!("joint {joint}: {over} faces turned over, {before} without correctives");
        // The inner crease of a right-angled bend folds some faces in any case: three in a thousand.
        assert!(
            over <= body.triangles.len() * 3 / 1000,
            "joint {joint}: {over} faces"
        );
    }
}

/// Faces that look the other way than their bones carry them.
fn turned_over(body: &BodyModel, params: &BodyParams) -> usize {
    let posed = body.pose(params);
    let turned = |t: &&[u32; 3]| {
        let normal = |v: &[Vec3]| {
            let [a, b, c] = t.map(|i| v[i as usize]);
            (b - a).cross(c - a).normalize_or_zero()
        };
        let bone = posed.bones.blend(&body.skinning[t[0] as usize]).matrix3;
        let expected = (Mat3::from(bone) * normal(&body.template)).normalize_or_zero();
        normal(&posed.vertices).dot(expected) < -0.2
    };
    body.triangles.iter().filter(turned).count()
}

/// The thickness is taken from the joint to the skin on the outer side, where nothing presses on it.
fn bent_limb_keeps_its_thickness(joint: usize, axis: Vec3, outer: Vec3) {
    let body = builtin::body();
    let plain = without_correctives(&body);
    let rest = reach(&body, &BodyParams::ZERO, joint, outer);
    for degrees in [60_f32, 90.0, 120.0] {
        let params = turned(joint, axis * degrees.to_radians());
        let least = |body: &BodyModel| {
            [0.3, 0.4, 0.5, 0.6, 0.7]
                .map(|part| {
                    let along = Quat::from_axis_angle(axis, degrees.to_radians() * part) * outer;
                    reach(body, &params, joint, along) / rest
                })
                .into_iter()
                .fold(f32::MAX, f32::min)
        };
        let (kept, before) = (least(&body), least(&plain));
        println!("joint {joint} at {degrees}: {kept:.2} of rest, {before:.2} without correctives");
        assert!(
            kept > KEPT,
            "joint {joint} keeps {kept:.2} at {degrees} degrees"
        );
        assert!(
            kept < 1.3,
            "joint {joint} swells to {kept:.2} at {degrees} degrees"
        );
        assert!(kept > before, "correctives must help");
    }
}

/// How far the skin is from the joint in this direction.
fn reach(body: &BodyModel, params: &BodyParams, joint: usize, direction: Vec3) -> f32 {
    let posed = body.pose(params);
    let from = posed.joints[joint];
    let mut nearest = f32::MAX;
    for t in &body.triangles {
        let [a, b, c] = t.map(|i| posed.vertices[i as usize] - from);
        let normal = (b - a).cross(c - a);
        let facing = normal.dot(direction);
        if facing <= 0.0 {
            continue;
        }
        let distance = normal.dot(a) / facing;
        let hit = direction * distance;
        let inside = [(a, b), (b, c), (c, a)]
            .iter()
            .all(|(p, q)| (*q - *p).cross(hit - *p).dot(normal) >= -1e-12);
        if inside && distance > 0.0 {
            nearest = nearest.min(distance);
        }
    }
    nearest
}

fn without_correctives(body: &BodyModel) -> BodyModel {
    BodyModel { pose_dirs: vec![PoseDirection::default(); 207], ..body.clone() }
}

fn turned(joint: usize, turn: Vec3) -> BodyParams {
    let mut params = BodyParams::ZERO;
    params.theta[joint] = turn;
    params
}

/// The area where a plane through the joint cuts the limb; only faces near the joint count.
fn section_area(body: &BodyModel, params: &BodyParams, joint: usize, normal: Vec3) -> f32 {
    let posed = body.pose(params);
    let centre = posed.joints[joint];
    let mut doubled = 0.0;
    for t in &body.triangles {
        let corners = t.map(|i| posed.vertices[i as usize] - centre);
        if corners.iter().any(|c| c.length() > 0.13) {
            continue;
        }
        let cuts: Vec<Vec3> = (0..3)
            .filter_map(|i| {
                let (a, b) = (corners[i], corners[(i + 1) % 3]);
                let (da, db) = (a.dot(normal), b.dot(normal));
                ((da < 0.0) != (db < 0.0)).then(|| a.lerp(b, da / (da - db)))
            })
            .collect();
        if let [a, b] = cuts[..] {
            let outward = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
            let signed = a.cross(b).dot(normal);
            let along = normal.cross(b - a).dot(outward);
            // The cut's two ends come in either order: walk with the outside on the same hand.
            doubled += if along > 0.0 { -signed } else { signed };
        }
    }
    (0.5 * doubled).abs()
}
