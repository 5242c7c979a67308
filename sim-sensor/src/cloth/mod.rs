//! Clothes as cloth: cut to a person, simulated on the moving body, with the truth about what can be seen.
//!
//! In: a [`crate::Person`] who wears shoes and hair only, an outfit's name, a size, a seed, and a movement.
//! Out: garments in world space for each frame. Cloth has a history: frames follow one another, and the same
//! pose looks different after another movement.

mod collider;
mod cut;
mod dyes;
mod envelope;
mod form;
mod hang;
mod hold;
mod let_out;
mod measure;
mod opening;
mod pattern;
mod remesh;
mod sew;
mod sheet;
mod sleeve;
mod solver;
mod tape;
mod wear;
mod weights;

#[cfg(test)]
mod physics_tests;
#[cfg(test)]
mod tests;

pub use envelope::ClothedSurface;
pub use measure::{Behaviour, rms_between_m, strays_m};
pub use pattern::{ClothKind, Ease, Fabric, Front, Limbs, Pattern, Top};
pub use sew::Garment;
pub use sheet::Sheet;
pub use tape::Tape;
pub use wear::{ClothConfig, ClothState, Wear};
