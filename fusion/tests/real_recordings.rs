//! Cleaning and segmentation on real sensors' images, where the data folder is present.

use std::{
    fs,
    path::{Path, PathBuf},
    sync::Arc,
};

use effigy_capture::{
    Calibration, DepthImage, Frame, FrameId, Intrinsics, Rigid3, SensorModel, Timestamp,
};
use effigy_fusion::{CleanConfig, CleanFrame, Cleaner, clean::PersonVisibility};

/// The shared data folder; tests that need it pass with a message where it is missing.
#[expect(clippy::print_stdout, reason = "says why a test did nothing")]
fn data(inside: &str) -> Option<PathBuf> {
    let beside = concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared/data");
    let root = std::env::var_os("EFFIGY_DATA").map_or_else(|| PathBuf::from(beside), PathBuf::from);
    let path = root.join(inside);
    if path.exists() {
        return Some(path);
    }
    println!("skipped: {} is missing", path.display());
    None
}

fn calibration(camera: Intrinsics, range_m: [f32; 2], sensor: SensorModel) -> Calibration {
    Calibration {
        sensor_name: "test".to_owned(),
        depth: camera.into(),
        color: None,
        color_from_depth: Rigid3::IDENTITY,
        metres_per_unit: 0.001,
        range_m,
        rate_hz: 30.0,
        sensor,
        world_from_camera: None,
    }
}

fn read_png(path: &Path) -> DepthImage {
    let image = image::open(path)
        .expect("the data folder holds images")
        .into_luma16();
    DepthImage::new(image.width(), image.height(), image.into_raw())
        .expect("as many pixels as its size")
}

fn frame(depth: DepthImage) -> Frame {
    Frame { id: FrameId(0), timestamp: Timestamp(0), depth: Arc::new(depth), color: None }
}

/// Paints the person for a look at it: `EFFIGY_PICTURES=DIR cargo test ...`.
fn picture(name: &str, clean: &CleanFrame) {
    let Some(folder) = std::env::var_os("EFFIGY_PICTURES") else {
        return;
    };
    let (width, height) = (clean.depth.width as u32, clean.depth.height as u32);
    let pixels = image::RgbImage::from_fn(width, height, |x, y| {
        let pixel = (y * width + x) as usize;
        let shade = (clean.depth.metres[pixel].max(0.0) * 50.0).min(255.0) as u8;
        let normal = (clean.normals.normals[pixel] * -100.0 + 128.0)
            .to_array()
            .map(|c| c as u8);
        image::Rgb(if clean.person[pixel] {
            normal
        } else {
            [shade; 3]
        })
    });
    pixels
        .save(Path::new(&folder).join(format!("{name}.png")))
        .expect("the pictures folder can be written");
}

/// Mean absolute difference in millimetres over the pixels both have, and how many these are.
fn mean_abs_mm(
    found: impl Fn(usize) -> Option<f32>,
    reference: &[u16],
    mask: &[u8],
) -> (f32, usize) {
    let errors: Vec<f32> = (0..mask.len())
        .filter(|&pixel| mask[pixel] > 0 && reference[pixel] > 0)
        .filter_map(|pixel| found(pixel).map(|depth| (depth - f32::from(reference[pixel])).abs()))
        .collect();
    (
        errors.iter().sum::<f32>() / errors.len() as f32,
        errors.len(),
    )
}

#[test]
fn a_real_person_comes_out_closer_to_the_reference_and_nearly_whole() {
    let Some(root) = data("ddrnet-person") else {
        return;
    };
    let camera =
        Intrinsics { width: 640, height: 480, fx: 536.628, fy: 536.606, cx: 310.591, cy: 234.759 };
    let calibration = calibration(camera, [0.4, 4.0], SensorModel::StructuredLight);
    let mut cleaner = Cleaner::new(calibration, CleanConfig::default());
    let (mut raw_sum, mut clean_sum, mut same_sum) = (0.0, 0.0, 0.0);
    let (mut raw_count, mut clean_count, mut kept, mut frames) = (0, 0, 0, 0);
    let mut paths: Vec<_> = fs::read_dir(root.join("depth_map"))
        .unwrap()
        .map(|entry| entry.unwrap())
        .collect();
    paths.sort_by_key(fs::DirEntry::file_name);
    for entry in paths {
        let raw = read_png(&entry.path());
        let reference = read_png(&root.join("high_quality_depth").join(entry.file_name()));
        let mask = image::open(root.join("mask").join(entry.file_name()))
            .unwrap()
            .into_luma8();
        let clean = cleaner.process(&frame(raw.clone())).unwrap();
        assert_eq!(
            clean.visibility,
            PersonVisibility::Partial,
            "cut at the waist"
        );
        let raw_at = |p: usize| (raw.pixels()[p] > 0).then(|| f32::from(raw.pixels()[p]));
        let clean_at = |p: usize| clean.person[p].then(|| clean.depth.metres[p] * 1000.0);
        let measured_at = |p: usize| raw_at(p).and(clean_at(p));
        let raw_where_kept = |p: usize| clean_at(p).and(raw_at(p));
        let (raw_mm, raw_pixels) = mean_abs_mm(raw_at, reference.pixels(), &mask);
        let (clean_mm, clean_pixels) = mean_abs_mm(clean_at, reference.pixels(), &mask);
        let (_, kept_pixels) = mean_abs_mm(measured_at, reference.pixels(), &mask);
        let (same_mm, _) = mean_abs_mm(raw_where_kept, reference.pixels(), &mask);
        raw_sum += raw_mm;
        clean_sum += clean_mm;
        same_sum += same_mm;
        raw_count += raw_pixels;
        clean_count += clean_pixels;
        kept += kept_pixels;
        frames += 1;
        picture(&format!("ddrnet_{frames:02}"), &clean);
    }
    let share = kept as f32 / raw_count as f32;
    println!(
        "raw {:.3} mm (where kept {:.3}), clean {:.3} mm: {:.1} % closer; {:.2} % of {raw_count} \
         pixels kept, {clean_count} in all, {frames} frames",
        raw_sum / frames as f32,
        same_sum / frames as f32,
        clean_sum / frames as f32,
        100.0 * (1.0 - clean_sum / raw_sum),
        100.0 * share,
    );
    assert!(clean_sum < 0.85 * raw_sum);
    assert!(share >= 0.98);
}

#[test]
fn the_two_whole_people_of_five_are_separate_bodies() {
    let Some(path) = data("pcl/five_people.pcd") else {
        return;
    };
    let depth = read_pcd_depth(&fs::read(path).unwrap());
    let camera = Intrinsics { width: 640, height: 480, fx: 525.0, fy: 525.0, cx: 319.5, cy: 239.5 };
    let sensor = SensorModel::StructuredLight;
    let mut cleaner = Cleaner::new(
        calibration(camera, [0.4, 4.5], sensor),
        CleanConfig::default(),
    );
    let clean = cleaner.process(&frame(depth.clone())).unwrap();
    picture("five_people", &clean);
    let floor = clean.floor.expect("the floor fills the lower third");
    assert!(floor.normal.y < -0.98, "{floor:?}");
    assert_eq!(
        clean.visibility,
        PersonVisibility::Partial,
        "the nearest has no feet in view"
    );
    assert_eq!(cleaner.bodies().len(), 5);
    // The two in the middle walk shoulder to shoulder, 0.4 m apart and 2.6 and 2.8 m away.
    let middle: Vec<_> = cleaner
        .bodies()
        .iter()
        .filter(|body| body.centroid.x.abs() < 0.5)
        .collect();
    assert_eq!(middle.len(), 2);
    for body in middle {
        assert!(body.span_m[0] < 0.1 && body.span_m[1] > 1.6, "{body:?}");
        assert!((0.45..0.65).contains(&body.width_m), "{body:?}");
    }
    // Alone in the working volume, the nearer of the two is followed, whole and without the other.
    let between = CleanConfig { range_m: Some([2.45, 3.2]), ..CleanConfig::default() };
    let mut cleaner = Cleaner::new(calibration(camera, [0.4, 4.5], sensor), between);
    let clean = cleaner.process(&frame(depth)).unwrap();
    picture("two_people", &clean);
    assert_eq!(clean.visibility, PersonVisibility::Whole);
    let person = || (0..640 * 480).filter(|&pixel| clean.person[pixel]);
    // By eye, their arms meet between columns 362 and 372.
    let beyond = person().filter(|pixel| pixel % 640 < 358).count();
    assert!(person().count() > 20_000, "{} pixels", person().count());
    assert!(
        beyond < person().count() / 100,
        "{beyond} pixels are the other's"
    );
}

#[test]
fn a_cluttered_stereo_image_full_of_holes_is_cleaned() {
    let Some(path) = data("vcl-realsense-d415/0_M11_depth_0.png") else {
        return;
    };
    let camera =
        Intrinsics { width: 640, height: 360, fx: 481.94, fy: 481.94, cx: 315.17, cy: 174.97 };
    let sensor = SensorModel::Stereo { baseline_m: 0.055, focal_px: 481.94, subpixel_rms_px: 0.08 };
    let mut cleaner = Cleaner::new(
        calibration(camera, [0.4, 4.0], sensor),
        CleanConfig::default(),
    );
    let clean = cleaner.process(&frame(read_png(&path))).unwrap();
    picture("d415", &clean);
    assert_eq!(
        clean.visibility,
        PersonVisibility::Partial,
        "cut at the knees"
    );
    // The head is cut off the body by the stereo shadow under the chin, and yet belongs to it.
    let head = (20..80).flat_map(|y| (330..360).map(move |x| y * 640 + x));
    let found = head.clone().filter(|&pixel| clean.person[pixel]).count();
    assert!(found > head.count() * 9 / 10, "{found} pixels of the head");
}

/// The z of an organised, `binary_compressed` cloud of x, y, z, rgba, in millimetres.
fn read_pcd_depth(bytes: &[u8]) -> DepthImage {
    let marker = b"DATA binary_compressed\n";
    let start = bytes
        .windows(marker.len())
        .position(|window| window == marker)
        .expect("the encoding of this file");
    let body = &bytes[start + marker.len()..];
    let size = u32::from_le_bytes(body[..4].try_into().expect("four bytes")) as usize;
    let points = 640 * 480;
    let fields = decompress_lzf(&body[8..8 + size]);
    let z = fields[8 * points..12 * points].chunks_exact(4);
    let millimetres = z
        .map(|bytes| f32::from_le_bytes(bytes.try_into().expect("four bytes")) * 1000.0)
        .map(|mm| if mm.is_nan() { 0 } else { mm.round() as u16 })
        .collect();
    DepthImage::new(640, 480, millimetres).expect("640 by 480 points")
}

fn decompress_lzf(input: &[u8]) -> Vec<u8> {
    let mut output: Vec<u8> = Vec::new();
    let mut at = 0;
    while at < input.len() {
        let control = usize::from(input[at]);
        at += 1;
        if control < 32 {
            output.extend(&input[at..=at + control]);
            at += control + 1;
            continue;
        }
        let mut length = control >> 5;
        if length == 7 {
            length += usize::from(input[at]);
            at += 1;
        }
        let back = ((control & 31) << 8) + usize::from(input[at]) + 1;
        at += 1;
        for _ in 0..length + 2 {
            output.push(output[output.len() - back]);
        }
    }
    output
}
