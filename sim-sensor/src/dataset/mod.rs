//! Data sets of simulated people: complete truth for each frame, from one seed, made in parallel and resumed where
//! it was interrupted.
//!
//! Out: a folder with `manifest.json` and an `.npz` archive a sequence (one person in one outfit doing one thing).
//! Surfaces are kept in star pose; posed surfaces and depth images follow from them exactly, so they are not stored.

mod archive;
mod cape;
mod coding;
mod earlier;
mod history;
mod make;
mod manifest;
mod minimal;
mod outfit_name;
mod packing;
mod plan;
mod sequence;
#[cfg(test)]
mod tests;
mod view;

pub use cape::{CapeImport, Gender, import_cape};
pub use history::ClothFacts;
pub use make::{MakeProgress, make};
pub use manifest::{DATASET_SCHEMA, Dataset, Manifest, SequenceEntry};
pub use minimal::MinimalBody;
pub use outfit_name::OutfitName;
pub use plan::{DatasetPlan, DatasetPreset, GENERATOR, Role, SequencePlan, Split};
pub use sequence::{Sequence, SequenceFrame};
pub use view::{SensorShot, protocol_camera};
