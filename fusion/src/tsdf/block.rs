//! Voxels in cubes, so that empty space costs nothing.

use glam::{IVec3, ivec3};

/// Voxels along a block's side.
pub const BLOCK_SIDE: usize = 8;
const SIDE: i32 = BLOCK_SIDE as i32;
/// Voxels of one z.
pub(super) const LAYER: usize = BLOCK_SIDE * BLOCK_SIDE;
pub(super) const VOXELS: usize = LAYER * BLOCK_SIDE;

#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Voxel {
    /// Signed distance to the surface, positive outside, within the truncation.
    pub distance_m: f32,
    /// How much has been averaged; 0 means never seen.
    pub weight: f32,
}

/// What [`Voxel`] has one by one, of one z, `x` fastest: so that a vector unit handles several at once.
#[derive(Clone, Copy, Debug)]
pub(super) struct VoxelLayer {
    pub(super) distance_m: [f32; LAYER],
    pub(super) weight: [f32; LAYER],
}

impl VoxelLayer {
    const UNSEEN: Self = Self { distance_m: [0.0; LAYER], weight: [0.0; LAYER] };
}

#[derive(Clone, Debug)]
pub(super) struct Block {
    /// The block's place, in blocks.
    pub(super) at: IVec3,
    pub(super) layers: Box<[VoxelLayer; BLOCK_SIDE]>,
    /// Whether the view being integrated can reach it.
    pub(super) in_view: bool,
}

impl Block {
    pub(super) fn new(at: IVec3) -> Self {
        Self { at, layers: Box::new([VoxelLayer::UNSEEN; BLOCK_SIDE]), in_view: true }
    }

    pub(super) fn voxel(&self, voxel: usize) -> Voxel {
        let (layer, place) = (&self.layers[voxel / LAYER], voxel % LAYER);
        Voxel { distance_m: layer.distance_m[place], weight: layer.weight[place] }
    }

    /// The grid point of a voxel.
    pub(super) fn grid_point(&self, voxel: usize) -> IVec3 {
        let place = ivec3(
            (voxel % BLOCK_SIDE) as i32,
            (voxel / BLOCK_SIDE % BLOCK_SIDE) as i32,
            (voxel / BLOCK_SIDE / BLOCK_SIDE) as i32,
        );
        self.at * SIDE + place
    }
}

/// The block a grid point lies in.
pub(super) fn block_of(at: IVec3) -> IVec3 {
    at.div_euclid(IVec3::splat(SIDE))
}

/// A grid point's place among its block's voxels.
pub(super) fn place_in_block(at: IVec3) -> usize {
    let place = at.rem_euclid(IVec3::splat(SIDE)).as_usizevec3();
    place.x + BLOCK_SIDE * (place.y + BLOCK_SIDE * place.z)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_voxel_is_found_at_its_grid_point() {
        let block = Block::new(ivec3(-2, 0, 3));
        for voxel in 0..VOXELS {
            let point = block.grid_point(voxel);
            assert_eq!((block_of(point), place_in_block(point)), (block.at, voxel));
        }
    }
}
