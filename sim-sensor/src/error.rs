//! What can go wrong with a scenario or a data set.

use std::path::PathBuf;

use effigy_registration::RegistrationError;

#[derive(Debug, thiserror::Error)]
pub enum SimError {
    #[error("scenario: {field} is {got}, expected {expected}")]
    Scenario { field: &'static str, got: String, expected: &'static str },
    #[error("scenario: not readable as JSON of version {expected_version}: {source}")]
    Json { expected_version: u32, source: serde_json::Error },
    #[error("{path}: {problem}")]
    Dataset { path: PathBuf, problem: String },
    #[error(transparent)]
    Motion(#[from] RegistrationError),
}
