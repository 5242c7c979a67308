//! A linear layer over many rows, with its numbers in a flat parameter vector.

use effigy_fusion::simd;

use super::{
    layout::{Layout, Start},
    matmul::{View, Write, multiply},
};

/// `y = W x + b`, each row by itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Dense {
    pub(crate) inputs: usize,
    pub(crate) outputs: usize,
    /// Offset of the weight; row-major [outputs, inputs].
    weight: usize,
    /// Offset of the bias, if there is one; [outputs].
    bias: Option<usize>,
}

/// Whether a layer adds a constant.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Bias {
    With,
    Without,
}

impl Dense {
    /// Starts evenly within +-1/sqrt(inputs), as the papers' framework does.
    pub(crate) fn new(
        layout: &mut Layout,
        name: &str,
        (inputs, outputs): (usize, usize),
        bias: Bias,
    ) -> Self {
        let start = Start::Uniform(1.0 / (inputs as f32).sqrt());
        Self::starting(layout, name, (inputs, outputs), bias, start)
    }

    /// With a weight that starts at zero: the layer does nothing at first.
    pub(crate) fn silent(
        layout: &mut Layout,
        name: &str,
        sizes: (usize, usize),
        bias: Bias,
    ) -> Self {
        Self::starting(layout, name, sizes, bias, Start::Zero)
    }

    pub(crate) fn starting(
        layout: &mut Layout,
        name: &str,
        (inputs, outputs): (usize, usize),
        bias: Bias,
        start: Start,
    ) -> Self {
        let weight = layout.add(format!("{name}.weight"), vec![outputs, inputs], start);
        let bias = (bias == Bias::With)
            .then(|| layout.add(format!("{name}.bias"), vec![outputs], Start::Zero));
        Self { inputs, outputs, weight, bias }
    }

    /// # Shapes
    /// `input` [rows, inputs], result [rows, outputs]
    pub(crate) fn forward(&self, parameters: &[f32], input: &[f32]) -> Vec<f32> {
        let mut out = vec![0.0; input.len() / self.inputs * self.outputs];
        self.forward_into(parameters, input, &mut out, Write::Replace);
        out
    }

    /// As [`Self::forward`], written over or added to what is there.
    pub(crate) fn forward_into(
        &self,
        parameters: &[f32],
        input: &[f32],
        out: &mut [f32],
        write: Write,
    ) {
        let rows = input.len() / self.inputs;
        let mut write = write;
        if let Some(bias) = self.bias {
            let bias = &parameters[bias..][..self.outputs];
            for row in out.chunks_exact_mut(self.outputs) {
                match write {
                    Write::Replace => row.copy_from_slice(bias),
                    Write::Add => row.iter_mut().zip(bias).for_each(|(y, b)| *y += b),
                }
            }
            write = Write::Add;
        }
        let weight = View::new(&parameters[self.weight..], self.outputs, self.inputs).transposed();
        multiply(out, write, View::new(input, rows, self.inputs), weight);
    }

    /// Adds the layer's gradient to `gradient`; the gradient by the input.
    ///
    /// # Shapes
    /// `input` and result [rows, inputs], `output_bar` [rows, outputs]
    pub(crate) fn backward(
        &self,
        parameters: &[f32],
        input: &[f32],
        output_bar: &[f32],
        gradient: &mut [f32],
    ) -> Vec<f32> {
        self.add_gradient(input, output_bar, gradient);
        let rows = output_bar.len() / self.outputs;
        let mut input_bar = vec![0.0; rows * self.inputs];
        let weight = View::new(&parameters[self.weight..], self.outputs, self.inputs);
        multiply(
            &mut input_bar,
            Write::Replace,
            View::new(output_bar, rows, self.outputs),
            weight,
        );
        input_bar
    }

    /// As [`Self::backward`], where nobody wants the input's gradient.
    pub(crate) fn add_gradient(&self, input: &[f32], output_bar: &[f32], gradient: &mut [f32]) {
        let rows = output_bar.len() / self.outputs;
        multiply(
            &mut gradient[self.weight..],
            Write::Add,
            View::new(output_bar, rows, self.outputs).transposed(),
            View::new(input, rows, self.inputs),
        );
        if let Some(bias) = self.bias {
            let sums = &mut gradient[bias..][..self.outputs];
            for row in output_bar.chunks_exact(self.outputs) {
                sums.iter_mut().zip(row).for_each(|(sum, bar)| *sum += bar);
            }
        }
    }

    pub(crate) fn multiply_adds(&self) -> usize {
        self.inputs * self.outputs
    }
}

/// `max(x, 0)`.
pub(crate) fn relu(input: &[f32]) -> Vec<f32> {
    input.iter().map(|x| x.max(0.0)).collect()
}

/// As [`relu`], in place.
pub(crate) fn relu_in_place(values: &mut [f32]) {
    for x in values {
        *x = x.max(0.0);
    }
}

/// Silences the gradient where `ReLU`'s output was zero.
pub(crate) fn relu_backward(output: &[f32], bar: &mut [f32]) {
    simd::run(
        #[inline(always)]
        || {
            for (bar, y) in bar.iter_mut().zip(output) {
                *bar = if *y > 0.0 { *bar } else { 0.0 };
            }
        },
    );
}

/// Puts two matrices of as many rows side by side.
///
/// # Shapes
/// `left` [rows, l], `right` [rows, r], result [rows, l + r]
pub(crate) fn beside(left: &[f32], l: usize, right: &[f32], r: usize) -> Vec<f32> {
    let rows = left.len() / l;
    let mut out = Vec::with_capacity(rows * (l + r));
    for row in 0..rows {
        out.extend_from_slice(&left[row * l..(row + 1) * l]);
        out.extend_from_slice(&right[row * r..(row + 1) * r]);
    }
    out
}

/// Undoes [`beside`].
pub(crate) fn apart(both: &[f32], l: usize, r: usize) -> (Vec<f32>, Vec<f32>) {
    let rows = both.len() / (l + r);
    let (mut left, mut right) = (Vec::with_capacity(rows * l), Vec::with_capacity(rows * r));
    for row in both.chunks_exact(l + r) {
        left.extend_from_slice(&row[..l]);
        right.extend_from_slice(&row[l..]);
    }
    (left, right)
}
