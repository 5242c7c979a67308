//! What people wear, as a tailor would write it down.

use serde::{Deserialize, Serialize};

use crate::{cloth::ClothKind, random::Randomness};

/// The outfits a scenario can ask for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum OutfitKind {
    /// Nothing at all: the surface is the minimal body's.
    Bare,
    /// T-shirt and slim trousers, a few millimetres from the skin.
    CloseFitting,
    /// Wide long-sleeved shirt and wide trousers.
    Loose,
    /// Loose T-shirt and shorts.
    Sport,
    /// Long-sleeved shirt worn over straight trousers: what the demo shows.
    #[default]
    Demo,
    /// One of the above (never `bare`) with sizes and colours of its own, from the seed.
    Random,
    /// Simulated cloth, over shoes: see [`crate::cloth`].
    #[serde(rename = "tshirt-trousers")]
    TshirtTrousers,
    #[serde(rename = "tshirt-shorts")]
    TshirtShorts,
    #[serde(rename = "longsleeve-trousers")]
    LongsleeveTrousers,
    #[serde(rename = "longsleeve-wide-trousers")]
    LongsleeveWideTrousers,
    #[serde(rename = "polo-trousers")]
    PoloTrousers,
    #[serde(rename = "hoodie-trousers")]
    HoodieTrousers,
    #[serde(rename = "cardigan-trousers")]
    CardiganTrousers,
    #[serde(rename = "blazer-trousers")]
    BlazerTrousers,
    Skirt,
    Dress,
}

/// Everything on top of the skin.
#[derive(Clone, Debug, PartialEq)]
pub struct Outfit {
    pub shirt: Option<Garment>,
    pub trousers: Option<Garment>,
    pub shoes: Option<Shoes>,
    /// How far the hair stands from the skull.
    pub hair_m: f32,
}

/// A shirt or a pair of trousers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Garment {
    /// Where it ends on the limb: 1 is elbow or knee, 2 is wrist or ankle.
    pub limb_end: f32,
    /// Where it ends on the trunk: metres above the hips for trousers, below the hips for a shirt.
    pub trunk_end_m: f32,
    /// Mean distance from the skin on the trunk and on the limbs.
    pub trunk_ease_m: f32,
    pub limb_ease_m: f32,
    /// How much wider it is at its open ends.
    pub flare_m: f32,
    /// Height of the folds that bending a joint raises.
    pub fold_m: f32,
    pub fold_wavelength_m: f32,
    /// 0 clings, 1 hangs: how much of the ease gravity pulls to the lower side.
    pub sag: f32,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shoes {
    pub upper_m: f32,
    pub sole_m: f32,
}

/// Cloth is never thinner than this, so that it stays outside the body.
pub(super) const MIN_CLOTH_M: f32 = 0.002;

const SHOES: Shoes = Shoes { upper_m: 0.006, sole_m: 0.016 };

impl OutfitKind {
    /// As scenarios spell it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Bare => "bare",
            Self::CloseFitting => "close_fitting",
            Self::Loose => "loose",
            Self::Sport => "sport",
            Self::Demo => "demo",
            Self::Random => "random",
            _ => self.cloth().map_or("cloth", ClothKind::name),
        }
    }

    /// The simulated clothes of this name, if it is one of those.
    pub fn cloth(self) -> Option<ClothKind> {
        match self {
            Self::TshirtTrousers => Some(ClothKind::TshirtTrousers),
            Self::TshirtShorts => Some(ClothKind::TshirtShorts),
            Self::LongsleeveTrousers => Some(ClothKind::LongsleeveTrousers),
            Self::LongsleeveWideTrousers => Some(ClothKind::LongsleeveWideTrousers),
            Self::PoloTrousers => Some(ClothKind::PoloTrousers),
            Self::HoodieTrousers => Some(ClothKind::HoodieTrousers),
            Self::CardiganTrousers => Some(ClothKind::CardiganTrousers),
            Self::BlazerTrousers => Some(ClothKind::BlazerTrousers),
            Self::Skirt => Some(ClothKind::Skirt),
            Self::Dress => Some(ClothKind::Dress),
            Self::Bare
            | Self::CloseFitting
            | Self::Loose
            | Self::Sport
            | Self::Demo
            | Self::Random => None,
        }
    }
}

impl From<ClothKind> for OutfitKind {
    fn from(kind: ClothKind) -> Self {
        match kind {
            ClothKind::TshirtTrousers => Self::TshirtTrousers,
            ClothKind::TshirtShorts => Self::TshirtShorts,
            ClothKind::LongsleeveTrousers => Self::LongsleeveTrousers,
            ClothKind::LongsleeveWideTrousers => Self::LongsleeveWideTrousers,
            ClothKind::PoloTrousers => Self::PoloTrousers,
            ClothKind::HoodieTrousers => Self::HoodieTrousers,
            ClothKind::CardiganTrousers => Self::CardiganTrousers,
            ClothKind::BlazerTrousers => Self::BlazerTrousers,
            ClothKind::Skirt => Self::Skirt,
            ClothKind::Dress => Self::Dress,
        }
    }
}

impl Outfit {
    pub const BARE: Self = Self { shirt: None, trousers: None, shoes: None, hair_m: 0.0 };

    /// Shoes and hair: what simulated clothes are worn over.
    pub const UNDER: Self = Self { shirt: None, trousers: None, shoes: Some(SHOES), hair_m: 0.014 };

    /// The outfit of a kind; `seed` matters for random ones only.
    pub fn new(kind: OutfitKind, seed: u64) -> Self {
        match kind {
            OutfitKind::Bare => Self::BARE,
            OutfitKind::CloseFitting => Self::close_fitting(),
            OutfitKind::Loose => Self::loose(),
            OutfitKind::Sport => Self::sport(),
            OutfitKind::Demo => Self::demo(),
            OutfitKind::Random => Self::random(seed),
            // What is worn over these is simulated.
            _ => Self::UNDER,
        }
    }

    fn close_fitting() -> Self {
        let shirt = Garment {
            limb_end: 0.55,
            trunk_end_m: 0.02,
            trunk_ease_m: 0.005,
            limb_ease_m: 0.004,
            flare_m: 0.003,
            fold_m: 0.003,
            fold_wavelength_m: 0.055,
            sag: 0.2,
        };
        let trousers = Garment {
            limb_end: 1.97,
            trunk_end_m: 0.09,
            trunk_ease_m: 0.004,
            limb_ease_m: 0.005,
            flare_m: 0.003,
            fold_m: 0.004,
            fold_wavelength_m: 0.055,
            sag: 0.2,
        };
        Self { shirt: Some(shirt), trousers: Some(trousers), shoes: Some(SHOES), hair_m: 0.012 }
    }

    fn loose() -> Self {
        let shirt = Garment {
            limb_end: 1.88,
            trunk_end_m: 0.035,
            trunk_ease_m: 0.020,
            limb_ease_m: 0.020,
            flare_m: 0.014,
            fold_m: 0.013,
            fold_wavelength_m: 0.070,
            sag: 0.75,
        };
        let trousers = Garment {
            limb_end: 1.985,
            trunk_end_m: 0.09,
            trunk_ease_m: 0.012,
            limb_ease_m: 0.022,
            flare_m: 0.012,
            fold_m: 0.013,
            fold_wavelength_m: 0.075,
            sag: 0.65,
        };
        Self { shirt: Some(shirt), trousers: Some(trousers), shoes: Some(SHOES), hair_m: 0.020 }
    }

    fn sport() -> Self {
        let mut outfit = Self::loose();
        if let Some(shirt) = &mut outfit.shirt {
            *shirt = Garment { limb_end: 0.72, trunk_ease_m: 0.016, flare_m: 0.012, ..*shirt };
        }
        if let Some(trousers) = &mut outfit.trousers {
            *trousers = Garment { limb_end: 0.86, limb_ease_m: 0.018, flare_m: 0.018, ..*trousers };
        }
        outfit
    }

    fn demo() -> Self {
        let mut outfit = Self::loose();
        if let Some(shirt) = &mut outfit.shirt {
            *shirt = Garment { trunk_ease_m: 0.016, limb_ease_m: 0.015, flare_m: 0.010, ..*shirt };
        }
        if let Some(trousers) = &mut outfit.trousers {
            *trousers = Garment { limb_ease_m: 0.015, flare_m: 0.010, ..*trousers };
        }
        outfit
    }

    fn random(seed: u64) -> Self {
        let random = Randomness::new(seed, 0, 0x0f17);
        let bases = [
            Self::close_fitting(),
            Self::loose(),
            Self::sport(),
            Self::demo(),
        ];
        let base = &bases[(random.uniform(0) * bases.len() as f32) as usize % bases.len()];
        let varied =
            |garment: Option<Garment>, at: u64| garment.map(|garment| garment.varied(random, at));
        Self {
            shirt: varied(base.shirt, 10),
            trousers: varied(base.trousers, 20),
            shoes: base.shoes,
            hair_m: random.between(30, 0.003, 0.030),
        }
    }
}

impl Garment {
    fn varied(&self, random: Randomness, at: u64) -> Self {
        let size = random.between(at, 0.75, 1.25);
        // Long or short, but never ending right at a joint, where no tailor would.
        let limb_end = if random.uniform(at + 1) < 0.25 {
            random.between(at + 2, 0.5, 0.8)
        } else {
            self.limb_end + random.between(at + 2, -0.06, 0.04)
        };
        Self {
            limb_end,
            trunk_end_m: self.trunk_end_m + random.between(at + 3, -0.02, 0.02),
            trunk_ease_m: self.trunk_ease_m * size,
            limb_ease_m: self.limb_ease_m * size,
            flare_m: self.flare_m * random.between(at + 4, 0.7, 1.3),
            fold_m: self.fold_m * random.between(at + 5, 0.7, 1.15),
            fold_wavelength_m: self.fold_wavelength_m * random.between(at + 6, 0.85, 1.15),
            sag: self.sag * random.between(at + 7, 0.7, 1.2),
        }
    }
}
