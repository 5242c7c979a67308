//! The directions in which many long rows vary most.

use faer::{Mat, Side};

use crate::error::AvatarError;

/// The rows' mean, and the directions in which they vary most, of unit length. The eigenvectors of the rows' Gram
/// matrix give those of their covariance, which would be thousands a side.
pub(super) fn principal_components(
    rows: &[Vec<f32>],
    wanted: usize,
) -> Result<(Vec<f32>, Vec<Vec<f32>>), AvatarError> {
    /// Of the strongest mode's variance; below it is rounding.
    const LEAST: f64 = 1e-6;
    let count = rows.len() as f32;
    let width = rows[0].len();
    let mean: Vec<f32> = (0..width)
        .map(|i| rows.iter().map(|row| row[i]).sum::<f32>() / count)
        .collect();
    let centred: Vec<Vec<f32>> = rows
        .iter()
        .map(|row| {
            row.iter()
                .zip(&mean)
                .map(|(value, mean)| value - mean)
                .collect()
        })
        .collect();
    let gram = Mat::from_fn(rows.len(), rows.len(), |i, j| dot(&centred[i], &centred[j]));
    let eigen = gram
        .self_adjoint_eigen(Side::Lower)
        .map_err(|error| AvatarError::Export(format!("baking: offsets: {error:?}")))?;
    let strongest = eigen.S()[rows.len() - 1];
    let modes = (0..rows.len())
        .rev()
        .take(wanted)
        .take_while(|&k| eigen.S()[k] > LEAST * strongest && eigen.S()[k] > f64::MIN_POSITIVE)
        .map(|k| {
            let scale = eigen.S()[k].sqrt().recip();
            let mut mode = vec![0.0_f32; width];
            for (row, values) in centred.iter().enumerate() {
                let share = (eigen.U()[(row, k)] * scale) as f32;
                for (sum, value) in mode.iter_mut().zip(values) {
                    *sum += share * value;
                }
            }
            mode
        })
        .collect();
    Ok((mean, modes))
}

/// Writes the mean with so much of each mode.
pub(super) fn mix_into(
    row: &mut Vec<f32>,
    mean: &[f32],
    modes: &[Vec<f32>],
    weights: impl Iterator<Item = f32>,
) {
    row.clear();
    row.extend(mean);
    for (mode, weight) in modes.iter().zip(weights) {
        for (value, shape) in row.iter_mut().zip(mode) {
            *value += weight * shape;
        }
    }
}

/// How much of each mode a row has.
pub(super) fn projected(offsets: &[f32], mean: &[f32], modes: &[Vec<f32>]) -> Vec<f32> {
    let centred: Vec<f32> = offsets.iter().zip(mean).map(|(a, b)| a - b).collect();
    modes
        .iter()
        .map(|mode| dot(&centred, mode) as f32)
        .collect()
}

pub(super) fn dot(a: &[f32], b: &[f32]) -> f64 {
    a.iter()
        .zip(b)
        .map(|(&a, &b)| f64::from(a) * f64::from(b))
        .sum()
}
