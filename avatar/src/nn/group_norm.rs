//! Group normalisation of each row by itself: statistics over a group's channels, never over rows.

use super::layout::{Layout, Start};

/// `scale * (x - mean) / sqrt(variance + 1e-5) + shift` with the unbiased variance (Wu and He 2018, as in
/// convolutional occupancy networks' U-Net).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct GroupNorm {
    width: usize,
    groups: usize,
    scale: usize,
    shift: usize,
}

/// Added to the variance (the papers' framework).
const EPSILON: f32 = 1e-5;

/// What the backward pass needs.
#[derive(Clone, Debug, Default)]
pub(crate) struct GroupCache {
    /// [rows, width]
    normalised: Vec<f32>,
    /// One over the deviation; [rows, groups]
    inverse: Vec<f32>,
}

impl GroupNorm {
    pub(crate) fn new(layout: &mut Layout, name: &str, width: usize, groups: usize) -> Self {
        let scale = layout.add(format!("{name}.scale"), vec![width], Start::One);
        let shift = layout.add(format!("{name}.shift"), vec![width], Start::Zero);
        Self { width, groups, scale, shift }
    }

    /// # Shapes
    /// `input` and result [rows, width]
    pub(crate) fn forward(&self, parameters: &[f32], input: &[f32]) -> (Vec<f32>, GroupCache) {
        let size = self.width / self.groups;
        let (scale, shift) = (&parameters[self.scale..], &parameters[self.shift..]);
        let mut cache = GroupCache::default();
        let mut out = Vec::with_capacity(input.len());
        for (number, group) in input.chunks_exact(size).enumerate() {
            let first = number % self.groups * size;
            let mean = group.iter().sum::<f32>() / size as f32;
            let squares: f32 = group.iter().map(|x| (x - mean) * (x - mean)).sum();
            let inverse = 1.0 / (squares / (size - 1) as f32 + EPSILON).sqrt();
            cache.inverse.push(inverse);
            for (k, x) in group.iter().enumerate() {
                let normalised = (x - mean) * inverse;
                cache.normalised.push(normalised);
                out.push(scale[first + k] * normalised + shift[first + k]);
            }
        }
        (out, cache)
    }

    /// Adds the gradient of scale and shift to `gradient`; the gradient by the input.
    pub(crate) fn backward(
        &self,
        parameters: &[f32],
        cache: &GroupCache,
        output_bar: &[f32],
        gradient: &mut [f32],
    ) -> Vec<f32> {
        let size = self.width / self.groups;
        let mut input_bar = vec![0.0; output_bar.len()];
        for (number, bars) in output_bar.chunks_exact(size).enumerate() {
            let first = number % self.groups * size;
            let range = number * size..(number + 1) * size;
            let normalised = &cache.normalised[range.clone()];
            let out = &mut input_bar[range];
            let (mut mean, mut product) = (0.0, 0.0);
            for k in 0..size {
                gradient[self.scale + first + k] += bars[k] * normalised[k];
                gradient[self.shift + first + k] += bars[k];
                out[k] = bars[k] * parameters[self.scale + first + k];
                mean += out[k];
                product += out[k] * normalised[k];
            }
            mean /= size as f32;
            product /= (size - 1) as f32;
            for (bar, x) in out.iter_mut().zip(normalised) {
                *bar = cache.inverse[number] * (*bar - mean - x * product);
            }
        }
        input_bar
    }
}
