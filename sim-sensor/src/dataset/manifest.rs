//! The list of a data set's files, with their checksums; opening and reading them.

use std::{
    ffi::OsStr,
    fs,
    io::Read as _,
    path::{Path, PathBuf},
};

use effigy_registration::{BodyModel, smpl::BodyIdentity};
use serde::{Deserialize, Serialize};
use sha2::{Digest as _, Sha256};

use super::{
    history::ClothFacts,
    outfit_name::OutfitName,
    packing::unpack,
    plan::{DatasetPreset, SequencePlan, Split},
    sequence::Sequence,
};
use crate::error::SimError;

/// Changes when programs of old would misread files.
pub const DATASET_SCHEMA: &str = "effigy.dataset/2";

/// Written by earlier programs, without history floors; readable.
const EARLIER_SCHEMA: &str = "effigy.dataset/1";

/// The largest file of a real data set has a few MiB.
const LARGEST_FILE_BYTES: u64 = 256 << 20;

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
    /// Of simulated clothes.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cloth: Option<ClothFacts>,
}

impl Manifest {
    /// What each person of a split does in each of their outfits, in the order of the sequences.
    pub fn wearers(&self, split: Split) -> Vec<Vec<&SequenceEntry>> {
        let mut wearers: Vec<Vec<&SequenceEntry>> = Vec::new();
        for entry in self
            .sequences
            .iter()
            .filter(|entry| entry.plan.split == split)
        {
            let who = |entry: &SequenceEntry| (entry.plan.subject, entry.plan.outfit);
            match wearers.iter_mut().find(|known| who(known[0]) == who(entry)) {
                Some(known) => known.push(entry),
                None => wearers.push(vec![entry]),
            }
        }
        wearers
    }

    /// The least mean error (`D_f`) over two visits to the same poses that a function of the pose can have on this person
    /// in this outfit: the mean over their sequences. `None` where it was not measured or nothing is simulated.
    pub fn history_floor_cm(&self, split: Split, subject: u32, outfit: OutfitName) -> Option<f32> {
        let of_wearer = self.sequences.iter().filter(|entry| {
            let plan = &entry.plan;
            plan.split == split && plan.subject == subject && plan.outfit == outfit
        });
        let floors: Vec<f32> = of_wearer
            .filter_map(|entry| entry.cloth?.history_floor_cm)
            .collect();
        (!floors.is_empty()).then(|| floors.iter().sum::<f32>() / floors.len() as f32)
    }
}

/// An open data set; sequences are read one at a time.
#[derive(Clone, Debug)]
pub struct Dataset {
    folder: PathBuf,
    manifest: Manifest,
}

impl Dataset {
    /// Whether a folder holds a complete data set, of whatever version.
    pub fn is_at(folder: &Path) -> bool {
        folder.join(MANIFEST).is_file()
    }

    /// Opens a complete data set that was made with this body.
    pub fn open(folder: &Path, body: &BodyModel) -> Result<Self, SimError> {
        let path = folder.join(MANIFEST);
        let wrong = |problem: String| SimError::Dataset { path: path.clone(), problem };
        let text = read_bounded(&path).map_err(|problem| {
            wrong(format!(
                "{problem}; a data set is complete when it has this file: make it with `effigy dataset make`"
            ))
        })?;
        let manifest: Manifest = serde_json::from_slice(&text).map_err(|error| {
            wrong(format!(
                "{error}; if an earlier version of Effigy made this folder, run `effigy dataset make` into a new one"
            ))
        })?;
        if ![DATASET_SCHEMA, EARLIER_SCHEMA].contains(&manifest.schema.as_str()) {
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
        if Path::new(&entry.file).file_name() != Some(OsStr::new(&entry.file)) {
            return Err(wrong(
                "expected the name of a file in the folder".to_owned(),
            ));
        }
        let bytes = read_bounded(&path).map_err(&wrong)?;
        let (found, expected) = (bytes.len() as u64, entry.bytes);
        if found != expected {
            return Err(wrong(format!(
                "expected {expected} bytes, found {found}; make it again"
            )));
        }
        if sha256(&bytes) != entry.sha256 {
            return Err(wrong(
                "its checksum is not the manifest's; delete it and make it again".to_owned(),
            ));
        }
        let sequence = unpack(&bytes).map_err(&wrong)?;
        if sequence.plan != entry.plan || sequence.cloth != entry.cloth {
            return Err(wrong(
                "what it says about itself is not what the manifest says; make the data set again"
                    .to_owned(),
            ));
        }
        Ok(sequence)
    }
}

/// A file's bytes, unless it is larger than any of a data set can be.
pub(super) fn read_bounded(path: &Path) -> Result<Vec<u8>, String> {
    let read = || -> std::io::Result<Vec<u8>> {
        let mut bytes = Vec::new();
        let file = fs::File::open(path)?;
        file.take(LARGEST_FILE_BYTES + 1).read_to_end(&mut bytes)?;
        Ok(bytes)
    };
    let bytes = read().map_err(|error| error.to_string())?;
    if bytes.len() as u64 > LARGEST_FILE_BYTES {
        return Err(format!(
            "expected at most {LARGEST_FILE_BYTES} bytes, found more"
        ));
    }
    Ok(bytes)
}

pub(super) fn sha256(bytes: &[u8]) -> String {
    format!("{:x}", Sha256::digest(bytes))
}
