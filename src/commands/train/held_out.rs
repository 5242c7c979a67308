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

/// Of this many training people in a row one is held out.
const ONE_IN: usize = 15;

/// Frames that fine-tuning sees, from eight sides, and that it is judged on.
const FRAMES: usize = 8;

/// Whether a training person judges instead of teaching.
pub(super) fn is_held_out(index: usize) -> bool {
    index % ONE_IN == ONE_IN / 2
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
    pub(super) fn new(
        sequence: &Sequence,
        body: &Arc<BodyModel>,
        settings: &Settings,
    ) -> anyhow::Result<Self> {
        let mut views = Views::new(Camera::Paper, &settings.clean, 0);
        let canonicaliser = Canonicaliser::new(
            Arc::clone(body),
            &sequence.betas,
            settings.canonicalise.clone(),
        )?
        .with_camera(views.camera());
        let subject = canonicaliser.subject();
        let places = evenly_placed(sequence.frames.len(), 2 * FRAMES);
        let learned = places.iter().step_by(2).enumerate();
        let samples = learned
            .map(|(number, &frame)| {
                let yaw_rad = (number + 1) as f32 * std::f32::consts::FRAC_PI_4;
                let view = views.keyframe(&Lesson { sequence, frame, yaw_rad })?;
                let (samples, _) = canonicaliser.process(&view).context("poses are known")?;
                Ok(samples)
            })
            .collect::<anyhow::Result<Vec<CanonicalSamples>>>()?;
        let judged: Vec<usize> = places.iter().skip(1).step_by(2).copied().collect();
        let surfaces: Vec<PersonFrame> = judged
            .iter()
            .map(|&frame| as_is(&frame_of(sequence, frame, &canonicaliser), subject))
            .collect();
        let first = judged
            .first()
            .with_context(|| format!("{}: it has one frame only", sequence.plan.name))?;
        Ok(Self {
            name: sequence.plan.name.clone(),
            held_out: HeldOut {
                seen: samples,
                judged: surfaces,
                metres_per_unit: subject.unit_box.metres_per_unit(),
            },
            truth_in_star: sequence.star_mesh(*first),
            canonicaliser,
        })
    }
}
