//! Nonlinear least squares in double precision: normal equations and Levenberg-Marquardt.

mod levenberg_marquardt;
mod normal_equations;

pub(crate) use levenberg_marquardt::{Damping, Termination, shorten, take_step};
pub(crate) use normal_equations::{Eliminated, NormalEquations};
