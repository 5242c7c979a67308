//! Loss and parameter gradient of one network over the points of several frames, the same to the last bit on any number
//! of threads: a fixed number of units a frame, summed in order.

use glam::Vec3;
use rayon::prelude::*;

use super::{
    CodeAt, FieldMlp,
    tape::{TILE, Tape},
};
use crate::sdf::loss::{LossPoint, LossTerms, Scale};

/// Units of work a frame.
const UNITS_PER_FRAME: usize = 2;

/// One frame's points, what is known there, and what they are told of the pose.
#[derive(Clone, Copy)]
pub(crate) struct MlpFrame<'a> {
    pub(crate) codes: &'a dyn CodeAt,
    pub(crate) points: &'a [Vec3],
    pub(crate) known: &'a [LossPoint],
}

/// The loss at a point and its derivatives by value and spatial gradient.
pub(crate) type PointLoss<'a> =
    dyn Fn(Scale, &LossPoint, f32, Vec3) -> (LossTerms, f32, Vec3) + Sync + 'a;

/// Buffers, reused from step to step.
#[derive(Default)]
pub(crate) struct MlpGradients {
    units: Vec<Unit>,
    /// As the network's parameters, after [`Self::compute`].
    pub(crate) sum: Vec<f32>,
}

#[derive(Default)]
struct Unit {
    tape: Option<Tape>,
    gradient: Vec<f32>,
    terms: LossTerms,
}

impl MlpGradients {
    /// The loss over all frames; its gradient is in [`Self::sum`] then. Runs in the current rayon pool.
    pub(crate) fn compute(
        &mut self,
        mlp: &FieldMlp,
        frames: &[MlpFrame<'_>],
        loss: &PointLoss<'_>,
    ) -> LossTerms {
        let scale = Scale::of(frames.iter().flat_map(|frame| frame.known));
        self.units
            .resize_with(frames.len() * UNITS_PER_FRAME, Unit::default);
        let units = self.units.par_iter_mut().enumerate().with_max_len(1);
        units.for_each(|(index, unit)| {
            let frame = &frames[index / UNITS_PER_FRAME];
            unit.run(mlp, frame, index % UNITS_PER_FRAME, (scale, loss));
        });
        self.sum.clear();
        self.sum.resize(mlp.parameters.len(), 0.0);
        let mut terms = LossTerms::default();
        for unit in &self.units {
            terms += unit.terms;
            for (sum, part) in self.sum.iter_mut().zip(&unit.gradient) {
                *sum += part;
            }
        }
        terms
    }
}

impl Unit {
    fn run(
        &mut self,
        mlp: &FieldMlp,
        frame: &MlpFrame<'_>,
        part: usize,
        (scale, loss): (Scale, &PointLoss<'_>),
    ) {
        self.gradient.clear();
        self.gradient.resize(mlp.parameters.len(), 0.0);
        self.terms = LossTerms::default();
        let tape = self.tape.get_or_insert_with(|| Tape::new(mlp.config));
        let tiles = frame.points.len().div_ceil(TILE);
        for tile in tiles * part / UNITS_PER_FRAME..tiles * (part + 1) / UNITS_PER_FRAME {
            let range = tile * TILE..((tile + 1) * TILE).min(frame.points.len());
            let (points, known) = (&frame.points[range.clone()], &frame.known[range]);
            tape.values(mlp, points, frame.codes);
            tape.gradients(mlp, points);
            for (index, known) in known.iter().enumerate() {
                let (terms, value_bar, gradient_bar) =
                    loss(scale, known, tape.values[index], tape.gradients[index]);
                self.terms += terms;
                tape.value_bars[index] = value_bar;
                tape.gradient_bars[index] = gradient_bar;
            }
            tape.backward(mlp, points, &mut self.gradient);
        }
    }
}
