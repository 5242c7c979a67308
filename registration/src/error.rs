//! What can go wrong with body and motion files.

use std::path::PathBuf;

#[derive(Debug, thiserror::Error)]
pub enum RegistrationError {
    #[error("{path}: {source}")]
    Io { path: PathBuf, source: std::io::Error },
}
