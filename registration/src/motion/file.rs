//! Motion files of every kind, by their extension.

use std::{fs, path::Path};

use super::{Motion, RestBody, smpl_file::SmplFile};
use crate::error::RegistrationError;

/// The largest file accepted; twenty minutes of a full skeleton at 120 Hz take half of it.
pub const MAX_BYTES: u64 = 256 << 20;
pub const MAX_FRAMES: usize = 500_000;

/// Reads a motion file for the body that will perform it: metres, y up, feet on the floor.
///
/// `.bvh`; `.amc` with the one `.asf` of its subject beside it (`11_01.amc` goes with `11.asf`); `.npz` with SMPL
/// parameters (`poses`, and perhaps `trans` and a frame rate); `.csv` with 72 axis-angle columns.
pub fn open(path: &Path, rest: &RestBody) -> Result<Motion, RegistrationError> {
    let extension = path
        .extension()
        .map(|extension| extension.to_string_lossy().to_ascii_lowercase())
        .unwrap_or_default();
    match extension.as_str() {
        "bvh" => Motion::from_bvh(path, rest),
        "amc" => Motion::from_amc(path, rest),
        "npz" | "csv" => Ok(SmplFile::read(path)?.onto(rest)),
        _ => Err(RegistrationError::MotionFile {
            path: path.to_path_buf(),
            line: 0,
            expected: "a motion file: .bvh, .amc (with its .asf), .npz or .csv".to_owned(),
            found: format!("the extension {extension:?}"),
        }),
    }
}

/// The text of a file that is small enough; bytes that are no text become marks that no parser accepts.
pub(super) fn read_text(path: &Path) -> Result<String, RegistrationError> {
    let io = |source| RegistrationError::Io { path: path.to_path_buf(), source };
    let bytes = fs::metadata(path).map_err(io)?.len();
    if bytes > MAX_BYTES {
        return Err(RegistrationError::MotionFile {
            path: path.to_path_buf(),
            line: 0,
            expected: format!("at most {MAX_BYTES} bytes; cut the clip"),
            found: format!("{bytes} bytes"),
        });
    }
    Ok(String::from_utf8_lossy(&fs::read(path).map_err(io)?).into_owned())
}
