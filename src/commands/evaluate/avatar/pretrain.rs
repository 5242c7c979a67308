//! The ablation's networks, and occupancy, learn of people in general: the data set's training people, all frames
//! alike, every network with the same draws and schedule.

use std::sync::Arc;

use effigy_avatar::{
    CanonicalSamples, Canonicaliser,
    baselines::{Architecture, BodyLabels, ConditionedField, fit},
    canonicalise::CanonicaliseConfig,
    fine_tune::{FineTuneConfig, fine_tune},
    hyper::{HyperNetwork, RateConfig},
};
use effigy_fusion::mesh::sample::sample_surface;
use effigy_registration::BodyModel;
use effigy_sim_sensor::dataset::{Dataset, Split};

use super::{method::go_on, plan::Method};
use crate::pipeline::{clock::Clock, evaluate::evenly_placed, settings::Settings};

/// Frames of each training sequence, and points of each.
const FRAMES: usize = 8;
const POINTS: usize = 4000;
/// Frames a step.
const FRAMES_PER_STEP: usize = 4;
/// Steps of a hypernetwork, which starts from the prior's `phi*`, in fine-tunings.
const STEPS_FACTOR: u32 = 11;
/// The others start from nothing and get twice as many (as in the paper, whose epochs were 100 to 50).
const STEPS_FACTOR_FROM_NOTHING: u32 = 22;
/// Adam's rate of the networks that start from nothing.
const RATE_FROM_NOTHING: f32 = 5e-4;

/// A network that knows people.
#[derive(Clone)]
pub(super) enum Pretrained {
    Conditioned(ConditionedField),
    Hyper(Box<HyperNetwork>),
}

/// Networks are taught when they are first asked for.
#[derive(Default)]
pub(super) struct School {
    samples: Vec<CanonicalSamples>,
    /// Where the body of each sample's person is.
    labels: Vec<Arc<BodyLabels>>,
    taught: Vec<(Method, Pretrained)>,
}

impl School {
    pub(super) fn taught(
        &mut self,
        method: Method,
        dataset: &Dataset,
        body: &Arc<BodyModel>,
        (settings, clock): (&Settings, Clock),
    ) -> anyhow::Result<Pretrained> {
        if let Some((_, network)) = self.taught.iter().find(|(taught, _)| *taught == method) {
            return Ok(network.clone());
        }
        if self.samples.is_empty() {
            (self.samples, self.labels) = training_people(dataset, body, &settings.canonicalise)?;
        }
        let prior = settings.prior_network(body.identity)?;
        let lessons = (&self.samples[..], &self.labels[..]);
        let network = teach(method, lessons, (&prior, &settings.fine_tune), clock)?;
        self.taught.push((method, network.clone()));
        Ok(network)
    }
}

fn teach(
    method: Method,
    (samples, labels): (&[CanonicalSamples], &[Arc<BodyLabels>]),
    (prior, live): (&HyperNetwork, &FineTuneConfig),
    clock: Clock,
) -> anyhow::Result<Pretrained> {
    let config = FineTuneConfig {
        steps: live.steps * STEPS_FACTOR,
        frames_per_step: FRAMES_PER_STEP,
        held_out_share: 0.0,
        rates: RateConfig::everything(),
        learns_normals: true,
        ..live.without_code()
    };
    if let Some(architecture) = architecture(method) {
        let config = FineTuneConfig {
            steps: live.steps * STEPS_FACTOR_FROM_NOTHING,
            rates: RateConfig { field: RATE_FROM_NOTHING, ..config.rates },
            ..config
        };
        let mut field = ConditionedField::new(architecture, live.seed);
        let labels = if method == Method::Occupancy {
            labels
        } else {
            &[]
        };
        fit(&mut field, samples, labels, &config, &mut go_on)?;
        return Ok(Pretrained::Conditioned(field));
    }
    let mut network = prior.with_fresh_heads(live.seed);
    if method == Method::HyperQuaternions {
        network = network.with_quaternions();
    }
    let secs = || clock.secs();
    // Residuals are of no interest here, so a unit is as good as a metre.
    let taught = fine_tune(network, samples, 1.0, &config, &secs, &mut |_, _| go_on())?;
    Ok(Pretrained::Hyper(Box::new(taught)))
}

fn architecture(method: Method) -> Option<Architecture> {
    match method {
        Method::Mlp => Some(Architecture::Mlp),
        Method::PositionalEncoding => Some(Architecture::PositionalEncoding),
        Method::Siren => Some(Architecture::Siren),
        Method::Occupancy => Some(Architecture::Occupancy),
        _ => None,
    }
}

/// Whole true surfaces of the training people, brought to canonical space as keyframes are.
fn training_people(
    dataset: &Dataset,
    body: &Arc<BodyModel>,
    config: &CanonicaliseConfig,
) -> anyhow::Result<(Vec<CanonicalSamples>, Vec<Arc<BodyLabels>>)> {
    let (mut samples, mut labels) = (Vec::new(), Vec::new());
    let entries = dataset.manifest().sequences.iter();
    for entry in entries.filter(|entry| entry.plan.split == Split::Train) {
        let sequence = dataset.load(entry)?;
        let person = Canonicaliser::new(Arc::clone(body), &sequence.betas, config.clone())?;
        let where_body_is = Arc::new(BodyLabels::new(body, person.subject(), 0)?);
        for frame in evenly_placed(sequence.frames.len(), FRAMES) {
            let seed = samples.len() as u64;
            let points = sample_surface(&sequence.posed_mesh(frame), POINTS, seed);
            samples.push(person.process_surface(&sequence.params(frame), &points).0);
            labels.push(Arc::clone(&where_body_is));
        }
    }
    Ok((samples, labels))
}
