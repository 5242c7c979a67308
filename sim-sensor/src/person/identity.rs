//! Who the person is: betas drawn from the shape space.

use effigy_registration::BodyModel;
use glam::Vec3;

use crate::random::Randomness;

/// Adults between these heights; seeded draws outside are drawn again.
const HEIGHT_M: [f32; 2] = [1.50, 1.95];
/// Betas are standard normal in the population; beyond this they are cut.
const BETA_LIMIT: f32 = 2.2;
const MAX_DRAWS: u64 = 64;

/// Betas of a plausible adult: normal, cut at the limit, with a height in range.
pub fn sample_betas(body: &BodyModel, seed: u64) -> [f32; 10] {
    let random = Randomness::new(seed, 0, 0x1de7);
    let mut betas = [0.0; 10];
    for draw in 0..MAX_DRAWS {
        // Should nothing fit, draws come ever closer to the average body.
        let scale = 1.0 - draw as f32 / MAX_DRAWS as f32;
        betas = std::array::from_fn(|i| {
            scale
                * random
                    .gaussian(draw * 16 + i as u64)
                    .clamp(-BETA_LIMIT, BETA_LIMIT)
        });
        let height = height_m(&body.shaped_vertices(&betas));
        if (HEIGHT_M[0]..=HEIGHT_M[1]).contains(&height) {
            break;
        }
    }
    betas
}

pub(super) fn height_m(vertices: &[Vec3]) -> f32 {
    let top = vertices.iter().map(|v| v.y).fold(f32::MIN, f32::max);
    let bottom = vertices.iter().map(|v| v.y).fold(f32::MAX, f32::min);
    (top - bottom).max(0.0)
}
