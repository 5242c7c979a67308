//! Making a data set: sequences in parallel, each file whole or not there, so that an interrupted run goes on.

use std::{
    fs,
    path::Path,
    sync::{
        Arc,
        atomic::{AtomicU64, Ordering},
    },
};

use effigy_registration::BodyModel;
use rayon::prelude::*;

use super::{
    archive::{pack, unpack},
    manifest::{DATASET_SCHEMA, MANIFEST, Manifest, SequenceEntry, sha256},
    plan::{DatasetPlan, SequencePlan},
    sequence::Sequence,
};
use crate::{error::SimError, truth::Truth};

/// How far a data set is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct MakeProgress {
    pub frames: u64,
    pub frames_in_all: u64,
    /// Of `frames`, those that an earlier run had made.
    pub frames_found: u64,
}

/// Makes what is missing of a data set and writes its manifest; `None` if `go_on` said no. The files do not depend
/// on the number of threads, nor on how often the run was interrupted.
pub fn make(
    plan: &DatasetPlan,
    body: &Arc<BodyModel>,
    folder: &Path,
    go_on: &(dyn Fn(MakeProgress) -> bool + Sync),
) -> Result<Option<Manifest>, SimError> {
    fs::create_dir_all(folder).map_err(io(folder))?;
    let (done, found) = (AtomicU64::new(0), AtomicU64::new(0));
    let progress = || MakeProgress {
        frames: done.load(Ordering::Relaxed),
        frames_in_all: plan.frame_count(),
        frames_found: found.load(Ordering::Relaxed),
    };
    let one = |sequence: &SequencePlan| -> Result<Option<SequenceEntry>, SimError> {
        let file = format!("{}.npz", sequence.name);
        let path = folder.join(&file);
        let frames = u64::from(sequence.frames);
        if let Some(bytes) = made_before(&path, sequence) {
            found.fetch_add(frames, Ordering::Relaxed);
            done.fetch_add(frames, Ordering::Relaxed);
            go_on(progress());
            return Ok(Some(entry(file, sequence, &bytes)));
        }
        let truth = Truth::new(&sequence.scenario, Arc::clone(body))?;
        let made = Sequence::simulate(sequence, &truth, || {
            done.fetch_add(1, Ordering::Relaxed);
            go_on(progress())
        });
        let Some(made) = made else {
            return Ok(None);
        };
        let bytes = pack(&made, plan.offset_step_m)
            .map_err(|problem| SimError::Dataset { path: path.clone(), problem })?;
        write_whole(&path, &bytes)?;
        Ok(Some(entry(file, sequence, &bytes)))
    };
    let entries: Option<Vec<SequenceEntry>> = plan
        .sequences
        .par_iter()
        .map(one)
        .collect::<Result<_, _>>()?;
    let Some(sequences) = entries else {
        return Ok(None);
    };
    let manifest = Manifest {
        schema: DATASET_SCHEMA.to_owned(),
        preset: plan.preset,
        seed: plan.seed,
        body: body.identity,
        frames: plan.frame_count(),
        bytes: sequences.iter().map(|entry| entry.bytes).sum(),
        sequences,
    };
    let text = serde_json::to_string_pretty(&manifest).expect("a manifest is plain data");
    write_whole(&folder.join(MANIFEST), (text + "\n").as_bytes())?;
    Ok(Some(manifest))
}

/// The bytes of a file that an earlier run made from the same plan.
fn made_before(path: &Path, plan: &SequencePlan) -> Option<Vec<u8>> {
    let bytes = fs::read(path).ok()?;
    let sequence = unpack(&bytes).ok()?;
    (sequence.plan == *plan).then_some(bytes)
}

fn entry(file: String, plan: &SequencePlan, bytes: &[u8]) -> SequenceEntry {
    SequenceEntry { file, bytes: bytes.len() as u64, sha256: sha256(bytes), plan: plan.clone() }
}

/// Under its name there is never half a file.
fn write_whole(path: &Path, bytes: &[u8]) -> Result<(), SimError> {
    let unfinished = path.with_extension("unfinished");
    let written = fs::write(&unfinished, bytes).and_then(|()| fs::rename(&unfinished, path));
    written.map_err(|source| {
        // What there is of it is of no use to anybody.
        fs::remove_file(&unfinished).ok();
        io(path)(source)
    })
}

fn io(path: &Path) -> impl FnOnce(std::io::Error) -> SimError + '_ {
    move |error| SimError::Dataset {
        path: path.to_owned(),
        problem: format!(
            "{error}; is there room, and may you write there? A second run goes on from here"
        ),
    }
}
