//! Files of networks, read within bounds.

use std::{fs::File, io::Read as _, path::Path};

use crate::error::AvatarError;

/// A file's bytes, of a longer one the first so many: its reader finds that the rest is missing.
pub(crate) fn read_at_most(path: &Path, most_bytes: u64) -> Result<Vec<u8>, AvatarError> {
    let io = |source| AvatarError::Io { path: path.to_owned(), source };
    let file = File::open(path).map_err(io)?;
    let mut bytes = Vec::new();
    let read = file.take(most_bytes).read_to_end(&mut bytes);
    read.map(|_| bytes).map_err(io)
}
