//! Skinning weights of a garment: the body's, diffused over the cloth, so that what hangs between the legs
//! follows both and does not tear in star pose.

use effigy_registration::smpl::{JOINT_COUNT, VertexWeights};

use super::{form::Form, pattern::Pattern, sheet::Sheet};

/// Rounds of diffusion for cloth on the body, and for what hangs free.
const ROUNDS: usize = 12;
const HANGING_ROUNDS: usize = 300;
/// Around the hips, up to this far above their joints, shirts bend with what hangs from them.
const ABOVE_HIPS_M: f32 = 0.12;

/// Weights for each point of a garment in the form's pose.
pub(super) fn diffused(form: &Form, sheet: &Sheet, pattern: &Pattern) -> Vec<VertexWeights> {
    let hangs = pattern.hem.is_some();
    let seam_m = super::cut::seam_height_m(form);
    let mut shares: Vec<[f32; JOINT_COUNT]> = Vec::with_capacity(sheet.points.len());
    let bends_below_m = form.leg_height_m(0.0) + ABOVE_HIPS_M;
    let mut hanging = Vec::with_capacity(sheet.points.len());
    for &point in &sheet.points {
        let below = hangs && point.y < seam_m + 0.02 && form.trunk_side(point);
        hanging.push(hangs && point.y < bends_below_m && form.trunk_side(point));
        shares.push(form.bone_shares(point, below));
    }
    let neighbours = sheet.neighbours();
    let rounds = if hangs { HANGING_ROUNDS } else { ROUNDS };
    for round in 0..rounds {
        let before = shares.clone();
        for (v, share) in shares.iter_mut().enumerate() {
            let around = neighbours.get(v as u32);
            if around.is_empty() || (round >= ROUNDS && !hanging[v]) {
                continue;
            }
            for bone in 0..JOINT_COUNT {
                let mean = around
                    .iter()
                    .map(|&o| before[o as usize][bone])
                    .sum::<f32>()
                    / around.len() as f32;
                share[bone] += 0.5 * (mean - share[bone]);
            }
        }
    }
    shares.iter().map(largest_four).collect()
}

fn largest_four(shares: &[f32; JOINT_COUNT]) -> VertexWeights {
    let mut order: [usize; JOINT_COUNT] = std::array::from_fn(|bone| bone);
    order.sort_by(|&a, &b| shares[b].total_cmp(&shares[a]).then(a.cmp(&b)));
    let mut weights = VertexWeights::default();
    // Less the fifth, so that a bone fades out before it drops from the four.
    let least = shares[order[4]];
    let total: f32 = order[..4].iter().map(|&bone| shares[bone] - least).sum();
    for (slot, &bone) in order[..4].iter().enumerate() {
        weights.bones[slot] = bone as u8;
        weights.weights[slot] = (shares[bone] - least) / total.max(1e-6);
    }
    weights
}
