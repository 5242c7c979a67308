//! What strangers claim: they stand as our people stand, the sensor sees their surface, and files that hold nobody
//! are told so.

use std::{
    fs,
    path::{Path, PathBuf},
};

use effigy_capture::FrameSource as _;
use effigy_fusion::mesh::closest_point::ClosestPoint;
use effigy_registration::{
    motion::Routine,
    smpl::{JOINT_COUNT, builtin},
};
use glam::vec2;

use super::*;
use crate::{MotionChoice, Noise, Room, SimulatedSensor, Truth};

const FILES: [&str; 7] = [
    "rocketbox/glb/Male_Adult_01.glb",
    "rocketbox/glb/Male_Adult_08.glb",
    "rocketbox/glb/Female_Adult_01.glb",
    "rocketbox/glb/Female_Adult_05.glb",
    "quaternius-animated/Smooth_Male_Casual.glb",
    "quaternius-animated/Smooth_Female_Casual.glb",
    "cesium-man/CesiumMan.glb",
];

fn data(relative: &str) -> Option<PathBuf> {
    let root = std::env::var_os("EFFIGY_DATA").map_or_else(
        || Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data"),
        PathBuf::from,
    );
    let path = root.join(relative);
    if path.exists() {
        return Some(path);
    }
    println!("skipped: {} is missing", path.display());
    None
}

fn choice(path: PathBuf, clip: Option<&str>) -> StrangerChoice {
    StrangerChoice { path, clip: clip.map(str::to_owned), height_m: None }
}

fn scenario(choice: StrangerChoice) -> Scenario {
    Scenario {
        stranger: Some(choice),
        motion: MotionChoice::Routine(Routine::Mixture),
        noise: Noise::None,
        room: Room::Empty,
        ..Scenario::default()
    }
}

#[test]
fn characters_of_four_makers_stand_in_smpls_zero_pose() {
    for file in FILES {
        let Some(path) = data(file) else { continue };
        let character = Character::read(&path, None).unwrap();
        let at = |joint: usize| character.joints[joint];
        let ys = character.zero_pose.iter().map(|v| v.y);
        let (low, high) = (
            ys.clone().fold(f32::MAX, f32::min),
            ys.fold(f32::MIN, f32::max),
        );
        assert!(
            (1.4..2.0).contains(&(high - low)),
            "{file}: {} m tall",
            high - low
        );
        for (side, sign) in [(0, 1.0), (1, -1.0)] {
            let arm = (at(20 + side) - at(16 + side)) * sign;
            assert!(arm.x > 0.35, "{file}: arms are out sideways: {arm}");
            assert!(arm.y.abs() < 0.2 * arm.x, "{file}: arms are level: {arm}");
            let leg = at(7 + side) - at(1 + side);
            assert!(
                leg.y < -0.33 * (high - low) && leg.y < -4.0 * leg.x.abs(),
                "{file}: legs hang: {leg}"
            );
        }
        assert!(
            (at(15).y - low) > 0.75 * (high - low),
            "{file}: the head is on top"
        );
        for weights in &character.weights {
            let sum: f32 = weights.weights.iter().sum();
            assert!((sum - 1.0).abs() < 1e-3, "{file}: weights sum to {sum}");
        }
    }
}

#[test]
fn the_sensor_sees_the_strangers_surface_on_the_floor() {
    let cases = [
        (
            "quaternius-animated/Smooth_Male_Casual.glb",
            Some("Man_Walk"),
        ),
        ("quaternius-animated/Smooth_Female_Casual.glb", None),
        ("rocketbox/glb/Female_Adult_01.glb", None),
        ("cesium-man/CesiumMan.glb", Some("clip 0")),
    ];
    for (file, clip) in cases {
        let Some(path) = data(file) else { continue };
        let scenario = scenario(choice(path, clip));
        let mut sensor = SimulatedSensor::new(&scenario, builtin::body()).unwrap();
        let truth = StrangerTruth::new(&scenario).unwrap();
        let camera = sensor.calibration().depth.intrinsics;
        for id in [FrameId(12), FrameId(40)] {
            let ground = truth.at(id);
            let lowest_m = ground
                .surface_in_world
                .vertices
                .iter()
                .map(|v| v.y)
                .fold(f32::MAX, f32::min);
            // A clip's floor is its lowest moment; feet may be in the air now.
            assert!(
                (-0.02..0.10).contains(&lowest_m),
                "{file}: lowest at {lowest_m} m"
            );
            let surface = ClosestPoint::from_mesh(&ground.surface_in_world).unwrap();
            let frame = sensor.expose(id).unwrap();
            let mut seen = 0;
            for (pixel, &raw) in frame.depth.pixels().iter().enumerate().step_by(11) {
                if raw == 0 {
                    continue;
                }
                let at = vec2(
                    (pixel as u32 % camera.width) as f32,
                    (pixel as u32 / camera.width) as f32,
                );
                let point = ground.world_from_camera * camera.unproject(at, f32::from(raw) * 0.001);
                let distance_m = surface.query(point).distance;
                assert!(
                    distance_m < 0.001,
                    "{file}: half a millimetre of rounding, not {distance_m} m"
                );
                seen += 1;
            }
            assert!(
                seen > 800,
                "{file}: a person fills {seen} of every eleventh pixel"
            );
        }
    }
}

#[test]
fn bones_keep_their_length_and_routines_keep_feet_on_the_floor() {
    for (file, clip) in [
        (
            "quaternius-animated/Smooth_Male_Casual.glb",
            Some("Man_Punch"),
        ),
        ("cesium-man/CesiumMan.glb", Some("clip 0")),
        ("rocketbox/glb/Male_Adult_08.glb", None),
    ] {
        let Some(path) = data(file) else { continue };
        let truth = StrangerTruth::new(&scenario(choice(path, clip))).unwrap();
        let of = |id: u64| truth.at(FrameId(id));
        // Thigh and forearm.
        let lengths = |id: u64| {
            let limbs = of(id).limbs;
            [(0, 2), (8, 10)]
                .map(|(a, b): (usize, usize)| limbs[a].position.distance(limbs[b].position))
        };
        let first = lengths(0);
        for id in [7, 19, 33] {
            for (now, then) in lengths(id).into_iter().zip(first) {
                assert!((now - then).abs() < 0.01, "{file}: {now} m, was {then} m");
            }
            if clip.is_none() {
                let vertices = of(id).surface_in_world.vertices;
                let lowest_m = vertices.iter().map(|v| v.y).fold(f32::MAX, f32::min);
                assert!(
                    lowest_m.abs() < 0.01,
                    "{file}: on the floor, not at {lowest_m} m"
                );
            }
        }
    }
}

#[test]
fn any_motion_file_moves_a_stranger() {
    let (Some(path), Some(walk)) = (data(FILES[0]), data("mocap-cmu/02_01_walk.bvh")) else {
        return;
    };
    let scenario = Scenario { motion: MotionChoice::File(walk), ..scenario(choice(path, None)) };
    let truth = StrangerTruth::new(&scenario).unwrap();
    let ankles =
        |id: u64| truth.at(FrameId(id)).limbs[4].position - truth.at(FrameId(id)).limbs[5].position;
    let strides = (0..60).step_by(4).map(|id| ankles(id).z);
    let (back, front) = (
        strides.clone().fold(f32::MAX, f32::min),
        strides.fold(f32::MIN, f32::max),
    );
    assert!(
        back < -0.2 && front > 0.2,
        "left and right step in turn: {back} to {front} m"
    );
}

#[test]
fn a_constant_offset_is_no_error_and_a_changing_one_is() {
    let frames = |wobble_m: f32| -> Vec<_> {
        (0..20)
            .map(|f| {
                let rotation = Quat::from_rotation_y(0.3 * f as f32);
                let position = Vec3::new(0.0, 1.0, 0.1 * f as f32);
                let limb = LimbJoint { position, rotation };
                let sign = if f % 2 == 0 { 1.0 } else { -1.0 };
                let off = rotation * Vec3::new(0.02, 0.0, 0.01) + Vec3::Y * wobble_m * sign;
                ([position + off; JOINT_COUNT], [limb; LIMB_JOINTS.len()])
            })
            .collect()
    };
    for error_m in limb_errors_m(&frames(0.0)).into_iter().flatten() {
        assert!(error_m < 1e-5, "{error_m} m");
    }
    for error_m in limb_errors_m(&frames(0.03)).into_iter().flatten() {
        assert!((error_m - 0.03).abs() < 1e-4, "{error_m} m");
    }
}

#[test]
fn body_truth_is_refused_for_a_stranger_and_the_other_way_round() {
    let choice = choice(PathBuf::from("nobody.glb"), None);
    let error = Truth::new(&scenario(choice), builtin::body())
        .unwrap_err()
        .to_string();
    assert!(error.contains("StrangerTruth"), "{error}");
    let error = StrangerTruth::new(&Scenario::default())
        .unwrap_err()
        .to_string();
    assert!(error.contains("Truth"), "{error}");
}

fn written(name: &str, bytes: &[u8]) -> PathBuf {
    let folder = std::env::temp_dir().join(format!("effigy-stranger-{}", std::process::id()));
    fs::create_dir_all(&folder).unwrap();
    let path = folder.join(name);
    fs::write(&path, bytes).unwrap();
    path
}

/// A triangle on three bones of these names.
fn small(skin: &str, names: [&str; 3]) -> String {
    let [a, b, c] = names;
    format!(
        r#"{{"asset":{{"version":"2.0"}},"scenes":[{{"nodes":[0]}}],
        "nodes":[{{"name":"{a}","children":[1,2]}},{{"name":"{b}"}},{{"name":"{c}"}},{{"mesh":0{skin}}}],
        "skins":[{{"joints":[0,1,2]}}],
        "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0,"JOINTS_0":1,"WEIGHTS_0":2}}}}]}}],
        "accessors":[{{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3","min":[0,0,0],"max":[0,0,0]}},
        {{"bufferView":1,"componentType":5121,"count":3,"type":"VEC4"}},
        {{"bufferView":0,"componentType":5126,"count":2,"type":"VEC4"}}],
        "bufferViews":[{{"buffer":0,"byteLength":36}},{{"buffer":0,"byteOffset":36,"byteLength":12}}],
        "buffers":[{{"byteLength":48,"uri":"small.bin"}}]}}"#
    )
}

#[test]
fn files_that_hold_nobody_are_told_what_is_missing() {
    let corners: [f32; 9] = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0];
    let bytes: Vec<u8> = corners
        .iter()
        .flat_map(|x| x.to_le_bytes())
        .chain([0; 12])
        .collect();
    written("small.bin", &bytes);
    let mut cut = b"glTF".to_vec();
    cut.extend([
        2, 0, 0, 0, 255, 0, 0, 0, 200, 0, 0, 0, b'J', b'S', b'O', b'N', b'{',
    ]);
    let cases: [(PathBuf, &str); 7] = [
        (
            written("no_skin.gltf", small("", ["a", "b", "c"]).as_bytes()),
            "a mesh with a skin, a character whose bones move it; export it together with its armature",
        ),
        (
            written(
                "weights.gltf",
                small(r#","skin":0"#, ["a", "b", "c"]).as_bytes(),
            ),
            "as many joints and weights",
        ),
        (
            written(
                "boneless.gltf",
                small(r#","skin":0"#, ["a", "b", "c"])
                    .replace(r#""joints":[0,1,2]"#, r#""joints":[]"#)
                    .as_bytes(),
            ),
            "joints, and a bind matrix for each",
        ),
        (
            written(
                "legless.gltf",
                small(r#","skin":0"#, ["Hips", "Spine", "Head"])
                    .replace(r#""count":2"#, r#""count":3"#)
                    .replace(r#""WEIGHTS_0":2"#, r#""WEIGHTS_0":1"#)
                    .as_bytes(),
            ),
            "left_hip",
        ),
        (
            written(
                "long.gltf",
                small(r#","skin":0"#, ["a", "b", "c"])
                    .replace(
                        r#""count":3,"type":"VEC3""#,
                        r#""count":1000000000,"type":"VEC3""#,
                    )
                    .as_bytes(),
            ),
            "inside its buffer",
        ),
        (written("cut.glb", &cut), "binary glTF"),
        (written("text.glb", b"hello"), "glTF 2 file"),
    ];
    for (path, what) in cases {
        let message = Character::read(&path, None).unwrap_err().to_string();
        assert!(message.contains(what), "{}: {message}", path.display());
    }
    let missing = Character::read(Path::new("nowhere.glb"), None)
        .unwrap_err()
        .to_string();
    assert!(missing.contains("nowhere.glb"), "{missing}");
}

#[test]
fn unknown_clips_are_answered_with_the_known_ones() {
    let Some(path) = data("quaternius-animated/Smooth_Male_Casual.glb") else {
        return;
    };
    let error = StrangerTruth::new(&scenario(choice(path, Some("Fly"))))
        .unwrap_err()
        .to_string();
    assert!(
        error.contains("\"Fly\"") && error.contains("Man_Walk"),
        "{error}"
    );
}

/// Neither a cut nor a flipped byte makes the reader panic; what it still reads, it can move.
#[test]
fn damaged_files_are_refused_or_read_but_never_panic() {
    let Some(path) = data("cesium-man/CesiumMan.glb") else {
        return;
    };
    let whole = fs::read(path).unwrap();
    let random = crate::random::Randomness::new(9, 0, 0);
    let mut refused = 0;
    for damage in 0..96 {
        let mut bytes = whole.clone();
        let at =
            |n: u64, most: usize| (random.uniform(damage * 8 + n) * most as f32) as usize % most;
        if damage % 4 == 0 {
            bytes.truncate(at(0, whole.len()));
        } else {
            // Two of three in the JSON, where damage does most.
            let most = if damage % 4 == 3 { whole.len() } else { 12_000 };
            for n in 0..3 {
                bytes[at(2 * n, most)] = at(2 * n + 1, 256) as u8;
            }
        }
        let damaged = written("damaged.glb", &bytes);
        match Character::read(&damaged, None) {
            Ok(character) => {
                let mesh = character.posed(&[Vec3::ZERO; JOINT_COUNT], Vec3::ZERO);
                assert!(mesh.indices_are_valid(), "damage {damage}");
                for clip in &character.clips {
                    assert!(character.at(clip, 0.4 * clip.secs).0.indices_are_valid());
                }
            }
            Err(error) => {
                refused += 1;
                assert!(error.to_string().contains("damaged.glb"), "{error}");
            }
        }
    }
    assert!(refused > 36, "most damage is noticed: {refused} of 96");
}
