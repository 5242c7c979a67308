//! Pictures drawn on the CPU: no display, no graphics adapter.
//!
//! Meshes come in world space (y up, metres), frames in the depth camera's. Everything comes out as an
//! 8-bit sRGB [`Picture`] on a dark neutral ground.

mod camera;
mod colormap;
mod contact_sheet;
mod crevices;
mod depth;
mod font;
mod framing;
mod heat;
mod mesh;
mod overlay;
pub mod palette;
pub(crate) mod shade;
mod text;

pub use camera::PictureCamera;
pub use colormap::{color_of_share, near_to_far};
pub use contact_sheet::{ContactSheet, save, side_by_side};
pub use depth::{DepthRange, clean_picture, depth_picture, outline_person, raw_depth_picture};
pub use framing::Framing;
pub use heat::{HeatScale, draw_legend, heat_picture};
pub use mesh::MeshView;
pub use overlay::{OverlayStyle, body_over_depth};
pub use shade::{Clay, render_mesh};
pub use text::{draw_text, text_width_px};

/// 8 bits a channel, sRGB.
pub type Picture = image::RgbImage;
