//! Holds a term's derivative against finite differences of its residuals.

use std::sync::Arc;

use glam::{Quat, Vec3};

use super::{Row, RowSink, Term};
use crate::{
    smpl::{JOINT_COUNT, builtin},
    state::{ALL_UNKNOWNS, BodyState},
    surface::{PosedSurface, ShapedSurface, Surface},
};

/// Largest difference allowed between analytic and numeric derivative, relative to the larger of one and the row's
/// size: pose correctives, which the analytic derivative leaves out, stay below it, and so does single precision.
const TOLERANCE: f64 = 0.03;
const STEP: f64 = 2e-3;

/// A body surface for tests of terms, without pose correctives so that derivatives are exact.
pub(crate) fn test_surface() -> ShapedSurface {
    let mut surface = Surface::new(builtin::body(), 400);
    surface.pose_dirs.clear();
    ShapedSurface::new(
        &Arc::new(surface),
        [0.3, -0.2, 0.1, 0.0, 0.2, 0.0, 0.0, 0.0, 0.0, -0.1],
    )
}

/// An unremarkable pose two metres in front of the camera.
pub(crate) fn test_state() -> BodyState {
    let rotations = std::array::from_fn(|joint| {
        let k = joint as f32;
        Quat::from_scaled_axis(Vec3::new(
            0.15 * (k * 1.3).sin(),
            0.2 * (k * 0.7).cos(),
            0.15 * (k * 2.1).sin(),
        ))
    });
    let betas = [0.3, -0.2, 0.1, 0.0, 0.2, 0.0, 0.0, 0.0, 0.0, -0.1];
    BodyState { betas, rotations, trans: Vec3::new(0.1, 0.95, -2.0) }
}

/// Fails the test if any residual's derivative is off in the test's pose.
pub(crate) fn assert_derivatives(term: &dyn Term) {
    assert_derivatives_at(term, &test_state());
}

/// As [`assert_derivatives`], in another pose.
pub(crate) fn assert_derivatives_at(term: &dyn Term, state: &BodyState) {
    let shaped = test_surface();
    let analytic = rows_at(term, &shaped, state, true);
    assert!(
        !analytic.is_empty(),
        "the term emits nothing in the test's pose"
    );
    for unknown in 0..ALL_UNKNOWNS {
        let at = |sign: f64| {
            let mut step = [0.0; ALL_UNKNOWNS];
            step[unknown] = sign * STEP;
            rows_at(term, &shaped, &state.moved_by(&step), false)
        };
        let (ahead, behind) = (at(1.0), at(-1.0));
        assert_eq!(ahead.len(), analytic.len(), "the active set changes");
        for (i, row) in analytic.iter().enumerate() {
            let numeric = f64::from(ahead[i].residual - behind[i].residual) / (2.0 * STEP);
            let claimed = row.derivative[unknown];
            let size = row.derivative.iter().fold(1e-2_f64, |m, d| m.max(d.abs()));
            assert!(
                (numeric - claimed).abs() <= TOLERANCE * size,
                "row {i}, unknown {unknown}: analytic {claimed}, numeric {numeric}"
            );
        }
    }
}

struct DenseRow {
    residual: f32,
    derivative: [f64; ALL_UNKNOWNS],
}

struct DenseRows {
    rows: Vec<DenseRow>,
    derivatives: bool,
}

impl RowSink for DenseRows {
    fn wants_derivatives(&self) -> bool {
        self.derivatives
    }

    fn take(&mut self, row: &Row) {
        let (mut indices, mut values) = ([0; ALL_UNKNOWNS], [0.0; ALL_UNKNOWNS]);
        let count = row.sparse(&mut indices, &mut values);
        let mut derivative = [0.0; ALL_UNKNOWNS];
        for (&i, &value) in indices.iter().zip(&values).take(count) {
            derivative[i] = value;
        }
        self.rows
            .push(DenseRow { residual: row.residual, derivative });
    }
}

fn rows_at(
    term: &dyn Term,
    shaped: &ShapedSurface,
    state: &BodyState,
    derivatives: bool,
) -> Vec<DenseRow> {
    let reshaped = ShapedSurface::new(&shaped.surface, state.betas);
    let body = PosedSurface::new(&reshaped, state).with_shape_derivatives();
    let mut sink = DenseRows { rows: Vec::new(), derivatives };
    term.emit(&body, &mut sink);
    assert_eq!(body.joints.len(), JOINT_COUNT);
    sink.rows
}
