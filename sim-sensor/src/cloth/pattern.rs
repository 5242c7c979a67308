//! What a garment is, as a tailor would write it down, and the outfits made of them.

use super::dyes::{DRESSES, HOODIES, SHIRTS, SUITS, TROUSERS, WHITE};
use crate::{person::Material, random::Randomness};

/// One garment. Stations along limbs: arms 0 shoulder, 1 elbow, 2 wrist; legs 0 hip, 1 knee, 2 ankle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pattern {
    pub name: &'static str,
    pub top: Top,
    pub limbs: Limbs,
    /// Where a shirt or skirt ends, as a station of the leg. Trousers have none; a shirt without one is tucked in.
    pub hem: Option<f32>,
    pub front: Front,
    pub ease: Ease,
    pub fabric: Fabric,
    pub material: Material,
}

/// The upper edge.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Top {
    /// Around the neck: above its base, and how much lower in front.
    Collar { above_neck_m: f32, front_drop_m: f32 },
    /// As [`Self::Collar`], with a collar that stands and falls over.
    FoldedCollar { above_neck_m: f32, front_drop_m: f32 },
    /// Over the head, with an opening for the face.
    Hood,
    /// Around the waist, held by a belt.
    Waist { above_hips_m: f32 },
}

/// Which limbs it covers, and up to which station.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Limbs {
    Arms { end: f32 },
    Legs { end: f32 },
    None,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Front {
    Closed,
    /// Two free edges from the neck to the hem.
    Open,
}

/// Distance from the skin when it was cut.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ease {
    pub trunk_m: f32,
    pub limb_m: f32,
    /// At the limb's end.
    pub end_m: f32,
    /// At the hem, and how much the radius grows for each metre below the hips.
    pub hem_m: f32,
    pub flare: f32,
    /// Whether cuffs and hem are drawn together by ribs.
    pub ribbed: bool,
}

/// How cloth answers. Compliances are for unit mass: seconds squared.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fabric {
    pub stretch_compliance: f32,
    pub bend_compliance: f32,
    /// Coulomb's coefficient against skin and other cloth.
    pub friction: f32,
    /// Speed lost to the air, each second.
    pub drag: f32,
}

const JERSEY: Fabric =
    Fabric { stretch_compliance: 1.0e-7, bend_compliance: 4.0e-4, friction: 0.2, drag: 2.0 };
const FLEECE: Fabric = Fabric { bend_compliance: 5.0e-5, ..JERSEY };
const TWILL: Fabric =
    Fabric { stretch_compliance: 3.0e-8, bend_compliance: 8.0e-5, friction: 0.12, drag: 2.0 };
/// Lined: it slides over a shirt.
const SUITING: Fabric = Fabric { bend_compliance: 3.0e-5, friction: 0.1, ..TWILL };
const CREPE: Fabric = Fabric { bend_compliance: 6.0e-4, friction: 0.15, drag: 3.0, ..JERSEY };

/// Clothes by name, to be simulated.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum ClothKind {
    TshirtTrousers,
    TshirtShorts,
    LongsleeveTrousers,
    LongsleeveWideTrousers,
    PoloTrousers,
    HoodieTrousers,
    CardiganTrousers,
    BlazerTrousers,
    Skirt,
    Dress,
}

impl ClothKind {
    pub const ALL: [Self; 10] = [
        Self::TshirtTrousers,
        Self::TshirtShorts,
        Self::LongsleeveTrousers,
        Self::LongsleeveWideTrousers,
        Self::PoloTrousers,
        Self::HoodieTrousers,
        Self::CardiganTrousers,
        Self::BlazerTrousers,
        Self::Skirt,
        Self::Dress,
    ];

    pub fn name(self) -> &'static str {
        match self {
            Self::TshirtTrousers => "tshirt-trousers",
            Self::TshirtShorts => "tshirt-shorts",
            Self::LongsleeveTrousers => "longsleeve-trousers",
            Self::LongsleeveWideTrousers => "longsleeve-wide-trousers",
            Self::PoloTrousers => "polo-trousers",
            Self::HoodieTrousers => "hoodie-trousers",
            Self::CardiganTrousers => "cardigan-trousers",
            Self::BlazerTrousers => "blazer-trousers",
            Self::Skirt => "skirt",
            Self::Dress => "dress",
        }
    }

    /// How far a leg stands aside from the zero pose while clothes are cut.
    pub(crate) fn legs_apart_rad(self) -> f32 {
        match self {
            Self::Skirt | Self::Dress => 0.05,
            _ => 0.20,
        }
    }

    /// Garments from the innermost to the outermost. `fit` goes from tight (0) to loose (1); the seed varies
    /// lengths and colours.
    pub fn patterns(self, fit: f32, seed: u64) -> Vec<Pattern> {
        let tailor = Tailor { fit, random: Randomness::new(seed, 0, 0xc10) };
        match self {
            Self::TshirtTrousers => vec![tailor.slim_trousers(), tailor.tshirt()],
            Self::TshirtShorts => vec![tailor.shorts(), tailor.tshirt()],
            Self::LongsleeveTrousers => vec![tailor.slim_trousers(), tailor.longsleeve()],
            Self::LongsleeveWideTrousers => vec![tailor.wide_trousers(), tailor.longsleeve()],
            Self::PoloTrousers => vec![tailor.slim_trousers(), tailor.polo()],
            Self::HoodieTrousers => vec![tailor.slim_trousers(), tailor.hoodie()],
            Self::CardiganTrousers => {
                let close = Tailor { fit: 0.55, ..tailor };
                vec![
                    close.undershirt(),
                    tailor.slim_trousers(),
                    tailor.cardigan(),
                ]
            }
            Self::BlazerTrousers => {
                let close = Tailor { fit: 0.55, ..tailor };
                vec![close.undershirt(), tailor.suit_trousers(), tailor.blazer()]
            }
            Self::Skirt => {
                let close = Tailor { fit: 0.6 + 0.2 * fit, ..tailor };
                vec![close.tucked_in(), tailor.skirt()]
            }
            Self::Dress => vec![tailor.dress()],
        }
    }
}

impl Pattern {
    /// Whether they are trousers of any length.
    pub fn has_legs(&self) -> bool {
        matches!(self.limbs, Limbs::Legs { .. })
    }

    /// Whether it is a shirt that ends under a belt.
    pub fn is_tucked_in(&self) -> bool {
        self.hem.is_none() && matches!(self.limbs, Limbs::Arms { .. })
    }
}

/// Draws patterns in one size.
#[derive(Clone, Copy)]
struct Tailor {
    fit: f32,
    random: Randomness,
}

impl Tailor {
    /// From tight to loose, by the size.
    fn by_fit(&self, tight: f32, loose: f32) -> f32 {
        tight + (loose - tight) * self.fit
    }

    fn of(&self, materials: &[Material], at: u64) -> Material {
        materials[(self.random.uniform(at) * materials.len() as f32) as usize % materials.len()]
    }

    fn tshirt(&self) -> Pattern {
        let drop = self.random.between(1, 0.02, 0.04);
        Pattern {
            name: "T-shirt",
            top: Top::Collar { above_neck_m: 0.012, front_drop_m: drop },
            limbs: Limbs::Arms { end: self.random.between(2, 0.55, 0.70) },
            hem: Some(self.random.between(3, 0.10, 0.18)),
            front: Front::Closed,
            ease: Ease {
                trunk_m: self.by_fit(0.012, 0.042),
                limb_m: self.by_fit(0.008, 0.026),
                end_m: self.by_fit(0.009, 0.038),
                hem_m: self.by_fit(0.008, 0.050),
                flare: 0.0,
                ribbed: false,
            },
            fabric: JERSEY,
            material: self.of(&SHIRTS, 4),
        }
    }

    /// A T-shirt that ends under a belt.
    fn tucked_in(&self) -> Pattern {
        let shirt = self.tshirt();
        Pattern { name: "T-shirt, tucked in", hem: None, ..shirt }
    }

    /// Held by the neck and the belt, it has to give where arms go up: wide, and cut off above the sleeve's bend.
    fn undershirt(&self) -> Pattern {
        let mut shirt = self.tucked_in();
        shirt.name = "shirt under a jacket";
        shirt.limbs = Limbs::Arms { end: 0.35 };
        shirt.material = WHITE;
        shirt
    }

    fn longsleeve(&self) -> Pattern {
        let shirt = self.tshirt();
        Pattern {
            name: "long sleeve",
            limbs: Limbs::Arms { end: self.random.between(5, 1.86, 1.95) },
            ease: Ease {
                limb_m: self.by_fit(0.006, 0.028),
                end_m: self.by_fit(0.005, 0.020),
                ..shirt.ease
            },
            ..shirt
        }
    }

    fn polo(&self) -> Pattern {
        let shirt = self.tshirt();
        Pattern {
            name: "polo",
            top: Top::FoldedCollar { above_neck_m: 0.014, front_drop_m: 0.01 },
            fabric: Fabric { bend_compliance: 2.0e-4, ..JERSEY },
            ..shirt
        }
    }

    fn hoodie(&self) -> Pattern {
        Pattern {
            name: "hoodie",
            top: Top::Hood,
            limbs: Limbs::Arms { end: 1.94 },
            hem: Some(self.random.between(3, 0.12, 0.20)),
            front: Front::Closed,
            ease: Ease {
                trunk_m: self.by_fit(0.022, 0.055),
                limb_m: self.by_fit(0.014, 0.036),
                end_m: 0.006,
                hem_m: self.by_fit(0.012, 0.018),
                flare: 0.0,
                ribbed: true,
            },
            fabric: FLEECE,
            material: self.of(&HOODIES, 6),
        }
    }

    /// Knitted, soft and open in front, from waist length to the middle of the thigh.
    fn cardigan(&self) -> Pattern {
        Pattern {
            name: "cardigan",
            top: Top::Collar { above_neck_m: 0.006, front_drop_m: 0.02 },
            limbs: Limbs::Arms { end: self.random.between(16, 1.80, 1.94) },
            hem: Some(self.random.between(17, 0.12, 0.55)),
            front: Front::Open,
            ease: Ease {
                trunk_m: self.by_fit(0.026, 0.050),
                limb_m: self.by_fit(0.016, 0.034),
                end_m: self.by_fit(0.012, 0.028),
                hem_m: self.by_fit(0.026, 0.060),
                flare: self.random.between(18, 0.0, 0.20),
                ribbed: false,
            },
            fabric: Fabric { friction: 0.15, ..FLEECE },
            material: self.of(&HOODIES, 19),
        }
    }

    fn blazer(&self) -> Pattern {
        Pattern {
            name: "blazer",
            top: Top::Collar { above_neck_m: 0.008, front_drop_m: 0.0 },
            limbs: Limbs::Arms { end: 1.92 },
            hem: Some(self.random.between(7, 0.26, 0.36)),
            front: Front::Open,
            ease: Ease {
                trunk_m: self.by_fit(0.030, 0.050),
                limb_m: self.by_fit(0.022, 0.036),
                end_m: self.by_fit(0.020, 0.030),
                hem_m: self.by_fit(0.035, 0.055),
                flare: 0.15,
                ribbed: false,
            },
            fabric: SUITING,
            material: self.of(&SUITS, 8),
        }
    }

    fn slim_trousers(&self) -> Pattern {
        Pattern {
            name: "slim trousers",
            top: Top::Waist { above_hips_m: 0.10 },
            limbs: Limbs::Legs { end: self.random.between(9, 1.93, 1.98) },
            hem: None,
            front: Front::Closed,
            ease: Ease {
                trunk_m: self.by_fit(0.012, 0.018),
                limb_m: self.by_fit(0.011, 0.024),
                end_m: self.by_fit(0.008, 0.024),
                hem_m: 0.0,
                flare: 0.0,
                ribbed: false,
            },
            fabric: TWILL,
            material: self.of(&TROUSERS, 10),
        }
    }

    fn suit_trousers(&self) -> Pattern {
        let trousers = self.slim_trousers();
        Pattern {
            name: "suit trousers",
            ease: Ease {
                trunk_m: self.by_fit(0.010, 0.018),
                limb_m: self.by_fit(0.018, 0.034),
                end_m: self.by_fit(0.018, 0.036),
                ..trousers.ease
            },
            ..trousers
        }
    }

    fn wide_trousers(&self) -> Pattern {
        let trousers = self.slim_trousers();
        Pattern {
            name: "wide trousers",
            // Nothing holds them up at the ankles.
            limbs: Limbs::Legs { end: self.random.between(9, 1.82, 1.92) },
            ease: Ease {
                trunk_m: self.by_fit(0.010, 0.016),
                limb_m: self.by_fit(0.024, 0.040),
                end_m: self.by_fit(0.040, 0.070),
                ..trousers.ease
            },
            fabric: CREPE,
            ..trousers
        }
    }

    fn shorts(&self) -> Pattern {
        let trousers = self.slim_trousers();
        Pattern {
            name: "shorts",
            limbs: Limbs::Legs { end: self.random.between(11, 0.70, 0.90) },
            ease: Ease {
                limb_m: self.by_fit(0.010, 0.032),
                end_m: self.by_fit(0.012, 0.050),
                ..trousers.ease
            },
            ..trousers
        }
    }

    fn skirt(&self) -> Pattern {
        Pattern {
            name: "skirt",
            top: Top::Waist { above_hips_m: 0.10 },
            limbs: Limbs::None,
            hem: Some(self.random.between(12, 0.80, 1.10)),
            front: Front::Closed,
            ease: Ease {
                trunk_m: self.by_fit(0.018, 0.026),
                limb_m: 0.0,
                end_m: 0.0,
                hem_m: self.by_fit(0.020, 0.034),
                flare: self.by_fit(0.10, 0.38),
                ribbed: false,
            },
            fabric: CREPE,
            material: self.of(&DRESSES, 13),
        }
    }

    fn dress(&self) -> Pattern {
        Pattern {
            name: "dress",
            top: Top::Collar { above_neck_m: 0.0, front_drop_m: 0.05 },
            limbs: Limbs::Arms { end: self.random.between(14, 0.35, 0.55) },
            hem: Some(self.random.between(15, 0.85, 1.25)),
            front: Front::Closed,
            ease: Ease {
                trunk_m: self.by_fit(0.010, 0.022),
                limb_m: self.by_fit(0.008, 0.018),
                end_m: self.by_fit(0.008, 0.026),
                hem_m: self.by_fit(0.012, 0.028),
                flare: self.by_fit(0.15, 0.42),
                ribbed: false,
            },
            fabric: CREPE,
            material: self.of(&DRESSES, 13),
        }
    }
}
