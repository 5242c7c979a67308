//! Making a data set: sequences in parallel, each file whole or not there, so that an interrupted run goes on.

use std::{
    fs,
    path::Path,
    sync::{
        Arc,
        atomic::{AtomicU64, Ordering},
    },
};

use effigy_registration::{BodyModel, smpl::BodyIdentity};
use rayon::prelude::*;

use super::{
    manifest::{DATASET_SCHEMA, MANIFEST, Manifest, SequenceEntry, read_bounded, sha256},
    packing::{body_of, pack, plan_of, unpack},
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
    let simulate = |sequence: &SequencePlan, next: &mut dyn FnMut() -> bool| {
        let scenario = sequence.scenario.as_ref();
        let scenario = scenario.ok_or_else(|| SimError::Sequence {
            name: sequence.name.clone(),
            problem: "it has no scenario to simulate".to_owned(),
        })?;
        let truth = Truth::new(scenario, Arc::clone(body))?;
        Ok(Sequence::simulate(sequence, &truth, next))
    };
    make_all(
        &Work { plan, body: body.identity, folder, go_on },
        &simulate,
    )
}

/// What is to be made, and where.
pub(super) struct Work<'a> {
    pub(super) plan: &'a DatasetPlan,
    pub(super) body: BodyIdentity,
    pub(super) folder: &'a Path,
    pub(super) go_on: &'a (dyn Fn(MakeProgress) -> bool + Sync),
}

/// Makes one sequence; `None` if the function said no that is called before each frame.
pub(super) type MakeOne<'a> = dyn Fn(&SequencePlan, &mut dyn FnMut() -> bool) -> Result<Option<Sequence>, SimError>
    + Sync
    + 'a;

/// Makes what is missing, in parallel, and writes the manifest when all is there.
pub(super) fn make_all(work: &Work<'_>, one: &MakeOne<'_>) -> Result<Option<Manifest>, SimError> {
    let Work { plan, body, folder, go_on } = *work;
    fs::create_dir_all(folder).map_err(io(folder))?;
    refuse_another(work)?;
    let (done, found) = (AtomicU64::new(0), AtomicU64::new(0));
    let progress = || MakeProgress {
        frames: done.load(Ordering::Relaxed),
        frames_in_all: plan.frame_count(),
        frames_found: found.load(Ordering::Relaxed),
    };
    let finished = |sequence: &SequencePlan| -> Result<Option<SequenceEntry>, SimError> {
        let file = format!("{}.npz", sequence.name);
        let path = folder.join(&file);
        let frames = u64::from(sequence.frames);
        if let Some((found_before, bytes)) = made_before(&path, sequence, body) {
            found.fetch_add(frames, Ordering::Relaxed);
            done.fetch_add(frames, Ordering::Relaxed);
            go_on(progress());
            return Ok(Some(entry(file, &found_before, &bytes)));
        }
        let made = one(sequence, &mut || {
            done.fetch_add(1, Ordering::Relaxed);
            go_on(progress())
        })?;
        let Some(made) = made else {
            return Ok(None);
        };
        let bytes = pack(&made, body, plan.offset_step_m)
            .map_err(|problem| SimError::Dataset { path: path.clone(), problem })?;
        write_whole(&path, &bytes)?;
        Ok(Some(entry(file, &made, &bytes)))
    };
    let sequences = plan.sequences.par_iter().map(finished);
    let Some(sequences) = sequences.collect::<Result<Option<Vec<_>>, _>>()? else {
        return Ok(None);
    };
    let manifest = Manifest {
        schema: DATASET_SCHEMA.to_owned(),
        preset: plan.preset,
        seed: plan.seed,
        body,
        frames: plan.frame_count(),
        bytes: sequences.iter().map(|entry| entry.bytes).sum(),
        sequences,
    };
    let text = serde_json::to_string_pretty(&manifest).expect("a manifest is plain data");
    write_whole(&folder.join(MANIFEST), (text + "\n").as_bytes())?;
    Ok(Some(manifest))
}

/// A folder keeps its data set: what took an hour is not replaced by a slip of the hand. Looks at all there is before
/// anything is made.
fn refuse_another(work: &Work<'_>) -> Result<(), SimError> {
    const ELSEWHERE: &str = "choose an empty folder, or delete this one";
    let Work { plan, body, folder, .. } = *work;
    let path = folder.join(MANIFEST);
    if path.exists() {
        let text = read_bounded(&path);
        let found = text.and_then(|text| {
            serde_json::from_slice::<Manifest>(&text).map_err(|error| error.to_string())
        });
        let problem = match found {
            Ok(found) => found.differs_from(plan, body),
            Err(problem) => Some(format!("which data set is here cannot be told ({problem})")),
        };
        if let Some(problem) = problem {
            let problem = format!("{problem}; {ELSEWHERE}");
            return Err(SimError::Dataset { path, problem });
        }
    }
    for sequence in &plan.sequences {
        let path = folder.join(format!("{}.npz", sequence.name));
        let found = read_bounded(&path).ok();
        let found = found.and_then(|bytes| Some((plan_of(&bytes)?, body_of(&bytes))));
        let another = found.is_some_and(|(found, found_body)| {
            let same_program = found.generator == sequence.generator;
            found_body.is_some_and(|found| found != body) || (same_program && found != *sequence)
        });
        if another {
            let problem = format!("this sequence is part of another data set; {ELSEWHERE}");
            return Err(SimError::Dataset { path, problem });
        }
    }
    Ok(())
}

impl Manifest {
    /// Why a folder with this manifest is not one to make a plan in; `None` if it is.
    fn differs_from(&self, plan: &DatasetPlan, body: BodyIdentity) -> Option<String> {
        if (self.preset, self.seed) != (plan.preset, plan.seed) {
            let (preset, seed) = (self.preset, self.seed);
            return Some(format!(
                "here is another data set ({preset:?}, seed {seed})"
            ));
        }
        if self.body != body {
            return Some("here is a data set of another body".to_owned());
        }
        let planned = |entry: &SequenceEntry| {
            let name = &entry.plan.name;
            plan.sequences.iter().any(|sequence| sequence.name == *name)
        };
        let stranger = self.sequences.iter().find(|entry| !planned(entry))?;
        Some(format!(
            "here is a data set with other sequences ({})",
            stranger.plan.name
        ))
    }
}

/// What an earlier run made from the same plan, with the same body and in today's schema, and its bytes.
fn made_before(
    path: &Path,
    plan: &SequencePlan,
    body: BodyIdentity,
) -> Option<(Sequence, Vec<u8>)> {
    let bytes = read_bounded(path).ok()?;
    let sequence = unpack(&bytes).ok()?;
    (sequence.plan == *plan && body_of(&bytes) == Some(body)).then_some((sequence, bytes))
}

fn entry(file: String, sequence: &Sequence, bytes: &[u8]) -> SequenceEntry {
    SequenceEntry {
        file,
        bytes: bytes.len() as u64,
        sha256: sha256(bytes),
        plan: sequence.plan.clone(),
        cloth: sequence.cloth,
    }
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
