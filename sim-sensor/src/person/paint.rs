//! What the person looks like to a colour camera and to infrared light.

use super::{chart::Chart, tailor::Tailoring};
use crate::random::Randomness;

/// For each vertex: sRGB colour, and the share of infrared light it returns.
#[derive(Clone, Debug)]
pub struct Paint {
    pub colors: Vec<[u8; 3]>,
    pub reflectance: Vec<f32>,
}

/// A colour and its infrared reflectance, which is often far from its brightness.
#[derive(Clone, Copy)]
struct Material {
    color: [f32; 3],
    reflectance: f32,
}

const SKINS: [Material; 4] = [
    Material { color: [231.0, 190.0, 165.0], reflectance: 0.60 },
    Material { color: [205.0, 155.0, 122.0], reflectance: 0.58 },
    Material { color: [150.0, 104.0, 78.0], reflectance: 0.52 },
    Material { color: [98.0, 66.0, 50.0], reflectance: 0.45 },
];
const SHIRTS: [Material; 6] = [
    Material { color: [62.0, 104.0, 160.0], reflectance: 0.60 },
    Material { color: [178.0, 66.0, 62.0], reflectance: 0.65 },
    Material { color: [226.0, 222.0, 212.0], reflectance: 0.85 },
    Material { color: [72.0, 132.0, 104.0], reflectance: 0.60 },
    Material { color: [206.0, 164.0, 72.0], reflectance: 0.70 },
    Material { color: [52.0, 50.0, 56.0], reflectance: 0.35 },
];
const TROUSERS: [Material; 4] = [
    Material { color: [58.0, 66.0, 92.0], reflectance: 0.50 },
    Material { color: [118.0, 104.0, 84.0], reflectance: 0.60 },
    Material { color: [70.0, 72.0, 74.0], reflectance: 0.40 },
    Material { color: [44.0, 46.0, 58.0], reflectance: 0.45 },
];
const HAIR: [Material; 4] = [
    Material { color: [40.0, 30.0, 26.0], reflectance: 0.14 },
    Material { color: [86.0, 58.0, 38.0], reflectance: 0.20 },
    Material { color: [172.0, 136.0, 84.0], reflectance: 0.32 },
    Material { color: [24.0, 22.0, 24.0], reflectance: 0.10 },
];
const SHOES: Material = Material { color: [66.0, 58.0, 56.0], reflectance: 0.30 };

impl Paint {
    pub(super) fn new(chart: &Chart, tailoring: &Tailoring, seed: u64) -> Self {
        let random = Randomness::new(seed, 0, 0xc0);
        let skin = pick(&SKINS, random, 0);
        let shirt = pick(&SHIRTS, random, 1);
        let trousers = pick(&TROUSERS, random, 2);
        let hair = pick(&HAIR, random, 3);
        let materials: Vec<Material> = tailoring
            .cuts
            .iter()
            .map(|cut| {
                skin.over(trousers, cut.trousers)
                    .over(shirt, cut.shirt)
                    .over(SHOES, cut.shoe)
                    .over(hair, cut.hair)
            })
            .collect();
        debug_assert_eq!(materials.len(), chart.vertices.len());
        Self {
            colors: materials.iter().map(|m| m.color.map(|c| c as u8)).collect(),
            reflectance: materials.iter().map(|m| m.reflectance).collect(),
        }
    }
}

impl Material {
    /// With another on top of it where that covers more than half.
    fn over(self, top: Self, cover: f32) -> Self {
        if cover > 0.5 { top } else { self }
    }
}

fn pick(materials: &[Material], random: Randomness, at: u64) -> Material {
    materials[(random.uniform(at) * materials.len() as f32) as usize % materials.len()]
}
