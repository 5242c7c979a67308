//! Training people whom training does not see: they judge what it has learned.

use std::sync::Arc;

use anyhow::Context as _;
use effigy_avatar::{
    CanonicalSamples, Canonicaliser,
    meta::{HeldOut, PersonFrame},
};
use effigy_fusion::TriangleMesh;
use effigy_registration::BodyModel;
use effigy_sim_sensor::dataset::Sequence;

use super::people::{as_is, frame_of};
use crate::{
    commands::evaluate::avatar::{Camera, Lesson, Views},
    pipeline::{evaluate::evenly_placed, settings::Settings},
};

/// Of this many training people in a row one is held out, in all they do...
const ONE_IN: usize = 15;

/// ...but no more than so many: judging takes its time.
const JUDGES_AT_MOST: usize = 5;

/// Frames that fine-tuning sees, from eight sides, and that it is judged on: of other actions, where there are several.
const FRAMES: usize = 8;

/// Whether a training person judges instead of teaching.
pub(super) fn is_held_out(index: usize) -> bool {
    index % ONE_IN == ONE_IN / 2 && index / ONE_IN < JUDGES_AT_MOST
}

/// Somebody who judges, with a true surface to look at.
pub(super) struct Judge {
    pub(super) name: String,
    pub(super) held_out: HeldOut,
    /// The first judged surface, in star pose.
    pub(super) truth_in_star: TriangleMesh,
    pub(super) canonicaliser: Canonicaliser,
}

impl Judge {
    /// `sequences`: all that one person does.
    pub(super) fn new(
        sequences: &[Sequence],
        body: &Arc<BodyModel>,
        settings: &Settings,
    ) -> anyhow::Result<Self> {
        let sequence = sequences.first().context("a person without sequences")?;
        let mut views = Views::new(Camera::Paper, &settings.clean, 0);
        let canonicaliser = Canonicaliser::new(
            Arc::clone(body),
            &sequence.betas,
            settings.canonicalise.clone(),
        )?
        .with_camera(views.camera());
        let subject = canonicaliser.subject();
        let (seen, judged) = seen_and_judged(sequences);
        let samples = seen
            .iter()
            .enumerate()
            .map(|(number, &(sequence, frame))| {
                let yaw_rad = (number + 1) as f32 * std::f32::consts::FRAC_PI_4;
                let view = views.keyframe(&Lesson { sequence, frame, yaw_rad })?;
                let (samples, _) = canonicaliser.process(&view).context("poses are known")?;
                Ok(samples)
            })
            .collect::<anyhow::Result<Vec<CanonicalSamples>>>()?;
        let surfaces: Vec<PersonFrame> = judged
            .iter()
            .map(|&(sequence, frame)| as_is(&frame_of(sequence, frame, &canonicaliser), subject))
            .collect();
        let &(first_sequence, first) = judged
            .first()
            .with_context(|| format!("{}: it has one frame only", sequence.plan.name))?;
        Ok(Self {
            name: sequence.plan.name.clone(),
            held_out: HeldOut {
                seen: samples,
                judged: surfaces,
                metres_per_unit: subject.unit_box.metres_per_unit(),
            },
            truth_in_star: first_sequence.star_mesh(first),
            canonicaliser,
        })
    }
}

/// Frames of sequences, by their numbers.
type Frames<'a> = Vec<(&'a Sequence, usize)>;

/// Half of the actions teach and the others judge; of a single one every other frame.
fn seen_and_judged(sequences: &[Sequence]) -> (Frames<'_>, Frames<'_>) {
    let (taught, others) = sequences.split_at(sequences.len() / 2);
    if taught.is_empty() {
        let both = spread(others, 2 * FRAMES);
        let every_other = |first: usize| both.iter().skip(first).step_by(2).copied().collect();
        return (every_other(0), every_other(1));
    }
    (spread(taught, FRAMES), spread(others, FRAMES))
}

/// So many of their frames, evenly.
fn spread(sequences: &[Sequence], count: usize) -> Frames<'_> {
    let all: Vec<_> = sequences
        .iter()
        .flat_map(|sequence| (0..sequence.frames.len()).map(move |frame| (sequence, frame)))
        .collect();
    let places = evenly_placed(all.len(), count);
    places.into_iter().map(|place| all[place]).collect()
}
