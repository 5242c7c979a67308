//! Newton's method with step halving: it holds where the usual fixed-point iteration diverges.

use glam::{Vec2, vec2};

const MAX_STEPS: u32 = 30;
/// A residual on the normalised plane below 0.001 px of any camera shorter than 5000 px.
const TOLERANCE: f32 = 2e-7;
/// What is still accepted when f32 rounding stops the descent early.
const LOOSE_TOLERANCE: f32 = 4e-6;

/// Solves `f(p) = target` near `target`; `f` gives its value and symmetric Jacobian
/// `[xx, xy, yy]`. NaN where there is no solution, or only one behind a fold of the lens (where the
/// Jacobian is no longer positive definite).
pub(super) fn invert_2d(f: impl Fn(Vec2) -> (Vec2, [f32; 3]), target: Vec2) -> Vec2 {
    let mut p = target;
    let (mut value, mut jacobian) = f(p);
    for _ in 0..MAX_STEPS {
        let residual = value - target;
        if residual.abs().max_element() < TOLERANCE {
            break;
        }
        let Some(step) = solve_symmetric(jacobian, residual) else {
            return Vec2::NAN;
        };
        let improved = halvings().find_map(|scale| {
            let candidate = p - scale * step;
            let at = f(candidate);
            ((at.0 - target).length_squared() < residual.length_squared())
                .then_some((candidate, at))
        });
        let Some((next, at)) = improved else { break };
        p = next;
        (value, jacobian) = at;
    }
    let close = (value - target).abs().max_element() < LOOSE_TOLERANCE * (1.0 + p.length());
    if close && jacobian[0] > 0.0 && determinant(jacobian) > 0.0 {
        p
    } else {
        Vec2::NAN
    }
}

/// Solves `f(t) = target` for an `f` that starts at 0 and increases; NaN past its maximum.
pub(super) fn invert_increasing(f: impl Fn(f32) -> (f32, f32), target: f32) -> f32 {
    let mut t = target.min(std::f32::consts::FRAC_PI_2);
    let (mut value, mut slope) = f(t);
    for _ in 0..MAX_STEPS {
        let residual = value - target;
        if residual.abs() < TOLERANCE {
            break;
        }
        let step = residual / slope;
        let improved = halvings().find_map(|scale| {
            let candidate = t - scale * step;
            let at = f(candidate);
            ((at.0 - target).abs() < residual.abs()).then_some((candidate, at))
        });
        let Some((next, at)) = improved else { break };
        t = next;
        (value, slope) = at;
    }
    let close = (value - target).abs() < LOOSE_TOLERANCE;
    if close && slope > 0.0 { t } else { f32::NAN }
}

fn halvings() -> impl Iterator<Item = f32> {
    (0..8).map(|k| 0.5f32.powi(k))
}

fn determinant([xx, xy, yy]: [f32; 3]) -> f32 {
    xx * yy - xy * xy
}

fn solve_symmetric(m: [f32; 3], b: Vec2) -> Option<Vec2> {
    let [xx, xy, yy] = m;
    let det = determinant(m);
    let x = vec2(yy * b.x - xy * b.y, xx * b.y - xy * b.x) / det;
    x.is_finite().then_some(x)
}
