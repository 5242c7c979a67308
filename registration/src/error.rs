//! What can go wrong with body and motion files, and with surfaces handed in.

use std::path::PathBuf;

#[derive(Debug, thiserror::Error)]
pub enum RegistrationError {
    #[error("{path}: {source}")]
    Io { path: PathBuf, source: std::io::Error },
    /// A motion file that does not say what its format asks for; line 0 is the file as a whole.
    #[error("{path}{}: expected {expected}, found {found}", at_line(*line))]
    MotionFile { path: PathBuf, line: usize, expected: String, found: String },
    /// A body file that is no zip archive of `NumPy` arrays, or a damaged one.
    #[error(
        "{path}: not a readable .npz body file: {problem}; official .pkl files must be converted first, \
         with numpy.savez in the Python that loads them"
    )]
    BodyArchive { path: PathBuf, problem: String },
    #[error(
        "{path}: expected an array {array:?}, found only {found:?}; a body file needs all of SMPL's arrays"
    )]
    BodyArrayMissing { path: PathBuf, array: &'static str, found: Vec<String> },
    #[error(
        "{path}, array {array:?}: expected {expected}, found {found}; is this an SMPL body (24 joints), not \
         SMPL-H or SMPL-X?"
    )]
    BodyArray { path: PathBuf, array: &'static str, expected: String, found: String },
    #[error(
        "a surface to follow has {got} offsets, the body model {expected} vertices; was it made for another body?"
    )]
    SurfaceMismatch { got: usize, expected: usize },
}

/// Where in a text file, for people; nothing for the file as a whole.
fn at_line(line: usize) -> String {
    if line == 0 {
        String::new()
    } else {
        format!(", line {line}")
    }
}
