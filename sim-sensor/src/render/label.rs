//! What a pixel belongs to.

use effigy_registration::smpl::VertexWeights;

/// What a pixel sees; parts of the person by the bone that moves them most.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum Label {
    #[default]
    Nothing,
    Floor,
    Wall,
    Head,
    Trunk,
    UpperArm,
    Forearm,
    Hand,
    Thigh,
    Shin,
    Foot,
}

impl Label {
    pub fn is_person(self) -> bool {
        !matches!(self, Self::Nothing | Self::Floor | Self::Wall)
    }

    pub fn of_bone(bone: usize) -> Self {
        match bone {
            12 | 15 => Self::Head,
            16 | 17 => Self::UpperArm,
            18 | 19 => Self::Forearm,
            20..=23 => Self::Hand,
            1 | 2 => Self::Thigh,
            4 | 5 => Self::Shin,
            7 | 8 | 10 | 11 => Self::Foot,
            _ => Self::Trunk,
        }
    }

    pub(crate) fn of_weights(weights: &VertexWeights) -> Self {
        let best = (0..4).fold(0, |best, k| {
            if weights.weights[k] > weights.weights[best] {
                k
            } else {
                best
            }
        });
        Self::of_bone(weights.bones[best] as usize)
    }
}
