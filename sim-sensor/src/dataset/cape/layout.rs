//! Where CAPE's files are.

use std::{
    fs,
    path::{Path, PathBuf},
};

use super::{Gender, genders};
use crate::{dataset::manifest::read_bounded, error::SimError};

/// One recorded sequence.
#[derive(Clone, Debug)]
pub(super) struct Recorded {
    pub(super) subject: String,
    pub(super) outfit: String,
    pub(super) action: String,
    /// An archive a frame, in order.
    pub(super) frames: Vec<PathBuf>,
}

/// An unpacked `cape_release`.
pub(super) struct Layout(PathBuf);

impl Layout {
    /// The folder itself, or the `cape_release` in it.
    pub(super) fn find(folder: &Path) -> Result<Self, SimError> {
        let candidates = [folder.to_owned(), folder.join("cape_release")];
        let found = candidates
            .into_iter()
            .find(|c| c.join("sequences").is_dir());
        found.map(Self).ok_or_else(|| SimError::Dataset {
            path: folder.to_owned(),
            problem: "expected CAPE's folders `sequences`, `minimal_body_shape` and `misc`, found no `sequences`; name \
                      the folder `cape_release`"
                .to_owned(),
        })
    }

    /// All sequences, by subject and name.
    pub(super) fn sequences(&self) -> Result<Vec<Recorded>, SimError> {
        let mut sequences = Vec::new();
        for subject in folders(&self.0.join("sequences"))? {
            for folder in folders(&subject)? {
                let (who, name) = (file_name(&subject), file_name(&folder));
                let Some((outfit, action)) = name.split_once('_') else {
                    continue;
                };
                let frames = entries(&folder)?.into_iter();
                let is_frame = |path: &PathBuf| path.extension().is_some_and(|end| end == "npz");
                sequences.push(Recorded {
                    subject: who,
                    outfit: outfit.to_owned(),
                    action: action.to_owned(),
                    frames: frames.filter(is_frame).collect(),
                });
            }
        }
        Ok(sequences)
    }

    pub(super) fn minimal_body(&self, subject: &str) -> PathBuf {
        let file = format!("{subject}_minimal.npy");
        let folder = self.0.join("minimal_body_shape");
        let beside = folder.join(&file);
        if beside.is_file() {
            beside
        } else {
            folder.join(subject).join(file)
        }
    }

    /// Whether somebody is of a gender, by the release's own list.
    pub(super) fn is_of(&self, subject: &str, gender: Gender) -> Result<bool, SimError> {
        let path = self.0.join("misc").join("subj_genders.pkl");
        let wrong = |problem: String| SimError::Dataset { path: path.clone(), problem };
        let bytes = read_bounded(&path)
            .map_err(|problem| wrong(format!("{problem}; it is needed to tell `--gender`")))?;
        let genders = genders::parse(&bytes).map_err(|found| {
            wrong(format!(
                "expected a pickled dictionary of genders, found {found}"
            ))
        })?;
        let listed = genders.get(subject).map(String::as_str);
        Ok(listed == Some(gender.name()))
    }
}

/// The sub-folders of a folder, sorted.
fn folders(folder: &Path) -> Result<Vec<PathBuf>, SimError> {
    let all = entries(folder)?;
    Ok(all.into_iter().filter(|path| path.is_dir()).collect())
}

fn entries(folder: &Path) -> Result<Vec<PathBuf>, SimError> {
    let wrong = |error: std::io::Error| SimError::Dataset {
        path: folder.to_owned(),
        problem: format!("{error}; expected a readable folder"),
    };
    let mut paths = Vec::new();
    for entry in fs::read_dir(folder).map_err(wrong)? {
        paths.push(entry.map_err(wrong)?.path());
    }
    paths.sort_unstable();
    Ok(paths)
}

fn file_name(path: &Path) -> String {
    path.file_name()
        .unwrap_or_default()
        .to_string_lossy()
        .into_owned()
}
