//! A hypernetwork as bytes: safetensors, with configuration and provenance in the metadata.

use std::{collections::HashMap, path::Path, sync::Arc};

use half::f16;
use safetensors::{Dtype, SafeTensors, serialize, tensor::TensorView};

use super::{
    config::{HeadKind, HyperConfig},
    network::{HyperNetwork, Provenance},
};
use crate::{PoseField, error::AvatarError, nn::file::read_at_most};

/// Version of the layout; a reader refuses any other.
const FORMAT: &str = "effigy-hypernetwork-1";
/// Bounds on what a file may ask us to allocate: four times the paper's sizes.
const MAX_HIDDEN: usize = 1024;
const MAX_LAYERS: usize = 16;
const MAX_PARAMETERS: usize = 400_000_000;
const MAX_FILE_BYTES: u64 = 4 * MAX_PARAMETERS as u64 + (1 << 20);

/// How numbers are stored. `phi*` and all biases stay f32 in both: they carry most of the field.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Precision {
    F32,
    /// Weights of encoder and heads in f16.
    F16,
}

impl HyperNetwork {
    /// The network as a safetensors file.
    pub fn to_bytes(&self, precision: Precision) -> Result<Vec<u8>, AvatarError> {
        let tensors = self.tensors();
        let stored: Vec<_> = tensors
            .iter()
            .map(|tensor| {
                let is_short = precision == Precision::F16 && tensor.name.ends_with(".weight");
                let (bytes, dtype): (Vec<u8>, _) = if is_short {
                    let short = |x: &f32| f16::from_f32(*x).to_le_bytes();
                    (tensor.values.iter().flat_map(short).collect(), Dtype::F16)
                } else {
                    (
                        tensor.values.iter().flat_map(|x| x.to_le_bytes()).collect(),
                        Dtype::F32,
                    )
                };
                (tensor, bytes, dtype)
            })
            .collect();
        let views = stored
            .iter()
            .map(|(tensor, bytes, dtype)| {
                let view = TensorView::new(*dtype, tensor.shape.clone(), bytes)?;
                Ok((tensor.name.as_str(), view))
            })
            .collect::<Result<Vec<_>, safetensors::SafeTensorError>>()
            .map_err(AvatarError::WriteNetwork)?;
        let json = |what: Result<String, serde_json::Error>| what.expect("plain data serialises");
        let metadata = HashMap::from([
            ("format".to_owned(), FORMAT.to_owned()),
            (
                "config".to_owned(),
                json(serde_json::to_string(&self.config)),
            ),
            (
                "provenance".to_owned(),
                json(serde_json::to_string(&self.provenance)),
            ),
        ]);
        serialize(views, Some(metadata)).map_err(AvatarError::WriteNetwork)
    }

    /// All parameters in a fixed order, f32, little-endian: the same for the same network each time, which a file is not
    /// (its metadata come in any order).
    pub fn parameter_bytes(&self) -> Vec<u8> {
        let tensors = self.tensors();
        let values = tensors.iter().flat_map(|tensor| tensor.values);
        values.flat_map(|x| x.to_le_bytes()).collect()
    }

    /// Reads a file; see [`Self::from_bytes`].
    pub fn load(path: &Path) -> Result<Self, AvatarError> {
        let bytes = read_at_most(path, MAX_FILE_BYTES)?;
        Self::from_bytes(&bytes).map_err(AvatarError::in_file(path))
    }

    /// Reads what [`Self::to_bytes`] wrote; refuses unknown formats, wrong shapes and numbers that are not
    /// finite.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, AvatarError> {
        let (_, header) = SafeTensors::read_metadata(bytes).map_err(AvatarError::ReadNetwork)?;
        let metadata = header.metadata().clone().unwrap_or_default();
        let format = metadata.get("format").cloned().unwrap_or_default();
        if format != FORMAT {
            return Err(AvatarError::NetworkFormat { expected: FORMAT, found: format });
        }
        let config: HyperConfig = parse(&metadata, "config")?;
        check_bounds(&config)?;
        let mut network = Self::zeros(config);
        network.provenance = parse::<Provenance>(&metadata, "provenance")?;
        let file = SafeTensors::deserialize(bytes).map_err(AvatarError::ReadNetwork)?;
        let wanted: Vec<_> = network
            .tensors()
            .into_iter()
            .map(|tensor| (tensor.name, tensor.shape))
            .collect();
        for ((name, shape), values) in wanted.into_iter().zip(network.values_mut()) {
            let tensor = file.tensor(&name).map_err(AvatarError::ReadNetwork)?;
            if tensor.shape() != shape {
                let found = tensor.shape().to_vec();
                return Err(AvatarError::TensorShape { name, expected: shape, found });
            }
            *values = numbers(&tensor, &name)?;
        }
        Ok(network)
    }
}

/// Reads a field that an avatar file holds.
pub fn decode_field(kind: &str, bytes: &[u8]) -> Result<Arc<dyn PoseField>, AvatarError> {
    if kind != HyperNetwork::KIND {
        let expected = HyperNetwork::KIND.to_owned();
        return Err(AvatarError::UnknownField { found: kind.to_owned(), expected });
    }
    Ok(Arc::new(HyperNetwork::from_bytes(bytes)?))
}

fn parse<T: serde::de::DeserializeOwned>(
    metadata: &HashMap<String, String>,
    key: &'static str,
) -> Result<T, AvatarError> {
    let text = metadata.get(key).map_or("null", String::as_str);
    serde_json::from_str(text).map_err(|source| AvatarError::NetworkMetadata { key, source })
}

fn check_bounds(config: &HyperConfig) -> Result<(), AvatarError> {
    let field = config.field;
    let rank = match config.heads {
        HeadKind::Full => 1,
        HeadKind::LowRank(rank) => rank,
    };
    let is_sane = (1..=MAX_HIDDEN).contains(&field.hidden)
        && (2..=MAX_LAYERS).contains(&field.layers)
        && (1..=MAX_HIDDEN).contains(&rank)
        && config.person <= MAX_HIDDEN
        && config.head_parameter_count() <= MAX_PARAMETERS;
    if is_sane {
        Ok(())
    } else {
        Err(AvatarError::NetworkTooLarge { config: *config })
    }
}

fn numbers(tensor: &TensorView<'_>, name: &str) -> Result<Vec<f32>, AvatarError> {
    let values: Vec<f32> = match tensor.dtype() {
        Dtype::F32 => tensor
            .data()
            .as_chunks()
            .0
            .iter()
            .map(|bytes| f32::from_le_bytes(*bytes))
            .collect(),
        Dtype::F16 => {
            let short = |bytes: &[u8; 2]| f16::from_le_bytes(*bytes).to_f32();
            tensor.data().as_chunks().0.iter().map(short).collect()
        }
        other => {
            let found = format!("{other:?}");
            return Err(AvatarError::TensorType { name: name.to_owned(), found });
        }
    };
    match values.iter().position(|x| !x.is_finite()) {
        Some(index) => Err(AvatarError::TensorNotFinite { name: name.to_owned(), index }),
        None => Ok(values),
    }
}
