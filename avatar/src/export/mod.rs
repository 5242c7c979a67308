//! Avatars for other programs.

mod buffer;
mod glb;
mod morph;
mod ply;
mod skeleton;

pub use glb::{GlbOptions, glb_bytes, write_glb};
pub use ply::write_ply;
