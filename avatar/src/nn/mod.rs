//! The few pieces of neural network that the field, the hypernetwork and their training share.
//!
//! Matrices are row-major `f32` slices; a batch has one row an element. Nothing here starts a thread.

pub(crate) mod adam;
pub(crate) mod convolution;
pub(crate) mod dense;
pub(crate) mod field_mlp;
pub(crate) mod file;
#[cfg(test)]
mod gradient_tests;
pub(crate) mod group_norm;
pub(crate) mod layer_norm;
pub(crate) mod layout;
pub(crate) mod linear;
pub(crate) mod matmul;
pub(crate) mod residual;
pub mod threads;
pub(crate) mod unet;

pub use adam::{AdamConfig, AdamStep};
pub use threads::{Threads, ThreadsConfig};

/// `out = left right`, row-major, `right` a square of this width, on one thread: what the kernels are built on, for
/// measuring how near to it they come.
///
/// # Panics
/// If a slice is too short for the rows that `left` has.
pub fn square_product(out: &mut [f32], left: &[f32], right: &[f32], width: usize) {
    let rows = left.len() / width;
    let (left, right) = (
        matmul::View::new(left, rows, width),
        matmul::View::new(right, width, width),
    );
    matmul::multiply(out, matmul::Write::Replace, left, right);
}
