//! Images to bytes and back. Reasons come back as text; the caller knows the file and place.

pub(crate) mod color;
pub(crate) mod depth_png;
pub(crate) mod pgm;

/// The largest image that is decoded: 16 Mpx, above every depth camera's colour stream (4096x3072), so that a
/// forged header cannot ask for more than 100 MB.
pub(crate) const MAX_PIXELS: u64 = 16 * 1024 * 1024;

/// Refuses sizes that no camera has, before anything is allocated.
pub(crate) fn check_size(width: u32, height: u32) -> Result<(), String> {
    if width == 0 || height == 0 {
        return Err(format!("the image is empty ({width}x{height})"));
    }
    if u64::from(width) * u64::from(height) > MAX_PIXELS {
        return Err(format!(
            "the image is {width}x{height}, more than the {MAX_PIXELS} pixels of any depth camera"
        ));
    }
    Ok(())
}
