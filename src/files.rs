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

/// The whole file or none of it: what was there stays until all of the new one is on the disk.
pub(crate) fn write(path: &Path, content: impl AsRef<[u8]>) -> anyhow::Result<()> {
    // A pipe or a device cannot be replaced, only written to.
    let is_special = fs::metadata(path).is_ok_and(|found| !found.is_file());
    if is_special {
        return explained(fs::write(path, content), path);
    }
    // A link stays, what it leads to is replaced.
    let target = fs::canonicalize(path).unwrap_or_else(|_missing| path.to_owned());
    let mut part = target.clone().into_os_string();
    part.push(".part");
    let written = fs::write(&part, content).and_then(|()| fs::rename(&part, &target));
    if written.is_err() {
        fs::remove_file(&part).ok();
    }
    explained(written, path)
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_replaced_as_a_whole() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("rows.json");
        write(&path, "old").unwrap();
        write(&path, "new").unwrap();
        assert_eq!(fs::read_to_string(&path).unwrap(), "new");
        assert_eq!(
            fs::read_dir(folder.path()).unwrap().count(),
            1,
            "nothing else is left"
        );
        // Where no file can be, what is in the way stays.
        let in_the_way = folder.path().join("folder");
        fs::create_dir(&in_the_way).unwrap();
        let message = write(&in_the_way, "new").unwrap_err().to_string();
        assert!(message.contains("folder: cannot write there"), "{message}");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 2);
    }
}
