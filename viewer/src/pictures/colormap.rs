//! Numbers as colours: warm and bright for small shares, deep blue for large ones.

use std::sync::LazyLock;

/// `sum_k coefficient[k] * share^k` for red, green, blue, in sRGB of 0..=1. A least-squares fit (largest
/// error 0.01) to a path through Oklab: lightness falls evenly from 0.90 to 0.26 while the hue turns from
/// yellow (88 degrees) over red to blue (-92), so that equal steps look equal, in grey as well.
const NEAR_TO_FAR: [[f32; 7]; 3] = [
    [1.0037, -0.2953, 4.3713, -20.0436, 29.9961, -20.4155, 5.4583],
    [0.8506, -1.2611, -0.6475, 0.1429, 7.2827, -10.2104, 3.9684],
    [0.4549, -1.7845, 4.9836, 3.5762, -21.3851, 21.4247, -6.9754],
];

static TABLE: LazyLock<[[u8; 3]; 256]> =
    LazyLock::new(|| std::array::from_fn(|i| color_of_share(i as f32 / 255.0)));

/// The colour of a share between nearest (0, light yellow) and farthest (1, dark blue).
pub fn color_of_share(share: f32) -> [u8; 3] {
    let share = share.clamp(0.0, 1.0);
    NEAR_TO_FAR.map(|coefficients| {
        let value = coefficients
            .iter()
            .rev()
            .fold(0.0, |sum, &c| sum * share + c);
        (value.clamp(0.0, 1.0) * 255.0).round() as u8
    })
}

/// As [`color_of_share`], from a table of 256 steps: for every pixel of a stream.
pub fn near_to_far(value: f32, nearest: f32, farthest: f32) -> [u8; 3] {
    let share = (value - nearest) / (farthest - nearest);
    // A cast from NaN gives 0, and casts saturate: no value is out of the table.
    TABLE[(share.clamp(0.0, 1.0) * 255.0) as usize]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn luma(color: [u8; 3]) -> f32 {
        0.2126 * f32::from(color[0]) + 0.7152 * f32::from(color[1]) + 0.0722 * f32::from(color[2])
    }

    #[test]
    fn farther_is_never_brighter() {
        let lumas: Vec<f32> = (0..=64)
            .map(|i| luma(color_of_share(i as f32 / 64.0)))
            .collect();
        // One step of rounding in each channel.
        assert!(lumas.windows(2).all(|pair| pair[1] <= pair[0] + 1.0));
        assert!(lumas[0] > 200.0 && lumas[64] < 40.0);
    }

    #[test]
    fn the_table_agrees_with_the_polynomial_and_bears_nan() {
        assert_eq!(near_to_far(1.0, 1.0, 3.0), color_of_share(0.0));
        assert_eq!(near_to_far(9.0, 1.0, 3.0), color_of_share(1.0));
        assert_eq!(near_to_far(f32::NAN, 1.0, 3.0), color_of_share(0.0));
    }
}
