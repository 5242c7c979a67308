//! The built-in body is what the rest of the program takes it for.

use std::collections::{BTreeSet, HashMap};

use effigy_registration::smpl::{BodyParams, JOINT_COUNT, VertexWeights, builtin, mirror};
use glam::Vec3;

#[test]
fn surface_is_closed_and_faces_outwards() {
    let body = builtin::body();
    assert!(
        (6000..=8000).contains(&body.vertex_count()),
        "{} vertices",
        body.vertex_count()
    );
    let mut edges: HashMap<(u32, u32), i32> = HashMap::new();
    for t in &body.triangles {
        for (a, b) in [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])] {
            *edges.entry((a.min(b), a.max(b))).or_default() += if a < b { 1 } else { 1000 };
        }
    }
    assert!(
        edges.values().all(|&uses| uses == 1001),
        "every edge is used once each way"
    );
    let volume_m3: f32 = body
        .triangles
        .iter()
        .map(|t| {
            let [a, b, c] = t.map(|i| body.template[i as usize]);
            a.cross(b).dot(c) / 6.0
        })
        .sum();
    assert!(
        (0.06..0.1).contains(&volume_m3),
        "an adult has about 80 litres, not {volume_m3} m3"
    );
}

#[test]
fn zero_pose_stands_upright_with_left_towards_plus_x() {
    let posed = builtin::body().pose(&BodyParams::ZERO);
    let j = posed.joints;
    assert!(j[15].y > j[12].y && j[12].y > j[0].y && j[0].y > j[4].y && j[4].y > j[7].y);
    assert!(
        j[20].x > 0.6 && j[21].x < -0.6,
        "wrists lie far out on their sides"
    );
    assert!(j[10].z > j[7].z, "toes point forward");
    assert_eq!(j.len(), JOINT_COUNT);
}

#[test]
fn weights_are_shares() {
    for row in &builtin::body().skinning {
        let sum: f32 = row.weights.iter().sum();
        assert!((sum - 1.0).abs() < 1e-5, "{row:?}");
        assert!(
            row.weights.iter().all(|w| (0.0..=1.0).contains(w)),
            "{row:?}"
        );
    }
}

#[test]
fn sides_are_mirror_images_bit_for_bit() {
    let body = builtin::body();
    let mirror = mirror::builtin_vertices();
    let flip = |v: Vec3| v * Vec3::new(-1.0, 1.0, 1.0);
    for (i, &other) in mirror.iter().enumerate() {
        let other = other as usize;
        assert_eq!(mirror[other] as usize, i);
        assert_eq!(body.template[other], flip(body.template[i]));
        for direction in &body.shape_dirs {
            assert_eq!(direction[other], flip(direction[i]));
        }
        let (here, there) = (body.skinning[i], body.skinning[other]);
        assert_eq!(here.weights, there.weights);
        let used = |row: VertexWeights| -> BTreeSet<(usize, u32)> {
            let slots = row.bones.iter().zip(row.weights).filter(|(_, w)| *w > 0.0);
            slots
                .map(|(&bone, w)| (bone as usize, w.to_bits()))
                .collect()
        };
        let mirrored = used(here)
            .into_iter()
            .map(|(b, w)| (mirror::MIRROR_JOINT[b], w))
            .collect();
        assert!(other == i || used(there) == mirrored, "vertex {i}");
    }
}

#[test]
fn mirrored_poses_give_mirrored_bodies() {
    let body = builtin::body();
    let mut params = BodyParams::ZERO;
    params.betas = [0.5, -1.0, 0.7, 0.2, -0.4, 1.1, 0.3, -0.6, 0.9, -0.2];
    for (joint, turn) in params.theta.iter_mut().enumerate() {
        *turn = Vec3::new(0.1, -0.07, 0.05) * (joint % 5) as f32;
    }
    let mut mirrored = params;
    for (joint, &other) in mirror::MIRROR_JOINT.iter().enumerate() {
        mirrored.theta[other] = params.theta[joint] * Vec3::new(1.0, -1.0, -1.0);
    }
    let (posed, reflected) = (body.pose(&params), body.pose(&mirrored));
    for (i, &other) in mirror::builtin_vertices().iter().enumerate() {
        let expected = posed.vertices[i] * Vec3::new(-1.0, 1.0, 1.0);
        let off_m = reflected.vertices[other as usize].distance(expected);
        assert!(off_m < 1e-5, "vertex {i} is {off_m} m off its mirror image");
    }
}

#[test]
fn joints_of_the_template_lie_where_they_were_placed() {
    let body = builtin::body();
    let joints = body.joints(&body.template);
    // Hip, knee, shoulder, wrist of the left side, as `builtin/joints.rs` lists them.
    for (joint, expected) in [
        (1, [0.072, -0.308, 0.020]),
        (4, [0.088, -0.700, 0.012]),
        (16, [0.178, 0.237, -0.018]),
        (20, [0.705, 0.247, -0.045]),
    ] {
        assert!(
            joints[joint].distance(Vec3::from(expected)) < 1e-5,
            "joint {joint}"
        );
    }
}

#[test]
fn identity_is_the_one_that_trained_files_carry() {
    // Whoever changes the body changes this, and retrains what was trained on it.
    assert_eq!(
        builtin::body().identity.to_string(),
        "3f175226fedd8d2effdfdc582b23d866"
    );
}

#[test]
fn one_unit_of_size_is_seven_centimetres_of_stature() {
    let body = builtin::body();
    let stature_m = |betas: &[f32; 10]| {
        let shaped = body.shaped_vertices(betas);
        let top = shaped.iter().map(|v| v.y).fold(f32::MIN, f32::max);
        top - shaped.iter().map(|v| v.y).fold(f32::MAX, f32::min)
    };
    let mut larger = [0.0; 10];
    larger[0] = 1.0;
    let grown_m = stature_m(&larger) - stature_m(&[0.0; 10]);
    // ANSUR II, men: 69 mm; a unit is rounded to whole per cents of each segment.
    assert!((0.066..0.072).contains(&grown_m), "{grown_m} m");
}
