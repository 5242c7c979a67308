//! The few colours of every picture and of the window, sRGB.

/// Behind everything.
pub const BACKGROUND: [u8; 3] = [16, 18, 22];
/// Behind one picture.
pub const PANEL: [u8; 3] = [24, 27, 32];
/// Lines between things.
pub const LINE: [u8; 3] = [46, 51, 60];
pub const TEXT: [u8; 3] = [226, 229, 234];
pub const TEXT_DIM: [u8; 3] = [146, 153, 164];
/// The fitted body.
pub const BODY: [u8; 3] = [82, 196, 208];
/// The avatar, and the true surface beside it.
pub const CLAY: [u8; 3] = [206, 194, 180];
pub const GOOD: [u8; 3] = [108, 196, 138];
pub const WAITING: [u8; 3] = [232, 184, 92];
pub const BAD: [u8; 3] = [228, 106, 98];

/// Moves a colour towards another; 0 keeps it, 1 replaces it.
pub fn mix(from: [u8; 3], to: [u8; 3], share: f32) -> [u8; 3] {
    let share = share.clamp(0.0, 1.0);
    std::array::from_fn(|i| {
        (f32::from(from[i]) + (f32::from(to[i]) - f32::from(from[i])) * share).round() as u8
    })
}

/// An sRGB byte as linear light in 0..=1.
pub(crate) fn linear_from_srgb(value: u8) -> f32 {
    let share = f32::from(value) / 255.0;
    if share <= 0.04045 {
        share / 12.92
    } else {
        ((share + 0.055) / 1.055).powf(2.4)
    }
}

/// Linear light as an sRGB byte; what is too bright is cut off.
pub(crate) fn srgb_from_linear(light: f32) -> u8 {
    let light = light.clamp(0.0, 1.0);
    let share = if light <= 0.0031308 {
        light * 12.92
    } else {
        1.055 * light.powf(1.0 / 2.4) - 0.055
    };
    (share * 255.0).round() as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_srgb_byte_survives_linear_light() {
        for value in 0..=255 {
            assert_eq!(srgb_from_linear(linear_from_srgb(value)), value);
        }
    }

    #[test]
    fn mixing_halfway_is_the_mean_colour() {
        assert_eq!(mix([0, 100, 200], [100, 200, 0], 0.5), [50, 150, 100]);
    }
}
