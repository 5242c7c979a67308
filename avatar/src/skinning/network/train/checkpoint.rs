//! The training's state as a file, exact to the last bit.

use std::{collections::HashMap, fs, path::Path};

use safetensors::{Dtype, SafeTensors, serialize, tensor::TensorView};

use super::{Look, SkinningTrainConfig, State};
use crate::error::AvatarError;

/// Changes when files of old would be misread.
const FORMAT: &str = "effigy-skinning-training-1";
const KINDS: [&str; 3] = ["inverse", "forward", "labels"];

/// Writes beside the file and renames, so that a crash leaves the old one.
pub(super) fn write(
    path: &Path,
    state: &State,
    config: &SkinningTrainConfig,
) -> Result<(), AvatarError> {
    let networks = &state.networks;
    let all = [&networks.inverse, &networks.forward, &networks.labels];
    let mut vectors = Vec::new();
    for (which, kind) in KINDS.into_iter().enumerate() {
        let moments = &state.moments[which];
        for (name, values) in [
            ("parameters", &all[which].parameters),
            ("mean", &moments.mean),
            ("square", &moments.square),
            ("best", &state.best[which]),
        ] {
            let bytes: Vec<u8> = values.iter().flat_map(|x| x.to_le_bytes()).collect();
            vectors.push((format!("{kind}.{name}"), bytes));
        }
    }
    let views = vectors
        .iter()
        .map(|(name, bytes)| {
            Ok((
                name.as_str(),
                TensorView::new(Dtype::F32, vec![bytes.len() / 4], bytes)?,
            ))
        })
        .collect::<Result<Vec<_>, safetensors::SafeTensorError>>()
        .map_err(AvatarError::WriteNetwork)?;
    let metadata = HashMap::from([
        ("format".to_owned(), FORMAT.to_owned()),
        ("step".to_owned(), state.step.to_string()),
        ("config".to_owned(), json(config)),
        (
            "looks".to_owned(),
            json(&state.looks.iter().map(bits).collect::<Vec<_>>()),
        ),
        ("losses".to_owned(), json(&state.losses.map(f64::to_bits))),
    ]);
    let bytes = serialize(views, Some(metadata)).map_err(AvatarError::WriteNetwork)?;
    let io = |source| AvatarError::Io { path: path.to_owned(), source };
    let partial = path.with_extension("partial");
    fs::write(&partial, bytes).map_err(io)?;
    fs::rename(&partial, path).map_err(io)
}

/// Reads what [`write`] wrote with the same configuration.
pub(super) fn read(path: &Path, config: &SkinningTrainConfig) -> Result<State, AvatarError> {
    let bytes =
        fs::read(path).map_err(|source| AvatarError::Io { path: path.to_owned(), source })?;
    let broken =
        |what: &str| AvatarError::Checkpoint { path: path.to_owned(), what: what.to_owned() };
    let (_, header) = SafeTensors::read_metadata(&bytes).map_err(AvatarError::ReadNetwork)?;
    let metadata = header.metadata().clone().unwrap_or_default();
    if metadata.get("format").map(String::as_str) != Some(FORMAT) {
        return Err(broken("it is of another kind or version"));
    }
    if metadata.get("config") != Some(&json(config)) {
        return Err(broken("it was written with another configuration"));
    }
    let mut state = State::new(config);
    let text = |key: &str| metadata.get(key).map_or("", String::as_str);
    state.step = text("step")
        .parse()
        .map_err(|_error| broken("its step is missing"))?;
    let wrong = |_error: serde_json::Error| broken("its history cannot be read");
    let looks: Vec<[u64; 8]> = serde_json::from_str(text("looks")).map_err(wrong)?;
    state.looks = looks.into_iter().map(from_bits).collect();
    let losses: [u64; 3] = serde_json::from_str(text("losses")).map_err(wrong)?;
    state.losses = losses.map(f64::from_bits);
    let file = SafeTensors::deserialize(&bytes).map_err(AvatarError::ReadNetwork)?;
    let restore = |name: String, own: &mut Vec<f32>| -> Result<(), AvatarError> {
        let tensor = file.tensor(&name).map_err(AvatarError::ReadNetwork)?;
        let values = tensor.data().as_chunks().0.iter();
        let values: Vec<f32> = values.map(|bytes| f32::from_le_bytes(*bytes)).collect();
        if values.len() != own.len() {
            return Err(broken("a vector has another length"));
        }
        *own = values;
        Ok(())
    };
    for (which, kind) in KINDS.into_iter().enumerate() {
        restore(format!("{kind}.best"), &mut state.best[which])?;
    }
    for (kind, (network, moments)) in KINDS.into_iter().zip(state.all_mut()) {
        restore(format!("{kind}.parameters"), &mut network.parameters)?;
        restore(format!("{kind}.mean"), &mut moments.mean)?;
        restore(format!("{kind}.square"), &mut moments.square)?;
    }
    Ok(state)
}

/// A look to the last bit, which decimal numbers would lose.
fn bits(look: &Look) -> [u64; 8] {
    let Look { step, losses: [a, b, c], inverse_m, forward_m, labels_m, closest_m } = *look;
    [
        f64::from(step),
        a,
        b,
        c,
        inverse_m,
        forward_m,
        labels_m,
        closest_m,
    ]
    .map(f64::to_bits)
}

fn from_bits(bits: [u64; 8]) -> Look {
    let [step, a, b, c, inverse_m, forward_m, labels_m, closest_m] = bits.map(f64::from_bits);
    Look { step: step as u32, losses: [a, b, c], inverse_m, forward_m, labels_m, closest_m }
}

fn json(what: &impl serde::Serialize) -> String {
    serde_json::to_string(what).expect("plain data serialises")
}
