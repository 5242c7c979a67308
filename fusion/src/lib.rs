//! From raw depth to clean geometry: cleaning, person mask, vertex and normal maps, TSDF fusion, meshes.
//!
//! In: [`effigy_capture::Frame`]s. Out: [`CleanFrame`]s and [`TriangleMesh`]es, in the depth camera's
//! space (x right, y down, z forward, metres).

pub mod clean;
pub mod depth;
mod disjoint_sets;
pub mod error;
pub mod maps;
pub mod mesh;
mod normals;
pub mod simd;
pub mod tsdf;

pub use clean::{CleanConfig, CleanFrame, Cleaner};
pub use error::FusionError;
pub use maps::{DepthMap, NormalMap, VertexMap};
pub use mesh::TriangleMesh;
pub use tsdf::{TsdfConfig, TsdfVolume};
