//! Steps that make a depth map better, one a file; each works in metres with NaN for "no measurement".

pub mod bilateral;
pub mod fill;
pub mod flying_pixels;
pub mod segment;
pub(crate) mod sigma;
pub mod tolerance;
