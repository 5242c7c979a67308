//! Layer normalisation with scale and shift, followed by `ReLU`.

/// `relu(scale * (x - mean) / sqrt(variance + 1e-5) + shift)`, each row by itself.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct LayerNorm {
    pub(crate) scale: Vec<f32>,
    pub(crate) shift: Vec<f32>,
}

/// Added to the variance (the papers' framework).
const EPSILON: f32 = 1e-5;

/// What the backward pass needs.
#[derive(Clone, Debug, Default)]
pub(crate) struct NormCache {
    /// `(x - mean) / deviation`; [rows, width]
    normalised: Vec<f32>,
    /// 1 / deviation; [rows]
    inverse_deviation: Vec<f32>,
    /// After `ReLU`; [rows, width]
    pub(crate) output: Vec<f32>,
}

impl LayerNorm {
    pub(crate) fn new(width: usize) -> Self {
        Self { scale: vec![1.0; width], shift: vec![0.0; width] }
    }

    pub(crate) fn zeros(width: usize) -> Self {
        Self { scale: vec![0.0; width], shift: vec![0.0; width] }
    }

    /// # Shapes
    /// `input` [rows, width]
    pub(crate) fn forward_relu(&self, input: &[f32]) -> NormCache {
        let width = self.scale.len();
        let mut cache = NormCache::default();
        for row in input.chunks_exact(width) {
            let mean = row.iter().sum::<f32>() / width as f32;
            let variance = row.iter().map(|x| (x - mean) * (x - mean)).sum::<f32>() / width as f32;
            let inverse = 1.0 / (variance + EPSILON).sqrt();
            cache.inverse_deviation.push(inverse);
            for ((x, scale), shift) in row.iter().zip(&self.scale).zip(&self.shift) {
                let normalised = (x - mean) * inverse;
                cache.normalised.push(normalised);
                cache.output.push((scale * normalised + shift).max(0.0));
            }
        }
        cache
    }

    /// The gradient by the input; adds the gradients of scale and shift to `sums`.
    ///
    /// # Shapes
    /// `output_bar` and result [rows, width]
    pub(crate) fn backward_relu(
        &self,
        cache: &NormCache,
        output_bar: &[f32],
        sums: &mut Self,
    ) -> Vec<f32> {
        let width = self.scale.len();
        let mut input_bar = vec![0.0; output_bar.len()];
        for (row, &inverse) in cache.inverse_deviation.iter().enumerate() {
            let range = row * width..(row + 1) * width;
            let normalised = &cache.normalised[range.clone()];
            let out = &mut input_bar[range.clone()];
            let (mut mean, mut mean_product) = (0.0, 0.0);
            for k in 0..width {
                let is_on = cache.output[range.start + k] > 0.0;
                let bar = if is_on {
                    output_bar[range.start + k]
                } else {
                    0.0
                };
                sums.scale[k] += bar * normalised[k];
                sums.shift[k] += bar;
                out[k] = bar * self.scale[k];
                mean += out[k];
                mean_product += out[k] * normalised[k];
            }
            mean /= width as f32;
            mean_product /= width as f32;
            for (bar, x) in out.iter_mut().zip(normalised) {
                *bar = inverse * (*bar - mean - x * mean_product);
            }
        }
        input_bar
    }
}
