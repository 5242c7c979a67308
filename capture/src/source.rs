//! Where frames come from.

use std::{fs::File, io::Read as _, path::Path};

use crate::{
    calibration::Calibration,
    error::CaptureError,
    frame::Frame,
    import::{pcd, still::Still, tum::TumFolder},
    recording::{MAGIC, Player},
};

/// A sensor, a recording or a simulator.
pub trait FrameSource: Send {
    /// What the source is, for people: "recording s.mcap", "simulated azure".
    fn name(&self) -> String;

    fn calibration(&self) -> &Calibration;

    /// The next frame in order; `None` at the end. Blocks while a live sensor has nothing new.
    fn next_frame(&mut self) -> Result<Option<Frame>, CaptureError>;

    /// How many frames there are in all, where that is known.
    fn frame_count(&self) -> Option<u64> {
        None
    }

    /// The player, if this is a recording: for going to other places in it.
    fn player(&mut self) -> Option<&mut Player> {
        None
    }
}

/// Opens a recording, a folder of depth images, a point cloud or a depth image: what it is shows in its first bytes.
pub fn open(path: &Path) -> Result<Box<dyn FrameSource>, CaptureError> {
    if path.is_dir() {
        return Ok(Box::new(TumFolder::open(path)?));
    }
    let start = first_bytes(path)?;
    match start.as_slice() {
        bytes if bytes == MAGIC => Ok(Box::new(Player::open(path)?)),
        [b'#', b' ', b'.', b'P', b'C', b'D', ..]
        | [b'V', b'E', b'R', b'S', b'I', b'O', b'N', ..] => Ok(Box::new(pcd::open(path)?)),
        [0x89, b'P', b'N', b'G', ..] | [b'P', b'5', ..] => {
            Ok(Box::new(Still::open_depth_image(path)?))
        }
        bytes => {
            let found = match bytes {
                [] => "nothing (the file is empty)".to_owned(),
                bytes => format!("\"{}\"", bytes.escape_ascii()),
            };
            Err(CaptureError::UnknownSource { path: path.to_owned(), found })
        }
    }
}

/// Whether a file is a recording of ours, or at least begins like one; its name does not matter.
pub fn is_recording(path: &Path) -> bool {
    path.is_file() && first_bytes(path).is_ok_and(|start| start == MAGIC)
}

/// As many as the longest magic has.
fn first_bytes(path: &Path) -> Result<Vec<u8>, CaptureError> {
    let file = File::open(path).map_err(CaptureError::io(path))?;
    let mut start = Vec::new();
    file.take(MAGIC.len() as u64)
        .read_to_end(&mut start)
        .map_err(CaptureError::io(path))?;
    Ok(start)
}
