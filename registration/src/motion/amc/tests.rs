//! What the reader claims: bones turn about their own axes, the two files of one action agree, broken files are named.

use std::path::{Path, PathBuf};

use super::*;
use crate::{
    motion::{MotionPose, retarget::Clip as _},
    smpl::{JOINT_NAMES, PARENTS, builtin},
};

const ASF: &str = ":units
  length 0.45
  angle deg
:root
   order TX TY TZ RX RY RZ
   axis XYZ
   position 0 0 0
   orientation 0 0 0
:bonedata
  begin
     id 1
     name upper
     direction 0 1 0
     length 2
     axis 0 0 90 XYZ
     dof rx
  end
  begin
     id 2
     name lower
     direction 0 1 0
     length 1
     axis 0 0 0 XYZ
     dof rz
  end
:hierarchy
  begin
    root upper
    upper lower
  end
";
const AMC: &str = ":FULLY-SPECIFIED
:DEGREES
1
root 1 2 3 0 0 0
upper 90
lower 0
";

fn parsed(asf: &str, amc: &str) -> Result<AmcClip, RegistrationError> {
    let skeleton = skeleton::parse(Path::new("small.asf"), asf)?;
    let frames = frames::parse(Path::new("small.amc"), amc, &skeleton)?;
    Ok(AmcClip { skeleton, frames })
}

#[test]
fn bones_turn_about_their_own_axes() {
    let clip = parsed(ASF, AMC).unwrap();
    let pose = clip.global_pose(0);
    assert_eq!(
        pose[1].1,
        Vec3::new(1.0, 2.0, 3.0),
        "the first bone starts at the root"
    );
    // A quarter turn about the bone's own x, which lies along the skeleton's y: y stays where it is.
    let end = pose[2].1;
    assert!(
        (end - Vec3::new(1.0, 4.0, 3.0)).length() < 1e-5,
        "turned about itself: {end}"
    );
    let z = pose[1].0 * Vec3::Z;
    assert!((z - Vec3::X).length() < 1e-5, "z goes to x about y: {z}");
}

#[test]
fn broken_files_are_told_where_and_what() {
    let cases = [
        (
            ASF.replace("dof rz", "dof rw"),
            AMC.to_owned(),
            "small.asf, line 24",
            "rx",
        ),
        (
            ASF.replace("length 1", "length long"),
            AMC.to_owned(),
            "small.asf, line 22",
            "length",
        ),
        (
            ASF.replace("upper lower", "upper loser"),
            AMC.to_owned(),
            "small.asf, line 29",
            "loser",
        ),
        (
            ASF.replace("root upper\n", "\n"),
            AMC.to_owned(),
            "small.asf: expected",
            "no bones",
        ),
        (
            ASF.to_owned(),
            AMC.replace("upper 90", "upper"),
            "small.amc, line 5",
            "1 finite",
        ),
        (
            ASF.to_owned(),
            AMC.replace("upper 90", "uper 90"),
            "small.amc, line 5",
            "uper",
        ),
        (
            ASF.to_owned(),
            AMC.replace("lower 0\n", ""),
            "small.amc, line 5",
            "lower in each frame",
        ),
        (
            ASF.to_owned(),
            AMC.replace("lower 0\n", "upper 90\n"),
            "small.amc, line 6",
            "once a frame",
        ),
        (
            ASF.to_owned(),
            format!("{AMC}3\n"),
            "small.amc, line 7",
            "frame 2 next",
        ),
        (
            ASF.to_owned(),
            AMC.replace("\n1\n", "\n"),
            "small.amc, line 3",
            "number of a frame",
        ),
        (
            ASF.to_owned(),
            ":DEGREES\n".to_owned(),
            "small.amc, line 1",
            "at least one frame",
        ),
    ];
    for (asf, amc, place, what) in cases {
        let message = parsed(&asf, &amc).unwrap_err().to_string();
        assert!(
            message.contains(place) && message.contains(what),
            "{message}"
        );
    }
}

#[test]
fn a_missing_skeleton_is_asked_for_by_name() {
    let folder = std::env::temp_dir().join(format!("effigy-amc-{}", std::process::id()));
    fs::create_dir_all(&folder).unwrap();
    let path = folder.join("7_03.amc");
    fs::write(&path, AMC).unwrap();
    let message = AmcClip::read(&path).unwrap_err().to_string();
    fs::remove_dir_all(&folder).unwrap();
    assert!(
        message.contains("7_03.asf") && message.contains("7.asf"),
        "{message}"
    );
}

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

/// One action, recorded once, written down twice, with skeletons of different rest poses: apart from a constant turn
/// of each bone, everything must move alike.
#[test]
fn the_two_files_of_action_11_01_agree() {
    let (Some(bvh), Some(amc)) = (data("mocap-cmu/11_01.bvh"), data("mocap-cmu/amc/11_01.amc"))
    else {
        return;
    };
    let rest = RestBody::of(&builtin::body(), &[0.0; 10]);
    let [one, other] = [bvh, amc].map(|path| super::super::open(&path, &rest).unwrap());
    assert!(
        (one.rate_hz - other.rate_hz).abs() < 0.1,
        "{} and {} Hz",
        one.rate_hz,
        other.rate_hz
    );
    assert_eq!(
        one.poses.len(),
        other.poses.len(),
        "the calibration frame is left out"
    );
    // The BVH file comes out of its T-pose in the first half second.
    let pairs: Vec<_> = one.poses.iter().zip(&other.poses).skip(60).collect();
    for joint in [0, 1, 2, 4, 5, 7, 8, 12, 16, 17, 18, 19] {
        let name = JOINT_NAMES[joint];
        let turns: Vec<Quat> = pairs
            .iter()
            .map(|(a, b)| {
                global_rotation(&b.theta, joint).inverse() * global_rotation(&a.theta, joint)
            })
            .collect();
        let constant = mean_rotation(&turns);
        let off = turns
            .iter()
            .map(|turn| turn.angle_between(constant))
            .sum::<f32>();
        let off_deg = (off / turns.len() as f32).to_degrees();
        println!(
            "11_01, {name}: {off_deg:.2} degrees, {:.1} constant",
            constant.to_axis_angle().1.to_degrees()
        );
        // The files' own rotations differ by 1.3 degrees on average; a wrong axis or order makes it 10 and more.
        assert!(off_deg < 2.5, "{name}: {off_deg} degrees");
        // The largest is a forearm that the BVH's skeleton bends by 17 degrees at rest.
        let constant_deg = constant.to_axis_angle().1.to_degrees();
        assert!(constant_deg < 22.0, "{name}: {constant_deg} degrees");
    }
    let went = |pose: fn(&(&MotionPose, &MotionPose)) -> Vec3| {
        (pose(&pairs[pairs.len() - 1]) - pose(&pairs[0])).with_y(0.0)
    };
    let (a, b) = (went(|(a, _)| a.trans), went(|(_, b)| b.trans));
    println!("11_01: goes {a} m and {b} m");
    assert!(a.length() > 2.0, "three metres forward: {a}");
    // Legs are 0.83 m in one skeleton and 0.87 m in the other: steps scale with them.
    assert!((a - b).length() < 0.12 * a.length(), "{a} and {b}");
}

fn global_rotation(theta: &[Vec3; 24], joint: usize) -> Quat {
    let own = Quat::from_scaled_axis(theta[joint]);
    if joint == 0 {
        own
    } else {
        global_rotation(theta, PARENTS[joint]) * own
    }
}

/// Of rotations that are close together.
fn mean_rotation(rotations: &[Quat]) -> Quat {
    let towards = |q: &Quat| if q.dot(rotations[0]) < 0.0 { -*q } else { *q };
    rotations
        .iter()
        .map(towards)
        .fold(Quat::from_xyzw(0.0, 0.0, 0.0, 0.0), |sum, q| sum + q)
        .normalize()
}
