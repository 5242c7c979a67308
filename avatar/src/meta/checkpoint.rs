//! The training's state as a file, exact to the last bit.

use std::{collections::HashMap, fs, path::Path};

use safetensors::{Dtype, SafeTensors, serialize, tensor::TensorView};

use super::{config::PriorConfig, joint::Joint, reptile::Reptile, task::PersonSource};
use crate::{
    error::AvatarError,
    hyper::{HyperNetwork, Precision},
};

/// A stage and the steps it has done.
pub(super) enum State {
    Reptile { step: u32, reptile: Box<Reptile> },
    Joint { step: u32, joint: Box<Joint> },
}

pub(super) fn reptile_bytes(
    step: u32,
    reptile: &Reptile,
    config: &PriorConfig,
) -> Result<Vec<u8>, AvatarError> {
    let Reptile { parameters, moments, .. } = reptile;
    let vectors = [
        ("parameters", parameters),
        ("mean", &moments.mean),
        ("square", &moments.square),
    ];
    let vectors = vectors.map(|(name, values)| (name, Dtype::F32, bytes_of(values)));
    to_bytes("reptile", step, config, &vectors)
}

pub(super) fn joint_bytes(
    step: u32,
    joint: &Joint,
    config: &PriorConfig,
) -> Result<Vec<u8>, AvatarError> {
    let mut codes = Vec::new();
    for ((code, moments), steps) in joint
        .codes
        .iter()
        .zip(&joint.code_moments)
        .zip(&joint.code_steps)
    {
        codes.extend(code.iter().chain(&moments.mean).chain(&moments.square));
        codes.push(*steps as f32);
    }
    let vectors = [
        (
            "network",
            Dtype::U8,
            joint.network.to_bytes(Precision::F32)?,
        ),
        ("optimizer", Dtype::F32, bytes_of(&joint.optimizer.state())),
        ("codes", Dtype::F32, bytes_of(&codes)),
    ];
    to_bytes("joint", step, config, &vectors)
}

/// Writes beside the file and renames, so that a crash leaves the old one.
pub(super) fn write(path: &Path, bytes: &[u8]) -> Result<(), AvatarError> {
    let io = |source| AvatarError::Io { path: path.to_owned(), source };
    let partial = path.with_extension("partial");
    fs::write(&partial, bytes).map_err(io)?;
    fs::rename(&partial, path).map_err(io)
}

pub(super) fn read(
    path: &Path,
    config: &PriorConfig,
    source: &dyn PersonSource,
) -> Result<State, AvatarError> {
    let bytes =
        fs::read(path).map_err(|source| AvatarError::Io { path: path.to_owned(), source })?;
    let broken =
        |what: &str| AvatarError::Checkpoint { path: path.to_owned(), what: what.to_owned() };
    let (_, header) = SafeTensors::read_metadata(&bytes).map_err(AvatarError::ReadNetwork)?;
    let metadata = header.metadata().clone().unwrap_or_default();
    if metadata.get("config") != Some(&config_json(config)) {
        return Err(broken("it was written with another configuration"));
    }
    let step = metadata.get("step").and_then(|step| step.parse().ok());
    let step: u32 = step.ok_or_else(|| broken("its step is missing"))?;
    let file = SafeTensors::deserialize(&bytes).map_err(AvatarError::ReadNetwork)?;
    let floats = |name: &str| -> Result<Vec<f32>, AvatarError> {
        let tensor = file.tensor(name).map_err(AvatarError::ReadNetwork)?;
        Ok(tensor
            .data()
            .as_chunks()
            .0
            .iter()
            .map(|b| f32::from_le_bytes(*b))
            .collect())
    };
    match metadata.get("stage").map(String::as_str) {
        Some("reptile") => {
            let mut reptile = Box::new(Reptile::new(config));
            let moments = &mut reptile.moments;
            let own = [
                &mut reptile.parameters,
                &mut moments.mean,
                &mut moments.square,
            ];
            for (own, name) in own.into_iter().zip(["parameters", "mean", "square"]) {
                let values = floats(name)?;
                if values.len() != own.len() {
                    return Err(broken("a vector has another length"));
                }
                *own = values;
            }
            Ok(State::Reptile { step, reptile })
        }
        Some("joint") => {
            let network = file.tensor("network").map_err(AvatarError::ReadNetwork)?;
            let network = HyperNetwork::from_bytes(network.data())?;
            let mut joint = Box::new(Joint::new(network.meta.clone(), config, source));
            joint.network = network;
            let is_whole = joint.optimizer.restore(&floats("optimizer")?)
                && restore_codes(&mut joint, &floats("codes")?);
            if is_whole {
                Ok(State::Joint { step, joint })
            } else {
                Err(broken("a vector has another length"))
            }
        }
        _ => Err(broken("its stage is unknown")),
    }
}

fn restore_codes(joint: &mut Joint, values: &[f32]) -> bool {
    let size = joint.network.code_size();
    let row = 3 * size + 1;
    if values.len() != joint.codes.len() * row {
        return false;
    }
    for (person, row) in values.chunks_exact(row).enumerate() {
        joint.codes[person].copy_from_slice(&row[..size]);
        joint.code_moments[person]
            .mean
            .copy_from_slice(&row[size..2 * size]);
        joint.code_moments[person]
            .square
            .copy_from_slice(&row[2 * size..3 * size]);
        joint.code_steps[person] = row[3 * size] as u32;
    }
    true
}

fn to_bytes(
    stage: &str,
    step: u32,
    config: &PriorConfig,
    vectors: &[(&str, Dtype, Vec<u8>)],
) -> Result<Vec<u8>, AvatarError> {
    let metadata = HashMap::from([
        ("stage".to_owned(), stage.to_owned()),
        ("step".to_owned(), step.to_string()),
        ("config".to_owned(), config_json(config)),
    ]);
    let views = vectors
        .iter()
        .map(|(name, dtype, bytes)| {
            let size = if *dtype == Dtype::U8 { 1 } else { 4 };
            Ok((
                *name,
                TensorView::new(*dtype, vec![bytes.len() / size], bytes)?,
            ))
        })
        .collect::<Result<Vec<_>, safetensors::SafeTensorError>>()
        .map_err(AvatarError::WriteNetwork)?;
    serialize(views, Some(metadata)).map_err(AvatarError::WriteNetwork)
}

fn config_json(config: &PriorConfig) -> String {
    serde_json::to_string(config).expect("plain data serialises")
}

fn bytes_of(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|x| x.to_le_bytes()).collect()
}
