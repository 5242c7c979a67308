//! What can go wrong with avatars and their files.

use std::path::PathBuf;

#[derive(Debug, thiserror::Error)]
pub enum AvatarError {
    #[error("{path}: {source}")]
    Io { path: PathBuf, source: std::io::Error },
    #[error(
        "{path}: not an avatar file (it starts with {found:02x?}, an avatar with \"EFFIGYAV\"); \
         give a file written by this program, usually named *.effigy"
    )]
    NotAnAvatar { path: PathBuf, found: Vec<u8> },
    #[error(
        "{path}: avatar format {found}, this program reads format {expected}; \
         write it again with the program that made it, or update this one"
    )]
    UnknownVersion { path: PathBuf, found: u32, expected: u32 },
    #[error(
        "{path}: avatar file is broken at byte {offset}: {what}; copy it again or make the avatar anew"
    )]
    Broken { path: PathBuf, offset: u64, what: String },
    #[error(
        "{path}: the avatar was made with body {found}, this run uses body {expected}; \
         use the body file it was made with"
    )]
    OtherBody { path: PathBuf, found: String, expected: String },
    #[error("a field of kind {found:?} cannot be read back here, only {expected:?}")]
    UnknownField { found: String, expected: String },
    #[error("the field's parameters cannot be read: {0}")]
    FieldParameters(String),
    #[error(
        "the field has no surface in the unit box at resolution {resolution}: \
         it has not learned a body; fine-tune longer or start from the shipped prior"
    )]
    NoSurface { resolution: usize },
    #[error("the body model has no vertices, so no avatar can be built on it")]
    EmptyBody,
    #[error("exporting glTF: {0}")]
    Export(String),
}
