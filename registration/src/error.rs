//! What can go wrong with body and motion files.

use std::path::PathBuf;

#[derive(Debug, thiserror::Error)]
pub enum RegistrationError {
    #[error("{path}: {source}")]
    Io { path: PathBuf, source: std::io::Error },
    /// A motion file that does not say what its format asks for; line 0 is the file as a whole.
    #[error("{path}, line {line}: expected {expected}, found {found}")]
    MotionFile { path: PathBuf, line: usize, expected: String, found: String },
}
