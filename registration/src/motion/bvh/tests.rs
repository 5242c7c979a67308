//! What the reader claims: real files stand upright with their feet on the floor; broken ones are named.

use std::{
    fs,
    path::{Path, PathBuf},
};

use glam::Vec3;

use super::*;
use crate::smpl::{BoneTransforms, builtin};

const SMALL: &str = "HIERARCHY
ROOT Hips
{
  OFFSET 0 0 0
  CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
  JOINT Spine
  {
    OFFSET 0 10 0
    CHANNELS 3 Zrotation Xrotation Yrotation
    End Site
    {
      OFFSET 0 5 0
    }
  }
}
MOTION
Frames: 2
Frame Time: 0.0333
0 90 0 0 0 0 90 0 0
0 91 0 0 0 90 0 0 0
";

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

fn parse(text: &str) -> Result<BvhClip, RegistrationError> {
    parse::parse(Path::new("small.bvh"), text)
}

#[test]
fn channels_apply_in_file_order() {
    let clip = parse(SMALL).unwrap();
    let (_, end) = (0, clip.joints[1].end_site.unwrap());
    let pose = clip.global_pose(0);
    let tip = pose[1].1 + pose[1].0 * end;
    assert!(
        (tip - Vec3::new(-5.0, 100.0, 0.0)).length() < 1e-4,
        "spine turned about z: {tip}"
    );
    let pose = clip.global_pose(1);
    assert!(
        (pose[0].0 * Vec3::Z - Vec3::X).length() < 1e-5,
        "root turned about y"
    );
}

#[test]
fn broken_files_are_told_where_and_what() {
    let cases = [
        (
            SMALL.replace("HIERARCHY", "HIERACHY"),
            "line 1",
            "HIERARCHY",
        ),
        (
            SMALL.replace("OFFSET 0 10 0", "OFFSET 0 ten 0"),
            "line 8",
            "finite number",
        ),
        (
            SMALL.replace("Frames: 2", "Frames: 1000000000"),
            "line 17",
            "500000 frames",
        ),
        (
            SMALL.replace("Frames: 2", "Frames: 3"),
            "line 21",
            "the end of the file",
        ),
        (
            SMALL.replace("0 91 0 0 0 90 0 0 0", "0 91 0"),
            "line 20",
            "9 numbers",
        ),
        (
            SMALL.replace("0 91 0", "0 nan 0"),
            "line 20",
            "finite number",
        ),
        (
            SMALL.replace("Xposition", "Wposition"),
            "line 5",
            "Xposition",
        ),
        (
            SMALL.replace("Frame Time: 0.0333", "Frame Time: 0"),
            "line 18",
            "seconds",
        ),
        (
            SMALL.replace("CHANNELS 6", "CHANNELS 7"),
            "line 5",
            "at most 6",
        ),
    ];
    for (text, place, what) in cases {
        let message = parse(&text).unwrap_err().to_string();
        assert!(message.contains("small.bvh"), "{message}");
        assert!(
            message.contains(place) && message.contains(what),
            "{message}"
        );
    }
}

#[test]
fn too_many_joints_are_refused() {
    let mut text = "HIERARCHY\nROOT r\n{\nOFFSET 0 0 0\n".to_owned();
    for _ in 0..MAX_JOINTS {
        text += "JOINT j\n{\nOFFSET 0 0 0\n";
    }
    assert!(parse(&text).unwrap_err().to_string().contains("512 joints"));
}

#[test]
fn a_skeleton_without_legs_is_refused_by_the_name_of_what_is_missing() {
    let folder = std::env::temp_dir().join(format!("effigy-bvh-{}", std::process::id()));
    fs::create_dir_all(&folder).unwrap();
    let path = folder.join("legless.bvh");
    fs::write(&path, SMALL).unwrap();
    let rest = RestBody::of(&builtin::body(), &[0.0; 10]);
    let message = Motion::from_bvh(&path, &rest).unwrap_err().to_string();
    fs::remove_dir_all(&folder).unwrap();
    assert!(
        message.contains("left_hip") && message.contains("Spine"),
        "{message}"
    );
}

struct Expected {
    file: &'static str,
    /// How far somebody walks, in metres.
    travel_m: [f32; 2],
    /// Whether hands go above the chest joint, where that is clear.
    raises_hands: Option<bool>,
}

const FILES: [Expected; 5] = [
    Expected {
        file: "mocap-cmu/02_01_walk.bvh",
        travel_m: [2.0, 5.0],
        raises_hands: Some(false),
    },
    Expected {
        file: "mocap-cmu/12_01_walk.bvh",
        travel_m: [2.0, 6.0],
        raises_hands: Some(false),
    },
    Expected { file: "mocap-cmu/11_01.bvh", travel_m: [0.5, 6.0], raises_hands: None },
    Expected {
        file: "mocap-cmu/jumping_jacks.bvh",
        travel_m: [0.0, 0.6],
        raises_hands: Some(true),
    },
    Expected {
        file: "mocap-animated-drawings/wave_hello.bvh",
        travel_m: [0.0, 0.6],
        raises_hands: Some(true),
    },
];

#[test]
fn real_files_stand_upright_with_feet_on_the_floor() {
    let rest = RestBody::of(&builtin::body(), &[0.0; 10]);
    for expected in FILES {
        let Some(path) = data(expected.file) else {
            continue;
        };
        let motion = Motion::from_bvh(&path, &rest).unwrap();
        let mut hands_m = f32::MIN;
        let mut off_floor = 0;
        for pose in &motion.poses {
            let (_, joints) = BoneTransforms::from_pose(&pose.theta, &rest.joints);
            let at = |joint: usize| joints[joint] + pose.trans;
            let spine = (at(12) - at(0)).normalize_or(Vec3::ZERO);
            assert!(
                spine.y > 0.6,
                "{}: the trunk stands up: {spine}",
                expected.file
            );
            assert!(at(15).y > 0.9, "{}: the head is on top", expected.file);
            let lowest_m = rest.lowest_point_m(&pose.theta) + pose.trans.y;
            assert!(
                lowest_m > -1e-4,
                "{}: nobody sinks: {lowest_m}",
                expected.file
            );
            off_floor += usize::from(lowest_m > 0.06);
            hands_m = hands_m.max((at(20).y - at(9).y).max(at(21).y - at(9).y));
            assert_knees(expected.file, pose.theta[4], pose.theta[5]);
        }
        let airborne = off_floor as f32 / motion.poses.len() as f32;
        assert!(
            airborne < 0.35,
            "{}: off the floor {airborne} of the time",
            expected.file
        );
        let (first, last) = (
            motion.poses[0].trans,
            motion.poses[motion.poses.len() - 1].trans,
        );
        let travel_m = (last - first).with_y(0.0).length();
        let [least_m, most_m] = expected.travel_m;
        assert!(
            (least_m..most_m).contains(&travel_m),
            "{}: {travel_m} m",
            expected.file
        );
        if let Some(raises) = expected.raises_hands {
            assert_eq!(hands_m > 0.0, raises, "{}: {hands_m} m", expected.file);
        }
    }
}

fn assert_knees(file: &str, left: Vec3, right: Vec3) {
    for bend in [left, right] {
        assert!(
            bend.x > -0.35 && bend.length() < 2.6,
            "{file}: a knee at {bend}"
        );
    }
}

#[test]
fn walkers_face_where_they_go() {
    let rest = RestBody::of(&builtin::body(), &[0.0; 10]);
    for file in ["mocap-cmu/02_01_walk.bvh", "mocap-cmu/12_01_walk.bvh"] {
        let Some(path) = data(file) else {
            continue;
        };
        let motion = Motion::from_bvh(&path, &rest)
            .unwrap()
            .starting_at_origin(&rest);
        let middle = &motion.poses[motion.poses.len() / 2];
        let last = &motion.poses[motion.poses.len() - 1];
        let going = (last.trans - motion.poses[0].trans)
            .with_y(0.0)
            .normalize_or(Vec3::ZERO);
        let facing = Quat::from_scaled_axis(middle.theta[0]) * Vec3::Z;
        assert!(
            facing.dot(going) > 0.9,
            "{file}: faces {facing}, goes {going}"
        );
        assert!(going.z > 0.9, "{file}: starts facing +z, goes {going}");
    }
}
