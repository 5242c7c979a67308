//! What the person looks like to a colour camera and to infrared light.

use effigy_registration::smpl::VertexWeights;
use glam::{Vec3, Vec4, vec4};

use super::tailor::Tailoring;
use crate::random::Randomness;

/// Which material is seen where. Covers are interpolated over triangles and cut at one half, so that edges of
/// garments are as sharp as the image.
#[derive(Clone, Debug)]
pub struct Paint {
    /// Shares of trousers, shirt, shoe and hair at each vertex.
    covers: Vec<Vec4>,
    skin: Material,
    layers: [Material; 4],
    /// Garments of their own: the vertices that follow the body's, one material each.
    garments: Vec<(usize, Material)>,
}

/// An sRGB colour, and the share of infrared light returned, which is often far from the brightness.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Material {
    pub color: [u8; 3],
    pub reflectance: f32,
}

const SKINS: [Material; 4] = [
    Material { color: [231, 190, 165], reflectance: 0.60 },
    Material { color: [205, 155, 122], reflectance: 0.58 },
    Material { color: [160, 112, 84], reflectance: 0.52 },
    Material { color: [112, 76, 58], reflectance: 0.45 },
];
const SHIRTS: [Material; 6] = [
    Material { color: [62, 104, 160], reflectance: 0.60 },
    Material { color: [178, 66, 62], reflectance: 0.65 },
    Material { color: [226, 222, 212], reflectance: 0.85 },
    Material { color: [72, 132, 104], reflectance: 0.60 },
    Material { color: [206, 164, 72], reflectance: 0.70 },
    Material { color: [92, 88, 98], reflectance: 0.35 },
];
const TROUSERS: [Material; 4] = [
    Material { color: [68, 78, 108], reflectance: 0.50 },
    Material { color: [128, 114, 92], reflectance: 0.60 },
    Material { color: [84, 86, 90], reflectance: 0.40 },
    Material { color: [54, 58, 72], reflectance: 0.45 },
];
const HAIR: [Material; 4] = [
    Material { color: [46, 34, 30], reflectance: 0.14 },
    Material { color: [92, 62, 40], reflectance: 0.20 },
    Material { color: [172, 136, 84], reflectance: 0.32 },
    Material { color: [28, 26, 28], reflectance: 0.10 },
];
const FEET: [u8; 4] = [7, 8, 10, 11];
const SHOES: Material = Material { color: [66, 58, 56], reflectance: 0.30 };

impl Paint {
    pub(super) fn new(tailoring: &Tailoring, seed: u64) -> Self {
        let random = Randomness::new(seed, 0, 0xc0);
        let covers = tailoring.cuts.iter();
        Self {
            covers: covers
                .map(|cut| vec4(cut.trousers, cut.shirt, cut.shoe, cut.hair))
                .collect(),
            ..Self::materials(random)
        }
    }

    /// Skin, hair and clothes of somebody, on no vertex yet.
    fn materials(random: Randomness) -> Self {
        Self {
            covers: Vec::new(),
            skin: pick(&SKINS, random, 0),
            layers: [
                pick(&TROUSERS, random, 2),
                pick(&SHIRTS, random, 1),
                SHOES,
                pick(&HAIR, random, 3),
            ],
            garments: Vec::new(),
        }
    }

    /// Somebody else's character, of whose pictures nothing is left: trousers on legs, a shirt on trunk and arms,
    /// shoes, and hair on the upper part of the head.
    pub fn of_bones(weights: &[VertexWeights], hair: &[bool], seed: u64) -> Self {
        let random = Randomness::new(seed, 0, 0xc0);
        let cover = |(weights, hair): (&VertexWeights, &bool)| {
            let skin = share(weights, &[12, 15, 20, 21, 22, 23]);
            let (trousers, shoe) = (share(weights, &[1, 2, 4, 5]), share(weights, &FEET));
            let shirt = 1.0 - skin - trousers - shoe;
            vec4(trousers, shirt, shoe, f32::from(u8::from(*hair)))
        };
        Self { covers: weights.iter().zip(hair).map(cover).collect(), ..Self::materials(random) }
    }

    /// Somebody in shoes and nothing else that is painted on: clothes are garments of their own.
    pub(crate) fn of_bare_skin(weights: &[VertexWeights], hair: &[bool], seed: u64) -> Self {
        let cover = |(weights, hair): (&VertexWeights, &bool)| {
            vec4(0.0, 0.0, share(weights, &FEET), f32::from(u8::from(*hair)))
        };
        let covers = weights.iter().zip(hair).map(cover).collect();
        Self { covers, ..Self::materials(Randomness::new(seed, 0, 0xc0)) }
    }

    /// For a mesh in which these garments, each with so many vertices, follow the body.
    pub fn with_garments(mut self, garments: impl Iterator<Item = (usize, Material)>) -> Self {
        let mut end = self.covers.len();
        self.garments = garments
            .map(|(count, material)| {
                end += count;
                (end, material)
            })
            .collect();
        self
    }

    /// The material at a point of a triangle.
    pub fn at(&self, corners: [usize; 3], weights: Vec3) -> Material {
        if let Some(&of_cloth) = corners.iter().find(|&&corner| corner >= self.covers.len()) {
            return self.garment_at(of_cloth);
        }
        let cover: Vec4 = (0..3).map(|k| self.covers[corners[k]] * weights[k]).sum();
        self.outermost(cover)
    }

    pub fn vertex_colors(&self) -> Vec<[u8; 3]> {
        self.covers
            .iter()
            .map(|&cover| self.outermost(cover).color)
            .chain(
                (self.covers.len()..self.garments.last().map_or(0, |g| g.0))
                    .map(|v| self.garment_at(v).color),
            )
            .collect()
    }

    fn garment_at(&self, vertex: usize) -> Material {
        let found = self.garments.iter().find(|(end, _)| vertex < *end);
        found.map_or(self.skin, |&(_, material)| material)
    }

    fn outermost(&self, cover: Vec4) -> Material {
        (0..4)
            .rev()
            .find(|&k| cover[k] > 0.5)
            .map_or(self.skin, |k| self.layers[k])
    }
}

/// How much of a vertex moves with these bones.
fn share(weights: &VertexWeights, bones: &[u8]) -> f32 {
    let of = weights.bones.iter().zip(&weights.weights);
    of.filter(|(bone, _)| bones.contains(bone))
        .map(|(_, weight)| weight)
        .sum()
}

fn pick(materials: &[Material], random: Randomness, at: u64) -> Material {
    materials[(random.uniform(at) * materials.len() as f32) as usize % materials.len()]
}
