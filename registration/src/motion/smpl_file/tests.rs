//! What the reader claims: whatever the file's axes, people stand upright and face where they should; holes are named.

use std::{
    fs,
    io::Write as _,
    path::{Path, PathBuf},
};

use super::*;
use crate::smpl::{BoneTransforms, builtin};

fn rest() -> RestBody {
    RestBody::of(&builtin::body(), &[0.0; 10])
}

fn written(name: &str, bytes: &[u8]) -> PathBuf {
    let folder = std::env::temp_dir().join(format!("effigy-smpl-{}", std::process::id()));
    fs::create_dir_all(&folder).unwrap();
    let path = folder.join(name);
    fs::write(&path, bytes).unwrap();
    path
}

fn csv(cells: impl Fn(usize, usize) -> String) -> String {
    let row = |r| (0..72).map(|c| cells(r, c)).collect::<Vec<_>>().join(",");
    let header = (0..72).map(|c| c.to_string()).collect::<Vec<_>>().join(",");
    format!("{header}\n{}\n{}\n", row(0), row(1))
}

#[test]
fn rows_with_holes_or_words_are_named_by_line_and_column() {
    let cases = [
        (
            csv(|r, c| {
                if (r, c) == (1, 4) {
                    String::new()
                } else {
                    "0".into()
                }
            }),
            "line 3",
            "column 5",
        ),
        (
            csv(|r, c| {
                if (r, c) == (0, 71) {
                    "x".into()
                } else {
                    "0".into()
                }
            }),
            "line 2",
            "column 72",
        ),
        (
            csv(|r, c| {
                if (r, c) == (0, 9) {
                    "inf".into()
                } else {
                    "0".into()
                }
            }),
            "line 2",
            "column 10",
        ),
        ("1,2,3\n4,5,6\n".to_owned(), "line 1", "72 cells"),
        (
            csv(|_, _| "0".into()).lines().next().unwrap().to_owned(),
            ".csv: expected",
            "rows of 72",
        ),
        (
            csv(|r, _| if r == 0 { "0".into() } else { "1e9".into() }),
            "frame 1",
            "beyond",
        ),
        (
            csv(|_, _| "0".into()).replacen('\n', "\n\n", 2),
            "line 2",
            "an empty row",
        ),
    ];
    for (i, (text, place, what)) in cases.into_iter().enumerate() {
        let path = written(&format!("holes{i}.csv"), text.as_bytes());
        let message = super::super::open(&path, &rest()).unwrap_err().to_string();
        assert!(
            message.contains(place) && message.contains(what),
            "{message}"
        );
    }
}

/// A stored (not compressed) archive of arrays, as `numpy.savez` writes it.
fn npz(name: &str, arrays: &[(&str, Vec<usize>, Vec<f64>)]) -> PathBuf {
    let mut archive = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
    for (array, shape, data) in arrays {
        archive
            .start_file(
                format!("{array}.npy"),
                zip::write::SimpleFileOptions::default(),
            )
            .unwrap();
        let lengths: Vec<String> = shape.iter().map(|n| format!("{n},")).collect();
        let mut header = format!(
            "{{'descr': '<f8', 'fortran_order': False, 'shape': ({}), }}",
            lengths.concat()
        );
        while (header.len() + 11) % 64 != 0 {
            header.push(' ');
        }
        header.push('\n');
        archive.write_all(b"\x93NUMPY\x01\x00").unwrap();
        archive
            .write_all(&(header.len() as u16).to_le_bytes())
            .unwrap();
        archive.write_all(header.as_bytes()).unwrap();
        for value in data {
            archive.write_all(&value.to_le_bytes()).unwrap();
        }
    }
    written(name, archive.finish().unwrap().get_ref())
}

/// Someone who stands facing +z in our axes and walks a metre to +z, written in a file's axes.
fn walk_in(file_from_ours: Quat) -> PathBuf {
    let pelvis = rest().joints[0];
    let mut poses = Vec::new();
    let mut trans = Vec::new();
    for frame in 0..11 {
        let mut numbers = vec![0.0; 156];
        let root = file_from_ours.to_scaled_axis();
        for (to, from) in numbers.iter_mut().zip(root.to_array()) {
            *to = f64::from(from);
        }
        let pelvis_in_ours = pelvis + Vec3::new(0.0, 0.9, 0.1 * frame as f32);
        let moved = file_from_ours * pelvis_in_ours - pelvis;
        poses.extend(numbers);
        trans.extend(moved.to_array().map(f64::from));
    }
    let name = format!("walk{}.npz", (file_from_ours.x * 100.0) as i32);
    npz(
        &name,
        &[
            ("poses", vec![11, 156], poses),
            ("trans", vec![11, 3], trans),
            ("betas", vec![16], (0..16).map(f64::from).collect()),
            ("mocap_framerate", vec![], vec![60.0]),
        ],
    )
}

#[test]
fn files_with_z_up_or_y_down_stand_upright_and_walk_where_they_face() {
    let rest = rest();
    let quarter = std::f32::consts::FRAC_PI_2;
    for file_from_ours in [
        Quat::IDENTITY,
        Quat::from_rotation_x(quarter),
        Quat::from_rotation_x(2.0 * quarter),
    ] {
        let path = walk_in(file_from_ours);
        let file = SmplFile::read(&path).unwrap();
        assert_eq!(file.rate_hz, 60.0);
        assert_eq!(file.betas.unwrap()[3], 3.0);
        let motion = super::super::open(&path, &rest).unwrap();
        let (first, last) = (&motion.poses[0], &motion.poses[10]);
        assert!(
            first.theta[0].length() < 1e-3,
            "upright, facing +z: {}",
            first.theta[0]
        );
        let went = last.trans - first.trans;
        assert!((went - Vec3::Z).length() < 1e-4, "one metre to +z: {went}");
        let lowest_m = rest.lowest_point_m(&first.theta) + first.trans.y;
        assert!(lowest_m.abs() < 1e-4, "on the floor: {lowest_m} m");
    }
}

#[test]
fn archives_without_poses_or_of_another_shape_are_refused() {
    let cases = [
        (
            npz("none.npz", &[("trans", vec![1, 3], vec![0.0; 3])]),
            "poses",
        ),
        (
            npz("thin.npz", &[("poses", vec![2, 70], vec![0.0; 140])]),
            "[2, 70]",
        ),
        (
            npz(
                "trans.npz",
                &[
                    ("poses", vec![2, 72], vec![0.0; 144]),
                    ("trans", vec![1, 3], vec![0.0; 3]),
                ],
            ),
            "[1, 3]",
        ),
        (
            npz(
                "hole.npz",
                &[(
                    "poses",
                    vec![1, 72],
                    [vec![f64::NAN], vec![0.0; 71]].concat(),
                )],
            ),
            "NaN",
        ),
        (written("text.npz", b"no archive"), "archive"),
        (written("motion.fbx", b""), "fbx"),
    ];
    for (path, what) in cases {
        let message = super::super::open(&path, &rest()).unwrap_err().to_string();
        assert!(message.contains(what), "{message}");
    }
}

#[test]
fn a_real_csv_stands_on_the_floor_and_faces_the_camera() {
    let root = std::env::var_os("EFFIGY_DATA").map_or_else(
        || Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data"),
        PathBuf::from,
    );
    let path = root.join("smpl-params/movebox/smpl_pose_p0_v2.csv");
    if !path.exists() {
        println!("skipped: {} is missing", path.display());
        return;
    }
    let rest = rest();
    let motion = super::super::open(&path, &rest).unwrap();
    assert_eq!(motion.poses.len(), 285);
    let (mut facing, mut upright) = (Vec3::ZERO, 0.0);
    for pose in &motion.poses {
        let (_, joints) = BoneTransforms::from_pose(&pose.theta, &rest.joints);
        let spine = (joints[12] - joints[0]).normalize_or_zero();
        upright += spine.y / motion.poses.len() as f32;
        let lowest_m = rest.lowest_point_m(&pose.theta) + pose.trans.y;
        assert!(lowest_m.abs() < 1e-4, "{lowest_m} m");
        facing += Quat::from_scaled_axis(pose.theta[0]) * Vec3::Z;
    }
    assert!(upright > 0.8, "the trunk stands up: {upright} on average");
    assert!(facing.z > 0.0, "filmed from the front: {facing}");
}
