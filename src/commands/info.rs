//! `effigy info`: what a file holds.

use std::path::Path;

use anyhow::{Context as _, bail};
use effigy_avatar::checkpoint;
use effigy_capture::{recording, source};
use effigy_registration::BodyModel;
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
        "identity": body.identity,
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
