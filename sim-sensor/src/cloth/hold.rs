//! What keeps a garment on: the belt around the waist, or the seam around neck and shoulders.

use effigy_registration::smpl::VertexWeights;
use glam::Vec3;

use super::{
    cut::tucked_hem_m,
    form::Form,
    pattern::{Pattern, Top},
    sheet::Sheet,
};

/// Cloth this close below the waist is held by the belt.
const BELT_M: f32 = 0.028;
/// Belts give a little; so does what keeps a shirt in its place on the neck and shoulders.
const BELT_COMPLIANCE: f32 = 1e-4;
const NECK_COMPLIANCE: f32 = 3e-4;
/// Shirts slip under a belt when they are pulled.
const TUCKED_COMPLIANCE: f32 = 1e-3;
/// How far the seam of the neck and shoulders reaches from the neck's joint.
const NECK_SEAM_M: f32 = 0.09;

/// A point of a garment that is held in its place by a belt or a seam.
#[derive(Clone, Copy, Debug)]
pub(super) struct Held {
    pub(super) point: u32,
    /// Its place in the zero pose, and the bones of the trunk that move it.
    pub(super) at_rest: Vec3,
    pub(super) weights: VertexWeights,
    /// For unit mass, in seconds squared.
    pub(super) compliance: f32,
}

/// What keeps a garment on: a belt around the waist, or the seam around the neck.
pub(super) fn held(form: &Form, pattern: &Pattern, sheet: &Sheet) -> Vec<Held> {
    let waist_m = form.leg_height_m(0.0);
    let neck = form.joints[12];
    const WAIST: (&[u8], f32) = (&[0, 3], BELT_COMPLIANCE);
    const TUCKED: (&[u8], f32) = (&[0, 3], TUCKED_COMPLIANCE);
    const NECK: (&[u8], f32) = (&[6, 9, 12, 13, 14], NECK_COMPLIANCE);
    let holding = |point: Vec3| match pattern.top {
        Top::Waist { above_hips_m } => (point.y > waist_m + above_hips_m - BELT_M).then_some(WAIST),
        Top::Collar { .. } | Top::FoldedCollar { .. } => {
            let on_neck = point.z < neck.z + 0.02 && point.distance(neck) < NECK_SEAM_M;
            let under_belt = pattern.is_tucked_in() && point.y < tucked_hem_m(form) + BELT_M;
            if on_neck {
                Some(NECK)
            } else {
                under_belt.then_some(TUCKED)
            }
        }
        Top::Hood => None,
    };
    let held = |(v, &point): (usize, &Vec3)| {
        let (bones, compliance) = holding(point)?;
        let shares = form.bone_shares(point, false);
        let total: f32 = bones.iter().map(|&bone| shares[bone as usize]).sum();
        let mut weights = VertexWeights::default();
        weights.bones[0] = bones[0];
        weights.weights[0] = 1.0;
        if total > 0.01 {
            // The four strongest are enough: no point of a neck or waist has more.
            let mut order = bones.to_vec();
            order.sort_by(|&a, &b| shares[b as usize].total_cmp(&shares[a as usize]));
            let kept: f32 = order
                .iter()
                .take(4)
                .map(|&bone| shares[bone as usize])
                .sum();
            for (slot, &bone) in order.iter().take(4).enumerate() {
                weights.bones[slot] = bone;
                weights.weights[slot] = shares[bone as usize] / kept;
            }
        }
        let at_rest = form.at_rest(point, &weights);
        Some(Held { point: v as u32, at_rest, weights, compliance })
    };
    sheet.points.iter().enumerate().filter_map(held).collect()
}
