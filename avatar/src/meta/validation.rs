//! How good a start a network is, on people it does not learn from: short fine-tunings, judged on whole
//! surfaces in other poses.

use std::ops::ControlFlow;

use super::task::PersonFrame;
use crate::{
    CanonicalSamples, SignedDistanceField as _,
    error::AvatarError,
    fine_tune::{FineTuneConfig, fine_tune},
    hyper::HyperNetwork,
};

/// Somebody whom training never sees.
#[derive(Clone, Debug)]
pub struct HeldOut {
    /// Single views, canonicalised as the program does it.
    pub seen: Vec<CanonicalSamples>,
    /// Whole surfaces in other poses.
    pub judged: Vec<PersonFrame>,
    pub metres_per_unit: f32,
}

/// The people, and how each is fine-tuned.
#[derive(Clone, Debug)]
pub struct Validation {
    pub people: Vec<HeldOut>,
    pub fine_tune: FineTuneConfig,
}

/// What a validation found.
#[derive(Clone, Debug)]
pub struct Validated {
    /// Mean distance of the judged surfaces' points to the fine-tuned surface, over all people, millimetres.
    pub held_out_mm: f64,
    /// The same of some people that it learned from, each by the code found while learning, at the judges' mean size. Far below
    /// the held-out error, more people are wanted; near it, a larger network.
    pub taught_mm: Option<f64>,
    /// The fine-tuned networks, one a person.
    pub tuned: Vec<HyperNetwork>,
}

impl Validation {
    /// Few steps, since what is asked for is a good start; all at one pace and with normals, so that the first stage, which
    /// knows nobody apart, is judged alike.
    pub fn new(people: Vec<HeldOut>) -> Self {
        let fine_tune = FineTuneConfig {
            steps: 100,
            held_out_share: 0.0,
            held_out_every: u32::MAX,
            learns_normals: true,
            ..FineTuneConfig::default().without_code()
        };
        Self { people, fine_tune }
    }

    /// `taught`: of the people learned from, in unit lengths.
    pub(super) fn of(
        &self,
        network: &HyperNetwork,
        taught: Option<f64>,
    ) -> Result<Validated, AvatarError> {
        let mut tuned = Vec::with_capacity(self.people.len());
        let mut sum_mm = 0.0;
        for person in &self.people {
            let own = fine_tune(
                network.clone(),
                &person.seen,
                person.metres_per_unit,
                &self.fine_tune,
                &|| 0.0,
                &mut |_, _| ControlFlow::Continue(()),
            )?;
            sum_mm += person.error_mm(&own) / self.people.len() as f64;
            tuned.push(own);
        }
        let sizes = self
            .people
            .iter()
            .map(|person| f64::from(person.metres_per_unit));
        let mean_size = sizes.sum::<f64>() / self.people.len().max(1) as f64;
        let taught_mm = taught.map(|units| units * mean_size * 1e3);
        Ok(Validated { held_out_mm: sum_mm, taught_mm, tuned })
    }
}

impl HeldOut {
    fn error_mm(&self, network: &HyperNetwork) -> f64 {
        let mut sum = 0.0;
        let mut count = 0;
        for frame in &self.judged {
            let mut values = vec![0.0; frame.points_in_unit.len()];
            let field = network.field(&frame.pose);
            field.values(&frame.points_in_unit, &mut values);
            sum += values
                .iter()
                .map(|value| f64::from(value.abs()))
                .sum::<f64>();
            count += values.len();
        }
        sum / count.max(1) as f64 * f64::from(self.metres_per_unit) * 1e3
    }
}
