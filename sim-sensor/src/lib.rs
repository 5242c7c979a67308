//! A simulated depth camera with a clothed, moving person in front of it, and the truth beside it.
//!
//! In: a [`Scenario`] and a body model. Out: [`effigy_capture::Frame`]s through [`SimulatedSensor`], and
//! [`GroundTruth`] for each of them. World space: y up, floor at y = 0, metres; the person stands at the
//! origin and the camera looks along -z. Everything follows from the scenario's seed, bit for bit.

pub mod cloth;
pub mod dataset;
pub mod error;
pub mod measure;
pub mod noise;
pub mod person;
pub mod population;
pub mod preset;
mod random;
pub mod render;
pub mod scenario;
mod scene;
pub mod sensor;
pub mod stranger;
pub mod truth;

pub use error::SimError;
pub use person::{Outfit, OutfitKind, Person};
pub use preset::{Mount, SensorPreset};
pub use scenario::{Likeness, MotionChoice, Noise, Room, Scenario};
pub use sensor::SimulatedSensor;
pub use stranger::{StrangerChoice, StrangerTruth};
pub use truth::{ClothTruth, GroundTruth, Truth};
