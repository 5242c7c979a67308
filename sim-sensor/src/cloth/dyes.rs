//! What cloth looks like, to a colour camera and in infrared light.

use crate::person::Material;

pub(super) const WHITE: Material = Material { color: [226, 222, 212], reflectance: 0.85 };
pub(super) const SHIRTS: [Material; 5] = [
    Material { color: [62, 104, 160], reflectance: 0.60 },
    Material { color: [178, 66, 62], reflectance: 0.65 },
    WHITE,
    Material { color: [72, 132, 104], reflectance: 0.60 },
    Material { color: [206, 164, 72], reflectance: 0.70 },
];
pub(super) const HOODIES: [Material; 3] = [
    Material { color: [120, 124, 132], reflectance: 0.55 },
    Material { color: [146, 62, 74], reflectance: 0.60 },
    Material { color: [74, 96, 88], reflectance: 0.50 },
];
pub(super) const TROUSERS: [Material; 4] = [
    Material { color: [68, 78, 108], reflectance: 0.50 },
    Material { color: [142, 128, 104], reflectance: 0.60 },
    Material { color: [84, 86, 90], reflectance: 0.40 },
    Material { color: [58, 62, 78], reflectance: 0.45 },
];
pub(super) const SUITS: [Material; 3] = [
    Material { color: [58, 66, 92], reflectance: 0.40 },
    Material { color: [112, 104, 96], reflectance: 0.45 },
    Material { color: [70, 72, 76], reflectance: 0.35 },
];
pub(super) const DRESSES: [Material; 4] = [
    Material { color: [156, 52, 84], reflectance: 0.60 },
    Material { color: [52, 112, 124], reflectance: 0.55 },
    Material { color: [196, 138, 92], reflectance: 0.65 },
    Material { color: [98, 84, 142], reflectance: 0.55 },
];
