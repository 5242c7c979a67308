//! Files that the program writes for its users: tried before the work, and with errors that say what to do.

use std::{
    fs::{self, File, OpenOptions},
    io::{self, Read as _},
    path::Path,
};

use anyhow::{Context as _, ensure};
use serde::{Serialize, de::DeserializeOwned};

/// Fails now rather than after the work; an existing file stays as it is.
pub(crate) fn check_writable(path: &Path) -> anyhow::Result<()> {
    let opened = OpenOptions::new().append(true).create(true).open(path);
    explained(opened.map(drop), path)
}

pub(crate) fn write(path: &Path, content: impl AsRef<[u8]>) -> anyhow::Result<()> {
    explained(fs::write(path, content), path)
}

/// A text file of at most so many bytes.
pub(crate) fn read_text(path: &Path, most_bytes: u64) -> anyhow::Result<String> {
    let cannot = || format!("{}: cannot read it", path.display());
    let mut text = String::new();
    let file = File::open(path).with_context(cannot)?;
    let read = file.take(most_bytes + 1).read_to_string(&mut text);
    let found = read.with_context(cannot)?;
    ensure!(
        found as u64 <= most_bytes,
        "{}: expected at most {most_bytes} bytes, found more",
        path.display()
    );
    Ok(text)
}

/// Settings from a TOML file; what it does not name keeps its default.
pub(crate) fn read_toml<T: DeserializeOwned>(path: &Path) -> anyhow::Result<T> {
    let text = fs::read_to_string(path)
        .with_context(|| format!("{}: cannot read the settings", path.display()))?;
    toml::from_str(&text).with_context(|| format!("{}: these settings do not fit", path.display()))
}

/// Pretty-printed JSON.
pub(crate) fn write_json(path: &Path, value: &impl Serialize) -> anyhow::Result<()> {
    let text = serde_json::to_string_pretty(value).context("what is reported is plain data")?;
    write(path, text + "\n")
}

fn explained(result: io::Result<()>, path: &Path) -> anyhow::Result<()> {
    result.with_context(|| {
        format!(
            "{}: cannot write there; is the folder there and writable?",
            path.display()
        )
    })
}
