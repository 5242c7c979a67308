//! The list of a data set's files, with their checksums; opening and reading them.

use std::{
    fs,
    path::{Path, PathBuf},
};

use effigy_registration::{BodyModel, smpl::BodyIdentity};
use serde::{Deserialize, Serialize};
use sha2::{Digest as _, Sha256};

use super::{
    archive::unpack,
    plan::{DatasetPreset, SequencePlan},
    sequence::Sequence,
};
use crate::error::SimError;

/// Changes when files of old would be misread.
pub const DATASET_SCHEMA: &str = "effigy.dataset/1";

pub(super) const MANIFEST: &str = "manifest.json";

/// What is in a data set.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Manifest {
    pub schema: String,
    pub preset: DatasetPreset,
    pub seed: u64,
    /// The body model that all people share.
    pub body: BodyIdentity,
    pub frames: u64,
    pub bytes: u64,
    pub sequences: Vec<SequenceEntry>,
}

/// One file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SequenceEntry {
    pub file: String,
    pub bytes: u64,
    /// In hexadecimal.
    pub sha256: String,
    pub plan: SequencePlan,
}

/// An open data set; sequences are read one at a time.
#[derive(Clone, Debug)]
pub struct Dataset {
    folder: PathBuf,
    manifest: Manifest,
}

impl Dataset {
    /// Opens a complete data set that was made with this body.
    pub fn open(folder: &Path, body: &BodyModel) -> Result<Self, SimError> {
        let path = folder.join(MANIFEST);
        let wrong = |problem: String| SimError::Dataset { path: path.clone(), problem };
        let text = fs::read_to_string(&path).map_err(|error| {
            wrong(format!(
                "{error}; a data set is complete when it has this file: make it with `effigy dataset make`"
            ))
        })?;
        let manifest: Manifest =
            serde_json::from_str(&text).map_err(|error| wrong(error.to_string()))?;
        if manifest.schema != DATASET_SCHEMA {
            let found = &manifest.schema;
            return Err(wrong(format!(
                "expected schema {DATASET_SCHEMA}, found {found}"
            )));
        }
        if manifest.body != body.identity {
            return Err(wrong(
                "its people were made on another body model; make it again".to_owned(),
            ));
        }
        Ok(Self { folder: folder.to_owned(), manifest })
    }

    pub fn manifest(&self) -> &Manifest {
        &self.manifest
    }

    /// Reads one sequence and checks that it is what was made.
    pub fn load(&self, entry: &SequenceEntry) -> Result<Sequence, SimError> {
        let path = self.folder.join(&entry.file);
        let wrong = |problem: String| SimError::Dataset { path: path.clone(), problem };
        let found = fs::metadata(&path)
            .map_err(|error| wrong(error.to_string()))?
            .len();
        if found != entry.bytes {
            let expected = entry.bytes;
            return Err(wrong(format!(
                "expected {expected} bytes, found {found}; make it again"
            )));
        }
        let bytes = fs::read(&path).map_err(|error| wrong(error.to_string()))?;
        if sha256(&bytes) != entry.sha256 {
            return Err(wrong(
                "its checksum is not the manifest's; delete it and make it again".to_owned(),
            ));
        }
        unpack(&bytes).map_err(wrong)
    }
}

pub(super) fn sha256(bytes: &[u8]) -> String {
    format!("{:x}", Sha256::digest(bytes))
}
