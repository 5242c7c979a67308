//! A residual block: `shortcut(x) + fc1(relu(norm(fc0(relu(norm(x))))))`.

use super::{
    dense::{Bias, Dense, relu, relu_backward},
    group_norm::{GroupCache, GroupNorm},
    layout::{Layout, Start},
    matmul::Write,
};

/// The block's layers; without norms its inner layers have biases instead.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Residual {
    norms: Option<[GroupNorm; 2]>,
    inner: Dense,
    outer: Dense,
    /// Where input and output differ in width.
    shortcut: Option<Dense>,
}

/// What the backward pass needs.
#[derive(Clone, Debug)]
pub(crate) struct ResidualCache {
    input: Vec<f32>,
    /// After the first and the second `ReLU`.
    active: [Vec<f32>; 2],
    norms: Option<[GroupCache; 2]>,
}

impl Residual {
    /// From `inputs` to `outputs` over `hidden`; `groups` of the norms, 0 for none. The block starts as its
    /// shortcut.
    pub(crate) fn new(
        layout: &mut Layout,
        name: &str,
        (inputs, hidden, outputs): (usize, usize, usize),
        groups: usize,
    ) -> Self {
        let norms = (groups > 0).then(|| {
            [(0, inputs), (1, hidden)]
                .map(|(k, width)| GroupNorm::new(layout, &format!("{name}.norm{k}"), width, groups))
        });
        let bias = if groups > 0 {
            Bias::Without
        } else {
            Bias::With
        };
        // Twice the plain variance: half of the inputs are cut off (He et al. 2015).
        let start = Start::Normal((2.0 / inputs as f32).sqrt());
        let inner = Dense::starting(
            layout,
            &format!("{name}.fc0"),
            (inputs, hidden),
            bias,
            start,
        );
        let outer = Dense::silent(layout, &format!("{name}.fc1"), (hidden, outputs), bias);
        let shortcut = (inputs != outputs).then(|| {
            Dense::new(
                layout,
                &format!("{name}.shortcut"),
                (inputs, outputs),
                Bias::Without,
            )
        });
        Self { norms, inner, outer, shortcut }
    }

    pub(crate) fn multiply_adds(&self) -> usize {
        let shortcut = self.shortcut.map_or(0, |layer| layer.multiply_adds());
        self.inner.multiply_adds() + self.outer.multiply_adds() + shortcut
    }

    /// # Shapes
    /// `input` [rows, inputs], result [rows, outputs]
    pub(crate) fn forward(&self, parameters: &[f32], input: Vec<f32>) -> (Vec<f32>, ResidualCache) {
        let (first, norm0) = self.activate(parameters, 0, &input);
        let hidden = self.inner.forward(parameters, &first);
        let (second, norm1) = self.activate(parameters, 1, &hidden);
        let mut out = match &self.shortcut {
            Some(shortcut) => shortcut.forward(parameters, &input),
            None => input.clone(),
        };
        self.outer
            .forward_into(parameters, &second, &mut out, Write::Add);
        let norms = norm0.zip(norm1).map(<[GroupCache; 2]>::from);
        (out, ResidualCache { input, active: [first, second], norms })
    }

    /// Adds the block's gradient to `gradient`; the gradient by the input.
    pub(crate) fn backward(
        &self,
        parameters: &[f32],
        cache: &ResidualCache,
        output_bar: &[f32],
        gradient: &mut [f32],
    ) -> Vec<f32> {
        let mut bar = self
            .outer
            .backward(parameters, &cache.active[1], output_bar, gradient);
        self.deactivate(parameters, 1, cache, &mut bar, gradient);
        bar = self
            .inner
            .backward(parameters, &cache.active[0], &bar, gradient);
        self.deactivate(parameters, 0, cache, &mut bar, gradient);
        let by_shortcut = match &self.shortcut {
            Some(shortcut) => &shortcut.backward(parameters, &cache.input, output_bar, gradient),
            None => output_bar,
        };
        bar.iter_mut().zip(by_shortcut).for_each(|(a, b)| *a += b);
        bar
    }

    fn activate(
        &self,
        parameters: &[f32],
        which: usize,
        input: &[f32],
    ) -> (Vec<f32>, Option<GroupCache>) {
        match &self.norms {
            Some(norms) => {
                let (normed, cache) = norms[which].forward(parameters, input);
                (relu(&normed), Some(cache))
            }
            None => (relu(input), None),
        }
    }

    fn deactivate(
        &self,
        parameters: &[f32],
        which: usize,
        cache: &ResidualCache,
        bar: &mut Vec<f32>,
        gradient: &mut [f32],
    ) {
        relu_backward(&cache.active[which], bar);
        if let (Some(norms), Some(caches)) = (&self.norms, &cache.norms) {
            *bar = norms[which].backward(parameters, &caches[which], bar, gradient);
        }
    }
}
