//! Other people's data as frame sources: folders of images, point clouds, single depth images.

mod intrinsics;
mod listing;
pub mod pcd;
pub mod still;
pub mod tum;

use std::{fs, path::Path};

use crate::{codec, error::CaptureError, image::DepthImage};

/// An image or listing above this is none: a 16-megapixel RGB image, uncompressed, has 48 MB.
const MAX_FILE_BYTES: u64 = 256 * 1024 * 1024;

/// Reads a whole file of a sane size.
fn read_file(path: &Path, what: &'static str) -> Result<Vec<u8>, CaptureError> {
    let got = fs::metadata(path).map_err(CaptureError::io(path))?.len();
    if got > MAX_FILE_BYTES {
        let why = "no image or listing is that large";
        return Err(CaptureError::TooLarge {
            path: path.to_owned(),
            what,
            got,
            limit: MAX_FILE_BYTES,
            why,
        });
    }
    fs::read(path).map_err(CaptureError::io(path))
}

/// A depth image in either of the two formats that folders hold.
fn read_depth(path: &Path) -> Result<DepthImage, CaptureError> {
    let bytes = read_file(path, "the depth image")?;
    let depth = match bytes.as_slice() {
        [b'P', b'5', ..] => codec::pgm::decode(&bytes),
        _ => codec::depth_png::decode(&bytes),
    };
    depth.map_err(|reason| CaptureError::BadImage { path: path.to_owned(), reason })
}
