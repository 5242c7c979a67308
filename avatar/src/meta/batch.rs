//! One step's points of some frames, and the gradients by the parameters of the fields that they judge.

use glam::Vec3;
use rand::Rng;

use super::config::PriorConfig;
use crate::{
    error::AvatarError,
    fine_tune::sampling::KeyframePoints,
    sdf::{
        SirenConfig,
        batch::{FieldFrame, FieldGradients},
        loss::LossPoint,
    },
};

/// Its memory serves step after step.
pub(super) struct Batch {
    gradients: FieldGradients,
    points: Vec<Vec<Vec3>>,
    known: Vec<Vec<LossPoint>>,
}

impl Batch {
    pub(super) fn new(field: SirenConfig) -> Self {
        Self { gradients: FieldGradients::new(field), points: Vec::new(), known: Vec::new() }
    }

    /// Draws anew from each frame.
    pub(super) fn draw(
        &mut self,
        frames: &[&KeyframePoints],
        config: &PriorConfig,
        rng: &mut impl Rng,
    ) {
        self.points.resize_with(frames.len(), Vec::new);
        self.known.resize_with(frames.len(), Vec::new);
        let drawn = self.points.iter_mut().zip(&mut self.known);
        for (frame, (points, known)) in frames.iter().zip(drawn) {
            frame.draw(&config.sampling, rng, points, known);
        }
    }

    /// Loss on what was drawn, one field a frame; [`Self::bars`] then has the gradients. `number` is the step's.
    pub(super) fn loss(
        &mut self,
        fields: &[impl AsRef<[f32]>],
        config: &PriorConfig,
        number: u32,
    ) -> Result<f64, AvatarError> {
        let frames: Vec<_> = fields
            .iter()
            .zip(self.points.iter().zip(&self.known))
            .map(|(field, (points, known))| FieldFrame {
                parameters: field.as_ref(),
                points,
                known,
            })
            .collect();
        let terms = self.gradients.compute(&frames, &config.loss);
        if terms.total().is_finite() {
            Ok(terms.total())
        } else {
            Err(AvatarError::LossNotFinite { step: number, terms })
        }
    }

    /// The gradient by each frame's field.
    pub(super) fn bars(&self) -> Vec<&[f32]> {
        (0..self.points.len())
            .map(|frame| self.gradients.frame(frame))
            .collect()
    }
}
