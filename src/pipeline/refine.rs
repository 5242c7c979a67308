//! Keyframes looked at again with the clothes that they turned out to show.
//!
//! The tracker follows a bare body and allows for clothes without knowing them. Once the person was found among those
//! whom the prior knows, their surface in each keyframe's pose is known as far as people's clothes go: errors of single
//! poses are not in it. Aligned to that, keyframes agree better with each other.

use std::{ops::ControlFlow, sync::Arc};

use anyhow::ensure;
use effigy_avatar::{
    Avatar, AvatarError, CanonicalSamples, Canonicaliser, PoseField, TopologyConfig,
    fine_tune::{FineTuneConfig, FineTuneProgress, fine_tune},
    hyper::HyperNetwork,
    skinning::offsets_from_body,
};
use effigy_capture::CameraModel;
use effigy_registration::{BodyModel, Refiner, RegisteredFrame};
use glam::Vec3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::settings::Settings;

/// More passes only drift, and more steps find nobody else.
const MOST_PASSES: u32 = 8;
const MOST_STEPS: u32 = 10_000;

/// Whether and how keyframes are refined.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(crate) struct RefineConfig {
    /// How often all keyframes are looked at again; 0 for never, [`MOST_PASSES`] at most.
    pub(crate) passes: u32,
    /// Fine-tuning steps before each pass, [`MOST_STEPS`] at most; all of them look for who it is.
    pub(crate) steps: u32,
}

impl Default for RefineConfig {
    fn default() -> Self {
        Self { passes: 0, steps: 60 }
    }
}

impl RefineConfig {
    /// Refuses what would run and mean nothing, or not end.
    pub(crate) fn check(self) -> anyhow::Result<()> {
        let Self { passes, steps } = self;
        ensure!(
            passes <= MOST_PASSES,
            "refine.passes is {passes}, expected at most {MOST_PASSES}, or 0 for none"
        );
        ensure!(
            (1..=MOST_STEPS).contains(&steps),
            "refine.steps is {steps}, expected 1 to {MOST_STEPS}"
        );
        Ok(())
    }

    /// Steps of all passes.
    pub(crate) fn steps_in_all(self) -> u32 {
        self.passes * self.steps
    }
}

/// Is told where fine-tuning stands, steps counted over all passes, and the network after each step.
pub(crate) type OnStep<'a> = dyn FnMut(&FineTuneProgress, &HyperNetwork) -> ControlFlow<()> + 'a;

/// What keyframes are refined with.
pub(crate) struct Refinement<'a> {
    pub(crate) body: &'a Arc<BodyModel>,
    pub(crate) camera: &'a CameraModel,
    pub(crate) canonicaliser: &'a Canonicaliser,
    pub(crate) prior: &'a HyperNetwork,
    pub(crate) settings: &'a Settings,
}

impl Refinement<'_> {
    /// Tracked keyframes of one person, each with its pose aligned to the surface that all of them together show.
    pub(crate) fn refined(
        &self,
        tracked: &[RegisteredFrame],
        on_step: &mut OnStep<'_>,
    ) -> anyhow::Result<Vec<RegisteredFrame>> {
        let Self { body, camera, settings, .. } = *self;
        if settings.refine.passes == 0 {
            return Ok(tracked.to_vec());
        }
        let refiner = Refiner::new(Arc::clone(body), *camera, settings.track.clone());
        let mut keyframes = tracked.to_vec();
        for pass in 0..settings.refine.passes {
            let mut wanted = ControlFlow::Continue(());
            let field = self.who(&keyframes, pass, &mut |now, network| {
                wanted = on_step(now, network);
                wanted
            })?;
            if wanted.is_break() {
                break;
            }
            let refined = keyframes
                .par_iter()
                .zip(tracked)
                .map(|(keyframe, tracked)| {
                    let (Some(near), Some(offsets)) =
                        (tracked.params(), self.offsets(&field, keyframe)?)
                    else {
                        return Ok(keyframe.clone());
                    };
                    Ok(refiner.refine(keyframe, near, &offsets)?)
                });
            keyframes = refined.collect::<anyhow::Result<_>>()?;
        }
        Ok(keyframes)
    }

    /// The person, as far as they are one of those whom the prior knows.
    fn who(
        &self,
        keyframes: &[RegisteredFrame],
        pass: u32,
        on_step: &mut OnStep<'_>,
    ) -> anyhow::Result<Arc<HyperNetwork>> {
        let samples: Vec<CanonicalSamples> = keyframes
            .iter()
            .filter_map(|keyframe| Some(self.canonicaliser.process(keyframe)?.0))
            .collect();
        let steps = self.settings.refine.steps;
        let search = FineTuneConfig { steps, code_steps: steps, ..self.settings.fine_tune };
        let metres_per_unit = self.canonicaliser.subject().unit_box.metres_per_unit();
        let network = fine_tune(
            self.prior.clone(),
            &samples,
            metres_per_unit,
            &search,
            &|| 0.0,
            &mut |now, network| {
                on_step(
                    &FineTuneProgress { step: pass * steps + now.step, ..*now },
                    network,
                )
            },
        )?;
        Ok(Arc::new(network))
    }

    /// How far the body's vertices are from the surface in a keyframe's pose; `None` where there is no surface.
    fn offsets(
        &self,
        field: &Arc<HyperNetwork>,
        keyframe: &RegisteredFrame,
    ) -> anyhow::Result<Option<Vec<Vec3>>> {
        let Some(params) = keyframe.params() else {
            return Ok(None);
        };
        let avatar = Avatar::new(
            self.canonicaliser.subject(),
            Arc::clone(field) as Arc<dyn PoseField>,
            &**self.canonicaliser.skinning(),
            &params.theta,
            &TopologyConfig::default(),
        );
        match avatar {
            Ok(avatar) => Ok(Some(offsets_from_body(&avatar, self.body))),
            Err(AvatarError::NoSurface { .. }) => Ok(None),
            Err(error) => Err(error.into()),
        }
    }
}
