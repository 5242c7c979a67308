//! One Levenberg-Marquardt step, with the reason why it ended as it did.

use super::NormalEquations;
use crate::{
    residual::{CostSum, Term},
    state::POSE_UNKNOWNS,
    surface::PosedSurface,
};

/// How far steps are trusted; carried from step to step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Damping {
    /// Share of the Hessian's diagonal added to it.
    pub(crate) relative: f64,
}

/// Why a step ended, with the measured value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Termination {
    /// The energy fell, by this share.
    Descended { by: f64 },
    /// The step was too small to matter.
    Converged { largest_step: f64 },
    /// No damping up to the limit brought the energy down.
    NoDescent { damping: f64 },
    /// The system had no solution (unknowns without any residual, or not finite).
    Singular,
}

/// Steps below this (metres, radians) change nothing anybody sees.
const SMALLEST_STEP: f64 = 2e-4;
const LARGEST_DAMPING: f64 = 1e3;
const SMALLEST_DAMPING: f64 = 1e-4;
/// Keeps unknowns that no residual sees in place.
pub(super) const ABSOLUTE_DAMPING: f64 = 1e-3;
/// Larger steps leave the region where the linearisation means anything.
const LONGEST_STEP: f64 = 0.5;

impl Default for Damping {
    fn default() -> Self {
        Self { relative: 1e-2 }
    }
}

impl Termination {
    /// Whether another step from here can be worth its time.
    pub(crate) fn may_go_on(self, smallest_descent: f64) -> bool {
        matches!(self, Self::Descended { by } if by >= smallest_descent)
    }
}

/// Linearises the terms at the body's state and moves it downhill, if that can be done.
pub(crate) fn take_step<'a>(
    body: PosedSurface<'a>,
    terms: &[&dyn Term],
    damping: &mut Damping,
) -> (PosedSurface<'a>, Termination) {
    let mut system = NormalEquations::new(POSE_UNKNOWNS);
    for term in terms {
        term.emit(&body, &mut system);
    }
    let mut termination = Termination::Singular;
    while damping.relative <= LARGEST_DAMPING {
        let relative = damping.relative;
        let Some(mut step) = system.solve(relative, ABSOLUTE_DAMPING) else {
            damping.relative *= 10.0;
            continue;
        };
        let largest = shorten(&mut step);
        if largest < SMALLEST_STEP {
            termination = Termination::Converged { largest_step: largest };
            break;
        }
        let moved = PosedSurface::new(body.shaped, &body.state.moved_by(&step));
        let cost = energy(&moved, terms);
        if cost < system.cost {
            damping.relative = (relative * 0.3).max(SMALLEST_DAMPING);
            return (
                moved,
                Termination::Descended { by: 1.0 - cost / system.cost },
            );
        }
        damping.relative *= 8.0;
        termination = Termination::NoDescent { damping: damping.relative };
    }
    damping.relative = damping.relative.clamp(SMALLEST_DAMPING, 1.0);
    (body, termination)
}

/// What the terms add up to for a body.
fn energy(body: &PosedSurface<'_>, terms: &[&dyn Term]) -> f64 {
    let mut sum = CostSum::default();
    for term in terms {
        term.emit(body, &mut sum);
    }
    sum.0
}

/// Cuts a step to the longest one allowed; returns how long it was.
pub(crate) fn shorten(step: &mut [f64]) -> f64 {
    let largest = step.iter().fold(0.0_f64, |largest, x| largest.max(x.abs()));
    if largest > LONGEST_STEP {
        for x in step {
            *x *= LONGEST_STEP / largest;
        }
    }
    largest
}
