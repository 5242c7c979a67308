//! `effigy info`: what a file holds.

use std::path::Path;

use anyhow::{Context as _, bail};
use effigy_avatar::{
    AvatarError, checkpoint,
    hyper::{HyperNetwork, Provenance},
    skinning::SkinningNetworks,
};
use effigy_capture::{recording, source};
use effigy_registration::{BodyModel, smpl::builtin};
use effigy_sim_sensor::dataset::{Dataset, Split};
use serde_json::{Value, json};

use crate::{cli::InfoArgs, files, say::say};

pub(crate) fn run(args: &InfoArgs) -> anyhow::Result<()> {
    let facts = facts(&args.input)?;
    let text = serde_json::to_string_pretty(&facts).context("facts are plain data")?;
    say!("{text}");
    if let Some(path) = &args.json {
        files::write(path, text + "\n")?;
    }
    Ok(())
}

fn facts(path: &Path) -> anyhow::Result<Value> {
    let ending = path
        .extension()
        .and_then(|ending| ending.to_str())
        .unwrap_or_default();
    match ending {
        _ if source::is_recording(path) => Ok(serde_json::to_value(recording::info(path)?)?),
        "effigy" => avatar_facts(path),
        "npz" => body_facts(path),
        "safetensors" => network_facts(path),
        _ if Dataset::is_at(path) => dataset_facts(path),
        _ if path.exists() => source_facts(path),
        _ => bail!("{}: no such file or folder", path.display()),
    }
}

fn avatar_facts(path: &Path) -> anyhow::Result<Value> {
    let header = checkpoint::read_header(path)?;
    Ok(serde_json::to_value(header)?)
}

fn body_facts(path: &Path) -> anyhow::Result<Value> {
    let body = BodyModel::load(path)?;
    Ok(json!({
        "kind": "body model",
        "vertices": body.vertex_count(),
        "triangles": body.triangles.len(),
        "shape_parameters": body.shape_dirs.len(),
        "identity": body.identity.to_string(),
    }))
}

/// Of a prior, or of skinning networks.
fn network_facts(path: &Path) -> anyhow::Result<Value> {
    let prior = match HyperNetwork::load(path) {
        // Another format is another kind of network.
        Err(AvatarError::InFile { source, .. })
            if matches!(*source, AvatarError::NetworkFormat { .. }) =>
        {
            let networks = SkinningNetworks::load(path, builtin::body().identity)?;
            return Ok(json!({
                "kind": "skinning networks",
                "made": made(&networks.provenance),
            }));
        }
        prior => prior?,
    };
    Ok(json!({
        "kind": "prior",
        "config": prior.config(),
        "parameters": prior.parameter_count(),
        "made": made(&prior.provenance),
    }))
}

fn made(Provenance { body, training, is_placeholder }: &Provenance) -> Value {
    json!({
        "body": body.map(|identity| identity.to_string()),
        "training": training,
        "is_placeholder": is_placeholder,
    })
}

fn dataset_facts(path: &Path) -> anyhow::Result<Value> {
    let dataset = Dataset::open(path, &builtin::body())?;
    let manifest = dataset.manifest();
    let wearers = |split| manifest.wearers(split).len();
    Ok(json!({
        "kind": "data set",
        "schema": manifest.schema,
        "preset": manifest.preset,
        "seed": manifest.seed,
        "sequences": manifest.sequences.len(),
        "frames": manifest.frames,
        "bytes": manifest.bytes,
        "people_in_outfits_to_learn_from": wearers(Split::Train),
        "people_in_outfits_to_test_on": wearers(Split::Test),
    }))
}

fn source_facts(path: &Path) -> anyhow::Result<Value> {
    let source = source::open(path)?;
    Ok(json!({
        "kind": source.name(),
        "frames": source.frame_count(),
        "calibration": source.calibration(),
    }))
}
