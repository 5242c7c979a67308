//! A surface averaged from many depth maps: truncated signed distances in blocks of voxels (Curless and
//! Levoy 1996; hashed as by Niessner et al. 2013).
//!
//! Distances are positive outside. A voxel stands for the grid point at its own coordinates times the
//! voxel size.

mod block;
mod extract;
mod integrate;
mod seen;
mod touch;

use effigy_capture::{CameraModel, Rigid3};
use glam::IVec3;
use rustc_hash::FxHashMap;
use serde::{Deserialize, Serialize};

pub use self::block::{BLOCK_SIDE, Voxel};
use self::{block::Block, seen::Seen};
use crate::maps::{NormalMap, VertexMap};

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct TsdfConfig {
    /// Half again what a pixel covers at 2 m: finer voxels would stay empty in between.
    pub voxel_size_m: f32,
    /// Half-width of the band around the surface: three sigma of the depth noise at 2 m, and enough that
    /// the band has voxels on both sides.
    pub truncation_voxels: f32,
    /// Old views lose their say once a voxel has this much weight.
    pub max_weight: f32,
    /// A voxel with less weight is not part of the mesh.
    pub min_weight: f32,
}

impl Default for TsdfConfig {
    fn default() -> Self {
        Self { voxel_size_m: 0.006, truncation_voxels: 4.0, max_weight: 200.0, min_weight: 0.5 }
    }
}

/// One depth map and where it was taken from.
#[derive(Clone, Copy, Debug)]
pub struct DepthView<'a> {
    /// What each pixel sees, in the camera's space.
    pub points: &'a VertexMap,
    /// With normals, distances are measured across the surface instead of along the ray.
    pub normals: Option<&'a NormalMap>,
    pub camera: &'a CameraModel,
    pub volume_from_camera: Rigid3,
}

/// Averages depth maps.
#[derive(Clone, Debug)]
pub struct TsdfVolume {
    config: TsdfConfig,
    blocks: Vec<Block>,
    index_of: FxHashMap<IVec3, u32>,
    /// Of the view being integrated; kept for the sake of its memory.
    seen: Seen,
}

impl TsdfVolume {
    pub fn new(config: TsdfConfig) -> Self {
        Self {
            config,
            blocks: Vec::new(),
            index_of: FxHashMap::default(),
            seen: Seen::default(),
        }
    }

    pub fn config(&self) -> &TsdfConfig {
        &self.config
    }

    pub fn block_count(&self) -> usize {
        self.blocks.len()
    }

    /// The voxel at a grid point, if its block exists.
    pub fn voxel(&self, at: IVec3) -> Option<Voxel> {
        let block = *self.index_of.get(&block::block_of(at))?;
        Some(self.blocks[block as usize].voxel(block::place_in_block(at)))
    }

    /// Forgets everything.
    pub fn clear(&mut self) {
        self.blocks.clear();
        self.index_of.clear();
    }
}
