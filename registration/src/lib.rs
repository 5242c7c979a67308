//! The body: SMPL model and files, motion, and how a body is fitted to depth and followed.
//!
//! In: `effigy_fusion::CleanFrame`s. Out: [`RegisteredFrame`]s: a [`BodyParams`] in world space
//! (y up, floor at y = 0, metres), or the word that the body is lost.

pub mod error;
pub mod motion;
pub mod registered;
pub mod smooth;
pub mod smpl;
pub mod track;

mod align;
mod correspond;
mod fit;
mod initialize;
mod observe;
mod prior;
mod recover;
mod residual;
mod solve;
mod state;
mod surface;
mod thickness;
mod world;

pub use align::EnergyConfig;
pub use error::RegistrationError;
pub use fit::FitConfig;
pub use initialize::InitializeConfig;
pub use registered::{RegisteredFrame, Tracking};
pub use smooth::{SmoothConfig, Smoother};
pub use smpl::{BodyModel, BodyParams, PosedBody};
pub use track::{Refiner, TrackConfig, Tracker};
