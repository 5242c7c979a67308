//! Betas are standard normal over people.

use super::{Row, RowSink, Term};
use crate::{state::BETA_COUNT, surface::PosedSurface};

/// `sum ((beta - mean) / sigma)^2`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ShapePrior {
    pub(crate) mean: [f32; BETA_COUNT],
    pub(crate) weight: f32,
}

impl Term for ShapePrior {
    fn emit(&self, body: &PosedSurface<'_>, sink: &mut dyn RowSink) {
        let mut row = Row::new(0.0, 0.0);
        for (k, (beta, mean)) in body.state.betas.iter().zip(&self.mean).enumerate() {
            let residual = beta - mean;
            row.restart(residual, self.weight, self.weight * residual * residual);
            let mut derivative = [0.0; BETA_COUNT];
            derivative[k] = 1.0;
            row.add_betas(&derivative);
            sink.take(&row);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::residual::checker;

    #[test]
    fn derivatives_agree_with_finite_differences() {
        checker::assert_derivatives(&ShapePrior { mean: [0.1; BETA_COUNT], weight: 1.0 });
    }
}
