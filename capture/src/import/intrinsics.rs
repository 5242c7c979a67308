//! The camera of a folder of depth images: from a file beside them, or TUM's defaults.

use std::path::{Path, PathBuf};

use super::read_file;
use crate::{
    calibration::{Calibration, SensorModel},
    camera::{Intrinsics, Rigid3},
    error::CaptureError,
};

/// The whole `Calibration` as JSON.
const CALIBRATION_FILE: &str = "calibration.json";
/// Pinhole parameters as text.
const INTRINSICS_FILE: &str = "intrinsics.txt";

/// What TUM's RGB-D dataset documents for its images: depth 5000 is one metre.
const TUM_UNITS_PER_METRE: f32 = 5000.0;
/// What nearly everybody else writes: millimetres.
const MILLIMETRES: f32 = 1000.0;

/// Kinect v1's focal length in pixels at 640x480, the default of TUM's tools and of PCL.
const KINECT_FOCAL_PX: f32 = 525.0;

/// Who wrote the images, which decides what a depth unit is where nothing says so.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Layout {
    /// With a `depth.txt` as in TUM's dataset.
    Tum,
    Plain,
}

/// The calibration for depth images of a size: `calibration.json`, else `intrinsics.txt`, else the defaults of TUM's
/// dataset with a warning.
pub(super) fn of_folder(
    folder: &Path,
    [width, height]: [u32; 2],
    layout: Layout,
) -> Result<Calibration, CaptureError> {
    let json = folder.join(CALIBRATION_FILE);
    if json.is_file() {
        return read_json(&json, [width, height]);
    }
    let default_units = match layout {
        Layout::Tum => TUM_UNITS_PER_METRE,
        Layout::Plain => MILLIMETRES,
    };
    let text = folder.join(INTRINSICS_FILE);
    if text.is_file() {
        let found = read_text(&text)?;
        let [fx, fy, cx, cy] = found.pinhole;
        let camera = Intrinsics { width, height, fx, fy, cx, cy };
        let calibration = kinect_like(camera, found.units_per_metre.unwrap_or(default_units));
        calibration.check().map_err(CaptureError::in_file(&text))?;
        return Ok(calibration);
    }
    let camera = default_camera([width, height]);
    tracing::warn!(
        "{} has neither {CALIBRATION_FILE} nor {INTRINSICS_FILE}: assuming TUM's defaults, f = {} px, centre {} {}, {} \
         depth units a metre",
        folder.display(),
        camera.fx,
        camera.cx,
        camera.cy,
        default_units
    );
    Ok(kinect_like(camera, default_units))
}

/// Kinect v1's pinhole, scaled to an image's width: at 640x480 f = 525 and the centre is (319.5, 239.5).
pub(super) fn default_camera([width, height]: [u32; 2]) -> Intrinsics {
    let focal = KINECT_FOCAL_PX * width as f32 / 640.0;
    let centre = |length: u32| (length as f32 - 1.0) / 2.0;
    Intrinsics { width, height, fx: focal, fy: focal, cx: centre(width), cy: centre(height) }
}

/// A Kinect v1 with another pinhole, colour registered to depth.
pub(super) fn kinect_like(camera: Intrinsics, units_per_metre: f32) -> Calibration {
    Calibration {
        sensor_name: "imported".to_owned(),
        depth: camera.into(),
        color: None,
        color_from_depth: Rigid3::IDENTITY,
        metres_per_unit: 1.0 / units_per_metre,
        range_m: [0.3, 10.0],
        rate_hz: 30.0,
        sensor: SensorModel::StructuredLight,
        world_from_camera: None,
    }
}

fn read_json(path: &Path, got_px: [u32; 2]) -> Result<Calibration, CaptureError> {
    let bytes = read_file(path, "the calibration")?;
    let calibration: Calibration =
        serde_json::from_slice(&bytes).map_err(|error| CaptureError::BadLine {
            path: path.to_owned(),
            line: error.line(),
            expected: "Effigy's calibration as JSON (`effigy info` of a recording shows one)",
            found: error.to_string(),
        })?;
    calibration.check().map_err(CaptureError::in_file(path))?;
    let Intrinsics { width, height, .. } = calibration.depth.intrinsics;
    if got_px != [width, height] {
        let expected_px = [width, height];
        let mismatch = CaptureError::SizeMismatch { what: "depth", got_px, expected_px };
        return Err(CaptureError::in_file(path)(mismatch));
    }
    Ok(calibration)
}

#[derive(Debug, PartialEq)]
struct Found {
    /// fx, fy, cx, cy.
    pinhole: [f32; 4],
    units_per_metre: Option<f32>,
}

fn read_text(path: &Path) -> Result<Found, CaptureError> {
    let bytes = read_file(path, "the intrinsics")?;
    let text = String::from_utf8_lossy(&bytes);
    parse_text(&text).ok_or_else(|| CaptureError::BadLine {
        path: PathBuf::from(path),
        line: 1,
        expected: "`fx 525 fy 525 cx 319.5 cy 239.5` and if need be `depth_scale 1000`, those four numbers alone, or a 3x3 camera matrix",
        found: text.chars().take(80).collect(),
    })
}

/// Labelled values in any order among other words, or four numbers, or a matrix by rows.
fn parse_text(text: &str) -> Option<Found> {
    let separators = |c: char| c.is_whitespace() || matches!(c, '=' | ':' | ',' | ';' | '[' | ']');
    let words: Vec<&str> = text
        .split(separators)
        .filter(|word| !word.is_empty())
        .collect();
    let word_after = |label: &str| {
        let is_label = |word: &&str| word.eq_ignore_ascii_case(label);
        let place = words.iter().position(is_label)?;
        Some(words.get(place + 1).copied().unwrap_or_default())
    };
    let after = |label: &str| word_after(label)?.parse::<f32>().ok();
    let units_per_metre = match word_after("units_per_metre").or_else(|| word_after("depth_scale"))
    {
        None => None,
        // What is there and no scale must not pass for the default.
        Some(word) => Some(units_per_metre_of(word)?),
    };
    let labelled = [after("fx"), after("fy"), after("cx"), after("cy")];
    if let [Some(fx), Some(fy), Some(cx), Some(cy)] = labelled {
        return Some(Found { pinhole: [fx, fy, cx, cy], units_per_metre });
    }
    let numbers: Option<Vec<f32>> = words.iter().map(|word| word.parse().ok()).collect();
    let pinhole = match numbers?.as_slice() {
        &[fx, fy, cx, cy] | &[fx, _, cx, _, fy, cy, _, _, _] => [fx, fy, cx, cy],
        _ => return None,
    };
    Some(Found { pinhole, units_per_metre })
}

/// Depth units a metre: TUM's 5000, or RealSense's 0.001 metres a unit the other way around.
fn units_per_metre_of(word: &str) -> Option<f32> {
    let scale: f64 = word.parse().ok()?;
    let units = if scale < 1.0 { 1.0 / scale } else { scale } as f32;
    (scale > 0.0 && units.is_finite()).then_some(units)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn labels_bare_numbers_and_matrices_say_the_same() {
        let expected = Some(Found { pinhole: [525.0, 526.0, 319.5, 239.5], units_per_metre: None });
        assert_eq!(
            parse_text("fx 525 fy 526 cx 319.5 cy 239.5 (by hand), depth in mm"),
            expected
        );
        assert_eq!(parse_text("525 526 319.5 239.5\n"), expected);
        assert_eq!(parse_text("525 0 319.5\n0 526 239.5\n0 0 1"), expected);
        let scaled = parse_text("fx=525, fy=526, cx=319.5, cy=239.5, depth_scale=5000");
        assert_eq!(scaled.and_then(|found| found.units_per_metre), Some(5000.0));
        assert_eq!(parse_text("focal length 525"), None);
        let with_scale = |scale: &str| {
            let text = format!("fx 525 fy 526 cx 319.5 cy 239.5 depth_scale: {scale}");
            parse_text(&text).map(|found| found.units_per_metre)
        };
        assert_eq!(with_scale("0.001"), Some(Some(1000.0)), "metres a unit");
        for scale in ["-1", "0", "nan", "mm", ""] {
            assert_eq!(with_scale(scale), None, "{scale:?} is no scale");
        }
    }

    #[test]
    fn the_default_is_tums_at_640x480_and_scales_with_the_width() {
        let camera = default_camera([640, 480]);
        assert_eq!([camera.fx, camera.cx, camera.cy], [525.0, 319.5, 239.5]);
        assert_eq!(default_camera([320, 240]).fx, 262.5);
    }
}
