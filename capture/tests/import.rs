//! Folders, clouds and single images of other people play as frame sources.
#![expect(
    clippy::unwrap_used,
    reason = "a test that cannot set itself up has failed"
)]

use std::{
    fs,
    path::{Path, PathBuf},
};

use effigy_capture::{CaptureError, FrameSource, Timestamp, source};
use proptest::prelude::*;

/// A 16-bit PNG of one value.
fn write_depth(path: &Path, [width, height]: [u32; 2], value: u16) {
    fs::create_dir_all(path.parent().unwrap()).unwrap();
    let file = fs::File::create(path).unwrap();
    let mut encoder = png::Encoder::new(file, width, height);
    encoder.set_color(png::ColorType::Grayscale);
    encoder.set_depth(png::BitDepth::Sixteen);
    let data = value.to_be_bytes().repeat((width * height) as usize);
    encoder
        .write_header()
        .unwrap()
        .write_image_data(&data)
        .unwrap();
}

fn write_color(path: &Path, [width, height]: [u32; 2], value: u8) {
    fs::create_dir_all(path.parent().unwrap()).unwrap();
    let mut encoder = png::Encoder::new(fs::File::create(path).unwrap(), width, height);
    encoder.set_color(png::ColorType::Rgb);
    let data = vec![value; (3 * width * height) as usize];
    encoder
        .write_header()
        .unwrap()
        .write_image_data(&data)
        .unwrap();
}

fn play(source: &mut dyn FrameSource) -> Vec<effigy_capture::Frame> {
    std::iter::from_fn(|| source.next_frame().unwrap()).collect()
}

#[test]
fn a_tum_folder_plays_its_listing_in_order_with_the_nearest_colour() {
    let dir = tempfile::tempdir().unwrap();
    let folder = dir.path();
    for (name, value) in [("1.031000", 2), ("1.000500", 1), ("1.062", 3)] {
        write_depth(&folder.join(format!("depth/{name}.png")), [8, 6], value);
    }
    write_color(&folder.join("rgb/a.png"), [8, 6], 70);
    let depth = "# timestamp filename\n1.031000 depth/1.031000.png\n1.000500 depth/1.000500.png\n1.062 depth/1.062.png\n";
    fs::write(folder.join("depth.txt"), depth).unwrap();
    fs::write(folder.join("rgb.txt"), "1.029 rgb/a.png\n").unwrap();
    let mut source = source::open(folder).unwrap();
    assert_eq!(source.frame_count(), Some(3));
    assert_eq!(source.calibration().metres_per_unit, 1.0 / 5000.0);
    let frames = play(source.as_mut());
    let seen: Vec<_> = frames
        .iter()
        .map(|frame| {
            (
                frame.id.0,
                frame.timestamp,
                frame.depth.pixels()[0],
                frame.color.is_some(),
            )
        })
        .collect();
    let at = |nanos: u64| Timestamp(1_000_000_000 + nanos);
    let expected = vec![
        (0, at(500_000), 1, false),
        (1, at(31_000_000), 2, true),
        (2, at(62_000_000), 3, false),
    ];
    assert_eq!(seen, expected);
}

#[test]
fn numbered_images_keep_their_gaps_and_take_the_camera_beside_them() {
    let dir = tempfile::tempdir().unwrap();
    for number in [7, 8, 10] {
        write_depth(
            &dir.path().join(format!("depth_map/frame_{number:06}.png")),
            [8, 6],
            number,
        );
    }
    fs::write(
        dir.path().join("intrinsics.txt"),
        "fx 10 fy 11 cx 4 cy 3, depth in mm",
    )
    .unwrap();
    let mut source = source::open(dir.path()).unwrap();
    let camera = source.calibration().depth.intrinsics;
    assert_eq!(
        [camera.fx, camera.fy, camera.cx, camera.cy],
        [10.0, 11.0, 4.0, 3.0]
    );
    assert_eq!(source.calibration().metres_per_unit, 0.001);
    let ids: Vec<u64> = play(source.as_mut())
        .iter()
        .map(|frame| frame.id.0)
        .collect();
    assert_eq!(ids, [0, 1, 3]);
}

#[test]
fn a_calibration_beside_the_images_is_used_whole() {
    let dir = tempfile::tempdir().unwrap();
    write_depth(&dir.path().join("depth/1.png"), [8, 6], 1);
    let mut calibration = source::open(dir.path()).unwrap().calibration().clone();
    calibration.sensor_name = "mine".to_owned();
    calibration.metres_per_unit = 0.00025;
    fs::write(
        dir.path().join("calibration.json"),
        serde_json::to_string(&calibration).unwrap(),
    )
    .unwrap();
    assert_eq!(
        *source::open(dir.path()).unwrap().calibration(),
        calibration
    );
    calibration.depth.intrinsics.fx = -1.0;
    fs::write(
        dir.path().join("calibration.json"),
        serde_json::to_string(&calibration).unwrap(),
    )
    .unwrap();
    let message = source::open(dir.path()).err().unwrap().to_string();
    assert!(
        message.contains("depth camera") && message.contains("positive fx"),
        "{message}"
    );
}

#[test]
fn bad_folders_and_files_are_refused_with_place_and_expectation() {
    let dir = tempfile::tempdir().unwrap();
    let refused = |path: &Path| source::open(path).err().unwrap().to_string();
    let empty = dir.path().join("empty");
    fs::create_dir(&empty).unwrap();
    assert!(
        refused(&empty).contains("16-bit PNG or PGM"),
        "{}",
        refused(&empty)
    );
    assert!(refused(&dir.path().join("nothing")).contains("nothing"));
    let text = dir.path().join("notes.txt");
    fs::write(&text, "hello").unwrap();
    assert!(
        refused(&text).contains("\"hello\"") && refused(&text).contains("MCAP"),
        "{}",
        refused(&text)
    );
    fs::write(&text, "").unwrap();
    assert!(refused(&text).contains("the file is empty"));
    fs::write(empty.join("depth.txt"), "# times\n1.0 a.png\nsoon b.png\n").unwrap();
    assert!(
        refused(&empty).contains("line 3") && refused(&empty).contains("soon b.png"),
        "{}",
        refused(&empty)
    );
    write_color(&empty.join("depth/1.png"), [8, 6], 1);
    fs::remove_file(empty.join("depth.txt")).unwrap();
    assert!(
        refused(&empty).contains("16-bit greyscale") && refused(&empty).contains("1.png"),
        "{}",
        refused(&empty)
    );
}

#[test]
fn an_image_of_another_size_in_the_middle_is_an_error_that_names_it() {
    let dir = tempfile::tempdir().unwrap();
    write_depth(&dir.path().join("depth/1.png"), [8, 6], 1);
    write_depth(&dir.path().join("depth/2.png"), [6, 8], 1);
    let mut source = source::open(dir.path()).unwrap();
    assert!(source.next_frame().unwrap().is_some());
    let error = source.next_frame().unwrap_err();
    assert!(
        matches!(error, CaptureError::BadImage { .. }) && error.to_string().contains("2.png"),
        "{error}"
    );
}

#[expect(clippy::print_stdout, reason = "a skipped test says why")]
/// Real recordings beside the project; without them the tests below have nothing to say.
fn real(name: &str) -> Option<PathBuf> {
    let beside = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared/data"));
    let path = std::env::var_os("EFFIGY_DATA")
        .map_or(beside, PathBuf::from)
        .join(name);
    if !path.exists() {
        println!("skipped: {} is missing", path.display());
        return None;
    }
    Some(path)
}

#[test]
fn five_real_people_in_a_kinect_cloud_have_the_camera_they_were_taken_with() {
    let Some(path) = real("pcl/five_people.pcd") else {
        return;
    };
    let mut source = source::open(&path).unwrap();
    let camera = source.calibration().depth.intrinsics;
    // The cloud's maker used exactly this camera; f32 coordinates blur it by less than a hundredth of a pixel.
    for (got, expected) in [
        (camera.fx, 525.0),
        (camera.fy, 525.0),
        (camera.cx, 319.5),
        (camera.cy, 239.5),
    ] {
        approx::assert_abs_diff_eq!(got, expected, epsilon = 0.01);
    }
    let frame = source.next_frame().unwrap().unwrap();
    let measured: Vec<u16> = frame
        .depth
        .pixels()
        .iter()
        .copied()
        .filter(|depth| *depth > 0)
        .collect();
    assert!(measured.len() > 100_000 && measured.iter().all(|depth| (500..10_500).contains(depth)));
    assert!(frame.color.is_some());
}

#[test]
fn real_folders_and_images_open() {
    for (name, frames, focal_px) in [
        ("ddrnet-person", 10, 536.628),
        ("tum-style-rgbd", 1, 525.0),
        ("vcl-realsense-d415", 1, 525.0),
        ("vcl-realsense-d415/0_M11_depth_0.png", 1, 525.0),
        ("pcl/person.pcd", 1, 525.0),
    ] {
        let Some(path) = real(name) else { continue };
        let mut source = source::open(&path).unwrap();
        assert_eq!(play(source.as_mut()).len(), frames, "{name}");
        let camera = source.calibration().depth.intrinsics;
        approx::assert_abs_diff_eq!(camera.fx, focal_px, epsilon = 0.01);
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn files_of_random_bytes_are_refused_without_a_panic(
        magic in prop::sample::select(vec![&b"P5 3 2 65535\n"[..], b"\x89PNG\r\n\x1a\n", b"# .PCD v0.7\n", b"VERSION 0.7\n", b""]),
        bytes in prop::collection::vec(any::<u8>(), 0..200),
    ) {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("random");
        fs::write(&path, [magic, &bytes].concat()).unwrap();
        // A PGM of 12 random bytes is a fine image; all else is refused.
        prop_assert!(source::open(&path).is_err() || magic.starts_with(b"P5") && bytes.len() >= 12);
    }

    #[test]
    fn clouds_with_strange_headers_are_refused_or_read_without_a_panic(
        width in 0..40u32, height in 0..40u32, size in 0..9usize, count in 0..2000usize,
        kind in prop::sample::select(vec!["F", "I", "U", "X"]),
        data in prop::sample::select(vec!["ascii", "binary", "binary_compressed", "other"]),
        bytes in prop::collection::vec(any::<u8>(), 0..400),
    ) {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("strange.pcd");
        let header = format!(
            "VERSION 0.7\nFIELDS x y z rgb\nSIZE {size} 4 4 4\nTYPE {kind} F F U\nCOUNT 1 1 {count} 1\nWIDTH {width}\nHEIGHT {height}\nDATA {data}\n"
        );
        fs::write(&path, [header.as_bytes(), &bytes].concat()).unwrap();
        let _opened = source::open(&path);
    }
}
