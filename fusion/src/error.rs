//! What can go wrong in fusion and in mesh files.

use std::path::PathBuf;

#[derive(Debug, thiserror::Error)]
pub enum FusionError {
    #[error(
        "depth image is {got_px:?}, calibration expects {expected_px:?}; replay it with its own calibration"
    )]
    SizeMismatch { got_px: [u32; 2], expected_px: [u32; 2] },
    #[error("{path}: {source}")]
    Io { path: PathBuf, source: std::io::Error },
    #[error("the mesh has no triangles, so there is no nearest point on it")]
    EmptyMesh,
    #[error("a triangle names vertex {vertex}, but the mesh has only {count} of them")]
    MissingVertex { vertex: u32, count: usize },
    #[error("vertex {vertex} of the mesh is not a finite point; remove it or mend the file")]
    VertexNotFinite { vertex: usize },
    #[error("{path}, {place}: expected {expected}, found {found}; write the mesh again as PLY 1.0")]
    Ply { path: PathBuf, place: String, expected: String, found: String },
}
