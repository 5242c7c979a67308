//! The built-in body is what the rest of the program takes it for.

use std::collections::HashMap;

use effigy_registration::smpl::{BodyParams, JOINT_COUNT, builtin};

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
