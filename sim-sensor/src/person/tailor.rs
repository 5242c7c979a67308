//! From an outfit to displacements of each vertex.

use effigy_registration::smpl::{JOINT_COUNT, PARENTS, VertexWeights};
use glam::{Mat3, Vec3};

use super::{
    bends,
    chart::{Chart, Place},
    folds::{Folds, SHIRT_JOINTS, TROUSER_JOINTS},
    outfit::{Garment, MIN_CLOTH_M, Outfit, Shoes},
    wrinkles::Wrinkles,
};
use crate::random::Randomness;

/// A garment's edge rises from the skin over this length: about one edge of the mesh.
const HEM_M: f32 = 0.018;
/// Tight cloth keeps this share of its ease.
const TIGHT_EASE: f32 = 0.4;
/// The collar's plane: its normal, and its height over the neck joint.
const COLLAR_UP: Vec3 = Vec3::new(0.0, 0.92, 0.39);
const COLLAR_M: f32 = 0.012;
/// Room kept between a leg's cloth and the body's middle plane.
const MIDLINE_GAP_M: f32 = 0.003;

/// What is fixed about one vertex's clothes.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Cut {
    /// Outwards, in the zero pose.
    direction: Vec3,
    /// Mean distance from the skin, small irregularities included.
    ease_m: f32,
    /// How far cloth may stand off before it meets the other leg.
    room_m: f32,
    sag: f32,
    /// Shares of shirt and trousers seen here; what is left is skin, hair or shoes.
    pub(super) shirt: f32,
    pub(super) trousers: f32,
    pub(super) shoe: f32,
    pub(super) hair: f32,
    /// Displacement that does not depend on pose: shoes and hair.
    fixed: Vec3,
}

/// An outfit cut to one body.
#[derive(Clone, Debug)]
pub(super) struct Tailoring {
    pub(super) cuts: Vec<Cut>,
    shirt: Option<(Garment, Folds)>,
    trousers: Option<(Garment, Folds)>,
}

impl Tailoring {
    pub(super) fn new(chart: &Chart, outfit: &Outfit, seed: u64) -> Self {
        let random = |purpose| Randomness::new(seed, 0, purpose);
        let wrinkles = Wrinkles::new(random(0x51));
        let cuts = (0..chart.vertices.len())
            .map(|v| cut(chart, v, outfit, &wrinkles))
            .collect();
        let folded = |garment: Option<Garment>, joints, purpose| {
            garment.map(|g| (g, Folds::new(chart, &g, joints, random(purpose))))
        };
        Self {
            cuts,
            shirt: folded(outfit.shirt, SHIRT_JOINTS, 0x52),
            trousers: folded(outfit.trousers, TROUSER_JOINTS, 0x53),
        }
    }

    /// Moves the zero-pose skin of a pose out to the clothes' outer surface.
    pub(super) fn dress(
        &self,
        vertices: &mut [Vec3],
        theta: &[Vec3; JOINT_COUNT],
        skinning: &[VertexWeights],
    ) {
        let bends = bends(theta);
        let down = gravity_in_rest(&bends);
        for (v, vertex) in vertices.iter_mut().enumerate() {
            let cut = &self.cuts[v];
            let cover = cut.cover();
            if cover > 0.0 {
                let height_m = self.stand_off_m(v, cut, &bends, &down, &skinning[v]);
                *vertex += cut.direction * height_m;
            }
            *vertex += cut.fixed;
        }
    }

    fn stand_off_m(
        &self,
        v: usize,
        cut: &Cut,
        bends: &[Mat3; JOINT_COUNT],
        down: &[Vec3; JOINT_COUNT],
        skinning: &VertexWeights,
    ) -> f32 {
        let mut fold_m = 0.0;
        let mut tight = 0.0;
        for (share, garment) in [
            (cut.shirt, &self.shirt),
            (cut.trousers * (1.0 - cut.shirt), &self.trousers),
        ] {
            if let (true, Some((garment, folds))) = (share > 0.0, garment) {
                let (height, pulled) = folds.at(v, bends);
                fold_m += share * garment.fold_m * height;
                tight += share * pulled;
            }
        }
        // Gravity moves the slack to the lower side of whatever carries the cloth.
        let down: Vec3 = skinning
            .bones
            .iter()
            .zip(&skinning.weights)
            .map(|(&bone, &weight)| down[bone as usize] * weight)
            .sum();
        let hang = 1.0 + cut.sag * cut.direction.dot(down);
        let ease_m = cut.ease_m * hang * (1.0 - (1.0 - TIGHT_EASE) * tight);
        let thinnest_m = MIN_CLOTH_M * cut.cover();
        (ease_m + fold_m).min(cut.room_m).max(thinnest_m)
    }
}

impl Cut {
    fn cover(&self) -> f32 {
        self.shirt.max(self.trousers)
    }
}

/// Which way is down, seen from each bone's zero-pose space.
fn gravity_in_rest(bends: &[Mat3; JOINT_COUNT]) -> [Vec3; JOINT_COUNT] {
    let mut world_from_bone = [Mat3::IDENTITY; JOINT_COUNT];
    for joint in 0..JOINT_COUNT {
        let local = bends[joint] + Mat3::IDENTITY;
        world_from_bone[joint] = if joint == 0 {
            local
        } else {
            world_from_bone[PARENTS[joint]] * local
        };
    }
    world_from_bone.map(|rotation| rotation.transpose() * Vec3::NEG_Y)
}

fn cut(chart: &Chart, v: usize, outfit: &Outfit, wrinkles: &Wrinkles) -> Cut {
    let place = &chart.places[v];
    let normal = chart.normals[v];
    let blended = (chart.smooth_normals[v] + normal * 0.5).normalize_or(normal);
    let direction = if blended.dot(normal) > 0.5 {
        blended
    } else {
        normal
    };
    let shirt = outfit
        .shirt
        .as_ref()
        .map_or(0.0, |g| shirt_cover(g, chart, v));
    let trousers = outfit
        .trousers
        .as_ref()
        .map_or(0.0, |g| trouser_cover(g, chart, v));
    let hollow_m = chart.hollow_m[v];
    let lump = wrinkles.lump(chart.vertices[v]);
    let wrinkle =
        |garment: &Garment, of_garment: f32| garment.drape(hollow_m, 0.4 * lump + of_garment);
    let mut cut = Cut { direction, room_m: f32::MAX, shirt, trousers, ..Cut::default() };
    if let Some(garment) = &outfit.trousers {
        let ease = garment.limb_share(place.leg, place.leg_share)
            + wrinkle(garment, wrinkles.trousers(chart, v));
        cut.ease_m = trousers * ease;
        cut.sag = garment.sag * trousers;
        cut.room_m = room_to_midline_m(chart, v, direction);
    }
    if let Some(garment) = &outfit.shirt {
        let hem = smoothstep(0.25, -0.10, place.trunk) * garment.flare_m * (1.0 - place.arm_share);
        let ease = garment.limb_share(place.arm, place.arm_share)
            + hem
            + wrinkle(garment, wrinkles.shirt(chart, v));
        cut.ease_m += shirt * ((cut.ease_m + MIN_CLOTH_M).max(ease) - cut.ease_m);
        cut.sag += shirt * (garment.sag - cut.sag);
    }
    if let Some(shoes) = outfit.shoes {
        dress_foot(&mut cut, chart, v, shoes);
    }
    if outfit.hair_m > 0.0 {
        cut.hair = hair_cover(chart, v);
        cut.fixed += normal * cut.hair * outfit.hair_m * (1.0 + 0.5 * lump);
    }
    cut
}

impl Garment {
    /// The ease of trunk and limb, blended where they meet, wider towards the limb's open end.
    fn limb_share(&self, along: f32, limb_share: f32) -> f32 {
        let flare = self.flare_m * smoothstep(0.2, 1.0, along / self.limb_end);
        self.trunk_ease_m + (self.limb_ease_m + flare - self.trunk_ease_m) * limb_share
    }

    /// Hollows that cloth spans, and its small irregularities; loose cloth has more of both.
    fn drape(&self, hollow_m: f32, lump: f32) -> f32 {
        let looseness = (self.trunk_ease_m / 0.016).min(1.3);
        hollow_m * looseness.min(1.0) + lump * self.fold_m
    }
}

/// A shirt covers trunk and arms between its hem, its sleeves' ends and the neck.
fn shirt_cover(garment: &Garment, chart: &Chart, v: usize) -> f32 {
    let place = &chart.places[v];
    let arm_m = limb_segment_m(chart, place, place.arm, [16, 18, 20]);
    let sleeve = smoothstep(0.0, -HEM_M, (place.arm - garment.limb_end) * arm_m);
    let hip_y = 0.5 * (chart.joints[1].y + chart.joints[2].y);
    let hem = smoothstep(
        0.0,
        HEM_M,
        chart.vertices[v].y - (hip_y - garment.trunk_end_m),
    );
    // The collar lies in a plane through the base of the neck, lower in front.
    let above_collar_m = (chart.vertices[v] - chart.joints[12]).dot(COLLAR_UP);
    let collar = smoothstep(COLLAR_M + HEM_M, COLLAR_M, above_collar_m);
    sleeve * hem * collar
}

/// Trousers cover everything from the waist to their legs' ends, hands excepted.
fn trouser_cover(garment: &Garment, chart: &Chart, v: usize) -> f32 {
    let place = &chart.places[v];
    let leg_m = limb_segment_m(chart, place, place.leg, [1, 4, 7]);
    let end = smoothstep(0.0, -HEM_M, (place.leg - garment.limb_end) * leg_m);
    let hip_y = 0.5 * (chart.joints[1].y + chart.joints[2].y);
    let waist = smoothstep(
        0.0,
        HEM_M,
        hip_y + garment.trunk_end_m - chart.vertices[v].y,
    );
    end * waist * (1.0 - place.arm_share)
}

/// The length of the limb's segment a coordinate lies on: upper or lower.
fn limb_segment_m(chart: &Chart, place: &Place, along: f32, joints: [usize; 3]) -> f32 {
    let at = |k: usize| chart.joints[joints[k] + place.side];
    if along < 1.0 {
        at(0).distance(at(1))
    } else {
        at(1).distance(at(2))
    }
}

fn room_to_midline_m(chart: &Chart, v: usize, direction: Vec3) -> f32 {
    let place = &chart.places[v];
    let sign = if place.side == 0 { 1.0 } else { -1.0 };
    let inwards = -direction.x * sign;
    if place.leg < -0.05 || inwards < 0.2 {
        return f32::MAX;
    }
    let gap_m = (chart.vertices[v].x - chart.joints[0].x) * sign - MIDLINE_GAP_M;
    (gap_m / inwards).max(0.0)
}

/// Uppers follow the foot, soles are flat.
fn dress_foot(cut: &mut Cut, chart: &Chart, v: usize, shoes: Shoes) {
    let place = &chart.places[v];
    let ankle = chart.joints[7 + place.side];
    let vertex = chart.vertices[v];
    let below = smoothstep(0.045, 0.020, vertex.y - ankle.y);
    let shoe = below * smoothstep(0.3, 0.7, place.foot_share);
    if shoe <= 0.0 {
        return;
    }
    cut.shoe = shoe;
    let sole_y = chart.sole_y[place.side];
    let normal = chart.smooth_normals[v];
    let mut offset = normal * (shoes.upper_m + 0.5 * chart.hollow_m[v].min(0.012));
    let on_sole = smoothstep(0.024, 0.004, vertex.y - sole_y);
    let flat_y = sole_y - shoes.sole_m - vertex.y;
    offset.y += (flat_y - offset.y) * on_sole;
    // Between toes the smoothed normal points anywhere; a shoe never goes into the foot.
    let outwards_m = offset.dot(chart.normals[v]);
    offset += chart.normals[v] * (MIN_CLOTH_M - outwards_m).max(0.0);
    cut.fixed += offset * shoe;
}

/// The scalp: above a line from the forehead's top to the nape.
fn hair_cover(chart: &Chart, v: usize) -> f32 {
    let place = &chart.places[v];
    if place.head_share < 0.5 {
        return 0.0;
    }
    let head = chart.joints[15];
    let height = (chart.head_top_y - head.y).max(0.05);
    let at = (chart.vertices[v] - head) / height;
    smoothstep(0.0, 0.08, 0.62 * (at.y - 0.50) - 0.75 * (at.z - 0.18))
}

/// 0 at `from`, 1 at `to` (which may be the smaller one), smooth between.
pub(crate) fn smoothstep(from: f32, to: f32, x: f32) -> f32 {
    let t = ((x - from) / (to - from)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}
