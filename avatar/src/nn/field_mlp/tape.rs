//! One tile of points through the network and back.
//!
//! With `z_l = W_l h_{l-1} + b_l`, `h_l = s(z_l)` and the last weight `v`:
//!
//! ```text
//! reverse sweep    a_last = v;  p_l = a_l s'(z_l);  a_{l-1} = W_l^T p_l;  grad f = E'^T W_0^T p_0
//! tangent sweep    T_-1 = E' g;  u_l = W_l T_{l-1};  T_l = u_l s'(z_l);  z_l = u_l a_l s''(z_l)
//! backward sweep   z_l += h_bar_l s'(z_l);  h_bar_{l-1} = W_l^T z_l
//! weight gradient  dW_l = p_l T_{l-1}^T + z_l h_{l-1}^T
//! ```
//!
//! where `E'` is the encoding's derivative, `g = dL/d(grad f)` and `h_bar_last = v dL/df`.

use glam::Vec3;

use super::{CodeAt, FieldMlp, FieldMlpConfig};
use crate::nn::matmul::{View, Write, multiply};

/// Points of one tile: its arrays stay in the core's second-level cache.
pub(super) const TILE: usize = 128;

/// Buffers of one tile, reused from tile to tile.
pub(super) struct Tape {
    config: FieldMlpConfig,
    /// [points, inputs]
    input: Vec<f32>,
    input_tangent: Vec<f32>,
    input_bar: Vec<f32>,
    layers: Vec<Layer>,
    h_bar: Vec<f32>,
    pub(super) values: Vec<f32>,
    pub(super) gradients: Vec<Vec3>,
    pub(super) value_bars: Vec<f32>,
    pub(super) gradient_bars: Vec<Vec3>,
}

/// A hidden layer's arrays; [points, hidden] each
struct Layer {
    h: Vec<f32>,
    first: Vec<f32>,
    second: Vec<f32>,
    a: Vec<f32>,
    p: Vec<f32>,
    tangent: Vec<f32>,
    z_bar: Vec<f32>,
}

impl Tape {
    pub(super) fn new(config: FieldMlpConfig) -> Self {
        let array = || vec![0.0; TILE * config.hidden];
        let inputs = || vec![0.0; TILE * config.inputs()];
        let layer = || Layer {
            h: array(),
            first: array(),
            second: array(),
            a: array(),
            p: array(),
            tangent: array(),
            z_bar: array(),
        };
        Self {
            config,
            input: inputs(),
            input_tangent: inputs(),
            input_bar: inputs(),
            layers: (1..config.layers).map(|_| layer()).collect(),
            h_bar: array(),
            values: vec![0.0; TILE],
            gradients: vec![Vec3::ZERO; TILE],
            value_bars: vec![0.0; TILE],
            gradient_bars: vec![Vec3::ZERO; TILE],
        }
    }

    /// Values of up to [`TILE`] points, into `self.values`.
    pub(super) fn values(&mut self, mlp: &FieldMlp, points: &[Vec3], codes: &dyn CodeAt) {
        let (count, hidden) = (points.len(), self.config.hidden);
        let (encoded, inputs) = (self.config.encoding.size(), self.config.inputs());
        for (row, &point) in self.input.chunks_exact_mut(inputs).zip(points) {
            let (place, code) = row.split_at_mut(encoded);
            self.config.encoding.write(point, place);
            codes.write(point, code);
        }
        for index in 0..self.layers.len() {
            let (below, from) = self.layers.split_at_mut(index);
            let Layer { h, first, second, .. } = &mut from[0];
            let (input, width) = match below.last() {
                None => (&self.input, inputs),
                Some(layer) => (&layer.h, hidden),
            };
            let (weight, bias) = mlp.layer(index);
            let turned = View::new(weight, hidden, width).transposed();
            let size = count * hidden;
            multiply(h, Write::Replace, View::new(input, count, width), turned);
            let (h, first, second) = (&mut h[..size], &mut first[..size], &mut second[..size]);
            self.config.activation.apply(bias, h, first, second);
        }
        let (v, bias) = mlp.layer(self.layers.len());
        let rows = self.top().h.chunks_exact(hidden);
        let values: Vec<f32> = rows.take(count).map(|h| dot(h, v) + bias[0]).collect();
        self.values[..count].copy_from_slice(&values);
    }

    /// Spatial gradients of the same points, into `self.gradients`.
    pub(super) fn gradients(&mut self, mlp: &FieldMlp, points: &[Vec3]) {
        let (count, hidden) = (points.len(), self.config.hidden);
        let (size, last) = (count * hidden, self.layers.len() - 1);
        let v = mlp.layer(last + 1).0;
        for row in self.layers[last].a[..size].chunks_exact_mut(hidden) {
            row.copy_from_slice(v);
        }
        for index in (0..=last).rev() {
            let (below, from) = self.layers.split_at_mut(index);
            let Layer { a, p, first, .. } = &mut from[0];
            product(&a[..size], &first[..size], &mut p[..size]);
            let (out, width) = match below.last_mut() {
                None => (&mut self.input_bar, self.config.inputs()),
                Some(layer) => (&mut layer.a, hidden),
            };
            let weight = View::new(mlp.layer(index).0, hidden, width);
            multiply(out, Write::Replace, View::new(p, count, hidden), weight);
        }
        let rows = self.input_bar.chunks_exact(self.config.inputs());
        for ((gradient, row), &point) in self.gradients.iter_mut().zip(rows).zip(points) {
            *gradient = self.config.encoding.back(point, row);
        }
    }

    /// After [`Self::values`] and [`Self::gradients`] of the same points, and with both bars filled: adds the loss's
    /// gradient by every parameter to `out`.
    pub(super) fn backward(&mut self, mlp: &FieldMlp, points: &[Vec3], out: &mut [f32]) {
        self.tangent_sweep(mlp, points);
        self.last_layer(mlp, points.len(), out);
        self.backward_sweep(mlp, points.len(), out);
    }

    fn tangent_sweep(&mut self, mlp: &FieldMlp, points: &[Vec3]) {
        let (count, hidden) = (points.len(), self.config.hidden);
        let (encoding, inputs) = (self.config.encoding, self.config.inputs());
        let rows = self.input_tangent.chunks_exact_mut(inputs);
        for ((row, &point), &bar) in rows.zip(points).zip(&self.gradient_bars) {
            // The code's part stays zero: it does not change with the point.
            encoding.along(point, bar, row);
        }
        for index in 0..self.layers.len() {
            let (below, from) = self.layers.split_at_mut(index);
            let Layer { tangent, z_bar, a, first, second, .. } = &mut from[0];
            let (input, width) = match below.last() {
                None => (&self.input_tangent, inputs),
                Some(layer) => (&layer.tangent, hidden),
            };
            let turned = View::new(mlp.layer(index).0, hidden, width).transposed();
            multiply(
                tangent,
                Write::Replace,
                View::new(input, count, width),
                turned,
            );
            let derivatives = first.iter().zip(second).zip(a);
            for ((u, z_bar), ((first, second), a)) in tangent
                .iter_mut()
                .zip(z_bar)
                .zip(derivatives)
                .take(count * hidden)
            {
                *z_bar = *u * *a * *second;
                *u *= *first;
            }
        }
    }

    fn last_layer(&mut self, mlp: &FieldMlp, count: usize, out: &mut [f32]) {
        let hidden = self.config.hidden;
        let index = self.layers.len();
        let v = mlp.layer(index).0;
        let (weight, bias) = self.config.layer_ranges(index);
        let top = &self.layers[index - 1];
        let bars = &self.value_bars[..count];
        let rows = top
            .h
            .chunks_exact(hidden)
            .zip(top.tangent.chunks_exact(hidden));
        let gradient = &mut out[weight];
        for ((h, tangent), bar) in rows.zip(bars) {
            for ((sum, h), tangent) in gradient.iter_mut().zip(h).zip(tangent) {
                *sum += tangent + bar * h;
            }
        }
        out[bias][0] += bars.iter().sum::<f32>();
        for (row, bar) in self.h_bar.chunks_exact_mut(hidden).zip(bars) {
            row.iter_mut().zip(v).for_each(|(x, v)| *x = bar * v);
        }
    }

    fn backward_sweep(&mut self, mlp: &FieldMlp, count: usize, out: &mut [f32]) {
        let hidden = self.config.hidden;
        let size = count * hidden;
        for index in (0..self.layers.len()).rev() {
            let (below, from) = self.layers.split_at_mut(index);
            let Layer { z_bar, first, p, .. } = &mut from[0];
            let bars = self.h_bar[..size].iter().zip(&first[..size]);
            for (z_bar, (h_bar, first)) in z_bar.iter_mut().zip(bars) {
                *z_bar += h_bar * first;
            }
            let (input, tangent, width) = match below.last() {
                None => (&self.input, &self.input_tangent, self.config.inputs()),
                Some(layer) => (&layer.h, &layer.tangent, hidden),
            };
            let (weight, bias) = self.config.layer_ranges(index);
            for row in z_bar[..size].chunks_exact(hidden) {
                out[bias.clone()]
                    .iter_mut()
                    .zip(row)
                    .for_each(|(sum, z)| *sum += z);
            }
            for (left, right) in [(&*p, tangent), (&*z_bar, input)] {
                let left = View::new(left, count, hidden).transposed();
                let right = View::new(right, count, width);
                multiply(&mut out[weight.clone()], Write::Add, left, right);
            }
            if index > 0 {
                let weight = View::new(mlp.layer(index).0, hidden, width);
                let z_bar = View::new(z_bar, count, hidden);
                multiply(&mut self.h_bar, Write::Replace, z_bar, weight);
            }
        }
    }

    fn top(&self) -> &Layer {
        self.layers.last().expect("a network has a hidden layer")
    }
}

fn dot(a: &[f32], b: &[f32]) -> f32 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn product(a: &[f32], b: &[f32], out: &mut [f32]) {
    for ((out, a), b) in out.iter_mut().zip(a).zip(b) {
        *out = a * b;
    }
}
