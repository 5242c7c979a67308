//! Folders of depth images in the manner of TUM's RGB-D dataset.
//!
//! Either `depth.txt` (and `rgb.txt`) list times and files, or a folder `depth` (`depth_map`) holds 16-bit PNG or PGM
//! images, and `rgb` (`color`, `color_map`) the colour, named by time or number; or the folder itself holds them.

use std::{
    path::{Path, PathBuf},
    sync::Arc,
};

use super::{
    intrinsics::{self, Layout},
    listing::{self, Listed},
    read_depth, read_file,
};
use crate::{
    calibration::{Calibration, RATES_HZ},
    codec::color,
    error::CaptureError,
    frame::Frame,
    image::ColorImage,
    source::FrameSource,
    time::{FrameId, Timestamp},
};

/// Depth and colour further apart than this are not one exposure: TUM's own tool uses the same.
const MAX_APART_SECS: f64 = 0.02;

const EXPECTED: &str = "16-bit PNG or PGM images listed in depth.txt, in a folder `depth` or `depth_map`, or in the folder itself";

/// A folder of depth images, with colour where it has the same size or a calibration of its own.
pub struct TumFolder {
    path: PathBuf,
    calibration: Calibration,
    entries: Vec<Entry>,
    next: usize,
}

struct Entry {
    id: FrameId,
    timestamp: Timestamp,
    depth: PathBuf,
    color: Option<PathBuf>,
}

impl TumFolder {
    pub fn open(path: &Path) -> Result<Self, CaptureError> {
        let depth_list = path.join("depth.txt");
        let layout = if depth_list.is_file() {
            Layout::Tum
        } else {
            Layout::Plain
        };
        let (depth, color) = match layout {
            Layout::Tum => (listing::from_text(&depth_list)?, colors_of_listing(path)?),
            Layout::Plain => images_of_folders(path)?,
        };
        let Some(first) = depth.first() else {
            return Err(CaptureError::EmptyFolder { path: path.to_owned(), expected: EXPECTED });
        };
        let first_depth = read_depth(&first.path)?;
        let size = [first_depth.width(), first_depth.height()];
        let mut calibration = intrinsics::of_folder(path, size, layout)?;
        let color = usable_colors(color, &mut calibration)?;
        calibration.rate_hz = rate_of(&depth).unwrap_or(calibration.rate_hz);
        let entries = join(depth, &color);
        Ok(Self { path: path.to_owned(), calibration, entries, next: 0 })
    }

    fn read(&self, entry: &Entry) -> Result<Frame, CaptureError> {
        let depth = read_depth(&entry.depth)?;
        let camera = &self.calibration.depth.intrinsics;
        check_size(
            &entry.depth,
            [depth.width(), depth.height()],
            [camera.width, camera.height],
        )?;
        let color = match (&entry.color, &self.calibration.color) {
            (Some(path), Some(camera)) => {
                let color = read_color(path)?;
                let camera = &camera.intrinsics;
                check_size(
                    path,
                    [color.width(), color.height()],
                    [camera.width, camera.height],
                )?;
                Some(Arc::new(color))
            }
            _ => None,
        };
        Ok(Frame { id: entry.id, timestamp: entry.timestamp, depth: Arc::new(depth), color })
    }
}

impl FrameSource for TumFolder {
    fn name(&self) -> String {
        format!("folder {}", self.path.display())
    }

    fn calibration(&self) -> &Calibration {
        &self.calibration
    }

    fn next_frame(&mut self) -> Result<Option<Frame>, CaptureError> {
        let Some(entry) = self.entries.get(self.next) else {
            return Ok(None);
        };
        self.next += 1;
        self.read(entry).map(Some)
    }

    fn frame_count(&self) -> Option<u64> {
        Some(self.entries.len() as u64)
    }
}

fn colors_of_listing(path: &Path) -> Result<Vec<Listed>, CaptureError> {
    let list = path.join("rgb.txt");
    if list.is_file() {
        listing::from_text(&list)
    } else {
        Ok(Vec::new())
    }
}

fn images_of_folders(path: &Path) -> Result<(Vec<Listed>, Vec<Listed>), CaptureError> {
    let first_of = |names: &[&str]| {
        names
            .iter()
            .map(|name| path.join(name))
            .find(|folder| folder.is_dir())
    };
    let depth = first_of(&["depth", "depth_map"]).unwrap_or_else(|| path.to_owned());
    let color = match first_of(&["rgb", "color", "color_map"]) {
        Some(folder) => listing::from_names(&folder)?,
        None => Vec::new(),
    };
    Ok((listing::from_names(&depth)?, color))
}

/// Colour without a calibration is taken as registered to depth, as in TUM's dataset, if it has depth's size.
fn usable_colors(
    color: Vec<Listed>,
    calibration: &mut Calibration,
) -> Result<Vec<Listed>, CaptureError> {
    let Some(first) = color.first() else {
        return Ok(color);
    };
    if calibration.color.is_some() {
        return Ok(color);
    }
    let image = read_color(&first.path)?;
    let depth = calibration.depth.intrinsics;
    if [image.width(), image.height()] == [depth.width, depth.height] {
        calibration.color = Some(calibration.depth);
        return Ok(color);
    }
    tracing::warn!(
        "colour is left out: {} is {}x{}, depth {}x{}, and no calibration.json says how they belong together",
        first.path.display(),
        image.width(),
        image.height(),
        depth.width,
        depth.height
    );
    Ok(Vec::new())
}

/// Frames a second by the median distance in time.
fn rate_of(images: &[Listed]) -> Option<f32> {
    let mut gaps: Vec<f64> = images
        .windows(2)
        .map(|pair| pair[1].timestamp - pair[0].timestamp)
        .collect();
    gaps.sort_by(f64::total_cmp);
    let median = *gaps.get(gaps.len() / 2)?;
    Some((1.0 / median) as f32).filter(|rate_hz| RATES_HZ.contains(rate_hz))
}

/// Gives each depth image the colour that is nearest in time.
fn join(depth: Vec<Listed>, color: &[Listed]) -> Vec<Entry> {
    let first = depth.iter().map(|image| image.number).min().unwrap_or(0);
    let entry = |image: Listed| {
        let after = color.partition_point(|other| other.timestamp < image.timestamp);
        let apart = |other: &&Listed| (other.timestamp - image.timestamp).abs();
        let candidates = color[after.saturating_sub(1)..color.len().min(after + 1)].iter();
        let nearest = candidates.min_by(|a, b| apart(a).total_cmp(&apart(b)));
        let color = nearest
            .filter(|other| apart(other) <= MAX_APART_SECS)
            .map(|other| other.path.clone());
        Entry {
            id: FrameId(image.number - first),
            timestamp: image.timestamp,
            depth: image.path,
            color,
        }
    };
    depth.into_iter().map(entry).collect()
}

fn read_color(path: &Path) -> Result<ColorImage, CaptureError> {
    let bytes = read_file(path, "the colour image")?;
    color::decode(&bytes).map_err(|reason| CaptureError::BadImage { path: path.to_owned(), reason })
}

fn check_size(path: &Path, got: [u32; 2], expected: [u32; 2]) -> Result<(), CaptureError> {
    if got == expected {
        return Ok(());
    }
    let reason =
        format!("the image is {got:?}, the folder's first and its calibration are {expected:?}");
    Err(CaptureError::BadImage { path: path.to_owned(), reason })
}
