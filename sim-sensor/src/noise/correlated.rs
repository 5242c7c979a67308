//! Errors that neighbours share: whoever shares a matching window shares its mistakes.

use super::Shot;

/// Normal noise of deviation 1, alike over `2 * radius + 1` pixels: white noise under two boxes, so that likeness
/// fades instead of breaking off. Sums of 9 x 9 and more even numbers are as good as normal.
pub(super) fn correlated_noise(
    shot: Shot,
    purpose: u64,
    radius: usize,
    [width, height]: [usize; 2],
    noise: &mut Vec<f32>,
    scratch: &mut Vec<f32>,
) {
    let random = shot.randomness(purpose);
    let n = (2 * radius + 1) as f32;
    // What two boxes leave of white noise's variance, along each axis.
    let kept: f32 = (1..2 * n as i32)
        .map(|k| (n - (k as f32 - n).abs()) / (n * n))
        .map(|weight| weight * weight)
        .sum();
    let gain = 12f32.sqrt() / kept;
    noise.clear();
    noise.extend((0..width * height).map(|pixel| (random.uniform(pixel as u64) - 0.5) * gain));
    for _ in 0..2 {
        box_rows(noise, scratch, [width, height], radius);
        box_columns(scratch, noise, [width, height], radius);
    }
}

/// A moving mean along rows. The border wraps around, which keeps the variance there.
fn box_rows(from: &[f32], to: &mut Vec<f32>, [width, height]: [usize; 2], radius: usize) {
    to.resize(width * height, 0.0);
    let share = 1.0 / (2 * radius + 1) as f32;
    let mut padded = vec![0.0; width + 2 * radius];
    for y in 0..height {
        let row = &from[y * width..(y + 1) * width];
        padded[..radius].copy_from_slice(&row[width - radius..]);
        padded[radius..width + radius].copy_from_slice(row);
        padded[width + radius..].copy_from_slice(&row[..radius]);
        add_shifted(
            &mut to[y * width..(y + 1) * width],
            share,
            (0..=2 * radius).map(|k| &padded[k..]),
        );
    }
}

/// A moving mean along columns, wrapping likewise.
fn box_columns(from: &[f32], to: &mut Vec<f32>, [width, height]: [usize; 2], radius: usize) {
    to.resize(width * height, 0.0);
    let share = 1.0 / (2 * radius + 1) as f32;
    for y in 0..height {
        let rows = (0..=2 * radius).map(|k| &from[(y + k + height - radius) % height * width..]);
        add_shifted(&mut to[y * width..(y + 1) * width], share, rows);
    }
}

fn add_shifted<'a>(out: &mut [f32], share: f32, terms: impl Iterator<Item = &'a [f32]>) {
    out.fill(0.0);
    for term in terms {
        for (sum, value) in out.iter_mut().zip(term) {
            *sum += value * share;
        }
    }
}

/// The value below minus which a standard normal falls with this probability; enough for shares of 1e-4 to 0.1.
pub(super) fn normal_threshold(share: f32) -> f32 {
    let t = (-2.0 * share.clamp(1e-6, 0.4).ln()).sqrt();
    t - (2.30753 + 0.27061 * t) / (1.0 + 0.99229 * t + 0.04481 * t * t)
}
