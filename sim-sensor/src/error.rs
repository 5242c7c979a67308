//! What can go wrong with a scenario or a data set.

use std::path::{Path, PathBuf};

use effigy_registration::RegistrationError;

#[derive(Debug, thiserror::Error)]
pub enum SimError {
    #[error("scenario: {field} is {got}, expected {expected}")]
    Scenario { field: &'static str, got: String, expected: &'static str },
    #[error("scenario: not readable as JSON of version {expected_version}: {source}")]
    Json { expected_version: u32, source: serde_json::Error },
    #[error("{path}: {problem}")]
    Dataset { path: PathBuf, problem: String },
    /// A sequence in memory, wherever it was read from.
    #[error("sequence {name}: {problem}")]
    Sequence { name: String, problem: String },
    #[error("{path}: {source}")]
    CharacterIo { path: PathBuf, source: std::io::Error },
    /// A glTF file that holds no character we can move.
    #[error("{path}: expected {expected}, found {found}")]
    Character { path: PathBuf, expected: String, found: String },
    #[error(transparent)]
    Motion(#[from] RegistrationError),
}

impl SimError {
    pub(crate) fn character(path: &Path, expected: &str, found: &str) -> Self {
        let (expected, found) = (expected.to_owned(), found.to_owned());
        Self::Character { path: path.to_path_buf(), expected, found }
    }
}
