//! Data sets of simulated people: complete truth for each frame, from one seed, made in parallel and resumed where
//! it was interrupted.
//!
//! Out: a folder with `manifest.json` and an `.npz` archive a sequence (one person in one outfit doing one thing).
//! Surfaces are kept in star pose; posed surfaces and depth images follow from them exactly, so they are not stored.

mod archive;
mod make;
mod manifest;
mod plan;
mod sequence;
#[cfg(test)]
mod tests;

pub use make::{MakeProgress, make};
pub use manifest::{DATASET_SCHEMA, Dataset, Manifest, SequenceEntry};
pub use plan::{DatasetPlan, DatasetPreset, Role, SequencePlan, Split};
pub use sequence::{Sequence, SequenceFrame, protocol_camera};
