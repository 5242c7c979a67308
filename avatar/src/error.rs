//! What can go wrong with avatars and their files.

use std::path::{Path, PathBuf};

use crate::{
    canonicalise::CanonicaliseCounts, hyper::HyperConfig, sdf::loss::LossTerms,
    skinning::network::NetworkConfig,
};

#[derive(Debug, thiserror::Error)]
pub enum AvatarError {
    #[error("{path}: {source}")]
    Io { path: PathBuf, source: std::io::Error },
    #[error("{path}: {source}")]
    InFile { path: PathBuf, source: Box<Self> },
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
    #[error(
        "the field has no surface in the unit box at resolution {resolution}: \
         it has not learned a body; fine-tune longer or start from the shipped prior"
    )]
    NoSurface { resolution: usize },
    #[error("the body model has no vertices, so no avatar can be built on it")]
    EmptyBody,
    #[error("exporting glTF: {0}")]
    Export(String),
    #[error("cannot start {count} training threads: {source}; ask for fewer")]
    Threads { count: usize, source: rayon::ThreadPoolBuildError },
    #[error("cannot write the network: {0}")]
    WriteNetwork(safetensors::SafeTensorError),
    #[error("network file is broken: {0}; copy or train it again")]
    ReadNetwork(safetensors::SafeTensorError),
    #[error("network file has format {found:?}, expected {expected:?}; it is of another version")]
    NetworkFormat { expected: &'static str, found: String },
    #[error("network file: metadata {key:?} cannot be read: {source}")]
    NetworkMetadata { key: &'static str, source: serde_json::Error },
    #[error("network file asks for {config:?}, which is beyond what we load")]
    NetworkTooLarge { config: HyperConfig },
    #[error("network file: tensor {name:?} has shape {found:?}, expected {expected:?}")]
    TensorShape { name: String, expected: Vec<usize>, found: Vec<usize> },
    #[error("network file: tensor {name:?} holds {found} numbers, expected F32 or F16")]
    TensorType { name: String, found: String },
    #[error("network file: tensor {name:?}, element {index} is not a finite number")]
    TensorNotFinite { name: String, index: usize },
    #[error("{path}: checkpoint cannot be used: {what}; delete it to start anew")]
    Checkpoint { path: PathBuf, what: String },
    #[error("fine-tuning needs at least one keyframe, got none")]
    NoKeyframes,
    #[error(
        "keyframe {keyframe} has {points} points, {normals} normals and {weights} weights; \
         expected one of each a point"
    )]
    SampleCounts { keyframe: usize, points: usize, normals: usize, weights: usize },
    #[error(
        "keyframe {keyframe}: none of its {points} points has a say; choose a frame with a better fit"
    )]
    EmptyKeyframe { keyframe: usize, points: usize },
    #[error(
        "keyframe {keyframe}: none of its {} points can be learned from: {} are too far from the body, {} are where a \
         hand is near something else, {} do not come back by skinning and {} are outside the box; choose a frame with \
         a better fit",
        counts.observed, counts.far_from_body, counts.in_contact, counts.not_returned, counts.outside_box
    )]
    NothingCanonical { keyframe: usize, counts: CanonicaliseCounts },
    #[error("keyframe {keyframe} holds numbers that are not finite")]
    KeyframeNotFinite { keyframe: usize },
    #[error("the loss is not finite at step {step} ({terms:?}); lower the rates")]
    LossNotFinite { step: u32, terms: LossTerms },
    #[error(
        "the losses of the skinning networks are not finite at step {step} ({losses:?}); \
         go on from the checkpoint with a lower rate"
    )]
    SkinningLossNotFinite { step: u32, losses: [f64; 3] },
    #[error(
        "{path}: the skinning networks were trained with body {found}, this run uses body {expected}; \
         choose the closest body point instead, or train networks with this body"
    )]
    SkinningOtherBody { path: PathBuf, found: String, expected: String },
    #[error("skinning network file asks for {config:?}, which is beyond what we load")]
    SkinningTooLarge { config: NetworkConfig },
    #[error(
        "skinning network file holds {config:?}, which sees or says something else than this program's networks; \
         train them again with this program"
    )]
    SkinningUnknown { config: NetworkConfig },
}

impl AvatarError {
    /// For `map_err`: names the file of an error that does not.
    pub(crate) fn in_file(path: &Path) -> impl FnOnce(Self) -> Self + '_ {
        move |source| Self::InFile { path: path.to_owned(), source: Box::new(source) }
    }
}
