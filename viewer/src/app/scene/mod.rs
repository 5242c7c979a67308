//! The avatar's own view: a mesh on a floor, drawn by the graphics adapter into a texture.
//!
//! The texture is drawn again only when the mesh, the camera or the size has changed: on a software
//! adapter that leaves the processor to the pipeline.

mod orbit;
mod renderer;
mod targets;
mod view;

pub(super) use orbit::Orbit;
pub(super) use view::SceneView;
