//! The training's state as a file, exact to the last bit.

use std::{
    collections::{BTreeMap, HashMap},
    fs,
    path::{Path, PathBuf},
};

use safetensors::{Dtype, SafeTensors, serialize, tensor::TensorView};

use super::{
    config::PriorConfig,
    train::{Best, Learner, Stage},
};
use crate::{
    error::AvatarError,
    hyper::{HyperNetwork, Precision},
};

/// Named parts of a stage's state.
pub(super) type Vectors = BTreeMap<&'static str, Vec<u8>>;

/// Where the best network so far is kept.
const BEST: &str = "best";

/// Every name that a stage may use.
const NAMES: [&str; 7] = [
    "parameters",
    "mean",
    "square",
    "network",
    "optimizer",
    "codes",
    "start",
];

/// A stage, the steps it has done, and its state.
#[derive(Clone)]
pub(super) struct Checkpoint {
    path: PathBuf,
    pub(super) stage: Stage,
    pub(super) step: u32,
    pub(super) best: Best,
    pub(super) vectors: Vectors,
}

impl Checkpoint {
    pub(super) fn broken(&self, what: &str) -> AvatarError {
        broken(&self.path, what)
    }

    pub(super) fn network(&self, name: &str) -> Result<HyperNetwork, AvatarError> {
        let bytes = self.vectors.get(name);
        HyperNetwork::from_bytes(bytes.ok_or_else(|| self.broken("a network is missing"))?)
    }
}

/// Writes beside the file and renames, so that a crash leaves the old one.
pub(super) fn write<L: Learner>(
    path: &Path,
    stage: Stage,
    step: u32,
    best: &Best,
    learner: &L,
    config: &PriorConfig,
) -> Result<(), AvatarError> {
    let mut vectors = learner.vectors()?;
    if let Some(network) = &best.network {
        vectors.insert(BEST, network.to_bytes(Precision::F32)?);
    }
    let metadata = HashMap::from([
        ("stage".to_owned(), json(&stage)),
        ("step".to_owned(), step.to_string()),
        ("config".to_owned(), json(config)),
        // A float's shortest text brings back its bits.
        ("best".to_owned(), json(&(best.held_out_mm, best.stale))),
    ]);
    let views = vectors
        .iter()
        .map(|(name, bytes)| Ok((*name, TensorView::new(Dtype::U8, vec![bytes.len()], bytes)?)))
        .collect::<Result<Vec<_>, safetensors::SafeTensorError>>()
        .map_err(AvatarError::WriteNetwork)?;
    let bytes = serialize(views, Some(metadata)).map_err(AvatarError::WriteNetwork)?;
    let io = |source| AvatarError::Io { path: path.to_owned(), source };
    let partial = path.with_extension("partial");
    fs::write(&partial, bytes).map_err(io)?;
    fs::rename(&partial, path).map_err(io)
}

pub(super) fn read(path: &Path, config: &PriorConfig) -> Result<Checkpoint, AvatarError> {
    let bytes =
        fs::read(path).map_err(|source| AvatarError::Io { path: path.to_owned(), source })?;
    let (_, header) = SafeTensors::read_metadata(&bytes).map_err(AvatarError::ReadNetwork)?;
    let metadata = header.metadata().clone().unwrap_or_default();
    if metadata.get("config") != Some(&json(config)) {
        return Err(broken(path, "it was written with another configuration"));
    }
    let text = |key: &str| {
        metadata
            .get(key)
            .ok_or_else(|| broken(path, &format!("its {key} is missing")))
    };
    let unclear = |_: serde_json::Error| broken(path, "its description cannot be read");
    let stage = serde_json::from_str(text("stage")?).map_err(unclear)?;
    let step = serde_json::from_str(text("step")?).map_err(unclear)?;
    let (held_out_mm, stale) = serde_json::from_str(text("best")?).map_err(unclear)?;
    let file = SafeTensors::deserialize(&bytes).map_err(AvatarError::ReadNetwork)?;
    let vectors = NAMES
        .into_iter()
        .filter_map(|name| Some((name, file.tensor(name).ok()?.data().to_vec())))
        .collect();
    let network = match file.tensor(BEST) {
        Ok(best) => Some(HyperNetwork::from_bytes(best.data())?),
        Err(_) => None,
    };
    let best = Best { held_out_mm, network, stale };
    Ok(Checkpoint { path: path.to_owned(), stage, step, best, vectors })
}

pub(super) fn bytes_of(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|x| x.to_le_bytes()).collect()
}

/// A named vector of numbers; empty if it is not there.
pub(super) fn floats(vectors: &Vectors, name: &str) -> Vec<f32> {
    let bytes = vectors.get(name).map_or(&[][..], Vec::as_slice);
    bytes
        .as_chunks()
        .0
        .iter()
        .map(|b| f32::from_le_bytes(*b))
        .collect()
}

fn broken(path: &Path, what: &str) -> AvatarError {
    AvatarError::Checkpoint { path: path.to_owned(), what: what.to_owned() }
}

fn json(value: &impl serde::Serialize) -> String {
    serde_json::to_string(value).expect("plain data serialises")
}
