//! The SIREN's fused kernels: value, value and gradient, and the analytic backward pass through both.
//!
//! With `z_l = W_l h_{l-1} + b_l`, `h_l = sin(w z_l)`, `c_l = w cos(w z_l)` and the last weight `v`:
//!
//! ```text
//! reverse sweep    p_last = v c_last;  a_l = p_{l+1} W_{l+1};  p_l = a_l c_l;  grad f = p_0 W_0
//! tangent sweep    t_0 = W_0 g;  T_l = t_l c_l;  z_l = -w^2 t_l a_l s_l;  t_{l+1} = W_{l+1} T_l
//! backward sweep   z_l += h_bar_l c_l;  h_bar_{l-1} = z_l W_l
//! weight gradient  dW_l = [p_l; z_l]^T [T_{l-1}; h_{l-1}]      (one product with doubled inner size)
//! ```
//!
//! where `g = dL/d(grad f)` and `f_bar = dL/df`. Six products of the forward pass's size a layer, by
//! first-order rules only, and the activations of a tile never leave the core's second-level cache.

use glam::Vec3;

use super::{
    config::SirenConfig,
    elementwise::{self as pass, Activation, LastSums},
};
use crate::nn::matmul::{View, Write, multiply};

/// Points of one tile: as many as leave its arrays, five a sine layer, near the core.
pub(crate) fn tile_points(config: SirenConfig) -> usize {
    /// The live size has 1.3 MiB at 128 points; the paper's was a tenth faster with 48 (1.4 MiB) than with 64.
    const BYTES: usize = 3 << 19;
    /// Matrix products of fewer rows, or of rows that fill no registers, are slow.
    const FEWEST: usize = 32;
    const ROWS: usize = 16;
    let a_point = 5 * (config.layers - 1) * config.hidden * size_of::<f32>();
    (BYTES / a_point / ROWS * ROWS).clamp(FEWEST, 128)
}

/// A network's parameters, seen layer by layer, with the first layer's weight by columns.
pub(crate) struct Network<'a> {
    config: SirenConfig,
    parameters: &'a [f32],
    first_columns: [Vec<f32>; 3],
    /// Each hidden weight turned, `[inputs, outputs]`: products with it run a third faster than with a
    /// turned view of the weight. [layers - 2]
    turned: Vec<Vec<f32>>,
}

impl<'a> Network<'a> {
    pub(crate) fn new(config: SirenConfig, parameters: &'a [f32]) -> Self {
        assert_eq!(
            parameters.len(),
            config.parameter_count(),
            "parameters of {config:?}"
        );
        let (weight, _) = config.split(parameters, 0);
        let first_columns =
            std::array::from_fn(|axis| weight.iter().skip(axis).step_by(3).copied().collect());
        let turned = (1..config.layers - 1)
            .map(|layer| turned(config.split(parameters, layer).0, config.hidden))
            .collect();
        Self { config, parameters, first_columns, turned }
    }

    /// The weight of a hidden layer for products from the right: `[inputs, outputs]`.
    fn turned(&self, layer: usize) -> View<'_> {
        View::new(
            &self.turned[layer - 1],
            self.config.hidden,
            self.config.hidden,
        )
    }

    fn layer(&self, layer: usize) -> (&'a [f32], &'a [f32]) {
        self.config.split(self.parameters, layer)
    }

    fn columns(&self) -> [&[f32]; 3] {
        [
            &self.first_columns[0],
            &self.first_columns[1],
            &self.first_columns[2],
        ]
    }

    fn sines(&self) -> usize {
        self.config.layers - 1
    }
}

fn turned(weight: &[f32], hidden: usize) -> Vec<f32> {
    let column = |k: usize| weight.iter().skip(k).step_by(hidden).copied();
    (0..hidden).flat_map(column).collect()
}

/// The buffers of one tile, reused from tile to tile.
pub(crate) struct Workspace {
    hidden: usize,
    layers: Vec<LayerBuffers>,
    h_bar: Vec<f32>,
    pub(crate) values: Vec<f32>,
    pub(crate) gradients: Vec<Vec3>,
    pub(crate) value_bars: Vec<f32>,
    pub(crate) gradient_bars: Vec<Vec3>,
    first_columns: [Vec<f32>; 3],
}

/// A sine layer's arrays. The halves of a pair lie one behind the other for the doubled product.
struct LayerBuffers {
    /// `T`, then `h`.
    tangent_and_h: Vec<f32>,
    /// `p`, then `a`, later `z`.
    p_and_z: Vec<f32>,
    cosine: Vec<f32>,
}

impl Workspace {
    pub(crate) fn new(config: SirenConfig) -> Self {
        let tile = tile_points(config);
        let size = tile * config.hidden;
        let layer = || LayerBuffers {
            tangent_and_h: vec![0.0; 2 * size],
            p_and_z: vec![0.0; 2 * size],
            cosine: vec![0.0; size],
        };
        Self {
            hidden: config.hidden,
            layers: (1..config.layers).map(|_| layer()).collect(),
            h_bar: vec![0.0; size],
            values: vec![0.0; tile],
            gradients: vec![Vec3::ZERO; tile],
            value_bars: vec![0.0; tile],
            gradient_bars: vec![Vec3::ZERO; tile],
            first_columns: std::array::from_fn(|_| vec![0.0; config.hidden]),
        }
    }

    /// As many points at most as the kernels take with these buffers.
    pub(crate) fn tile_points(&self) -> usize {
        self.values.len()
    }
}

/// Values of a tile at most.
pub(crate) fn values(work: &mut Workspace, net: &Network<'_>, points: &[Vec3], out: &mut [f32]) {
    let (count, hidden) = (points.len(), work.hidden);
    let size = count * hidden;
    let (front, back) = work.layers.split_at_mut(1);
    let (mut h, mut next) = (
        &mut front[0].tangent_and_h[..size],
        match back.first_mut() {
            Some(layer) => &mut layer.tangent_and_h[..size],
            None => &mut front[0].p_and_z[..size],
        },
    );
    pass::first_layer_value(points, net.columns(), net.layer(0).1, h);
    for layer in 1..net.sines() {
        let bias = net.layer(layer).1;
        multiply(
            next,
            Write::Replace,
            View::new(h, count, hidden),
            net.turned(layer),
        );
        pass::sine_layer_value(bias, next);
        std::mem::swap(&mut h, &mut next);
    }
    let (v, bias) = net.layer(net.sines());
    pass::dot_rows(h, v, bias[0], out);
}

/// Values and spatial gradients of a tile at most, into the workspace.
pub(crate) fn values_and_gradients(work: &mut Workspace, net: &Network<'_>, points: &[Vec3]) {
    let (count, hidden) = (points.len(), work.hidden);
    let size = count * hidden;
    for layer in 0..net.sines() {
        let (before, from) = work.layers.split_at_mut(layer);
        let LayerBuffers { tangent_and_h, cosine, .. } = &mut from[0];
        let (h, cosine) = (&mut tangent_and_h[size..2 * size], &mut cosine[..size]);
        let bias = net.layer(layer).1;
        match before.last() {
            None => pass::first_layer(points, net.columns(), bias, h, cosine),
            Some(previous) => {
                let input = View::new(&previous.tangent_and_h[size..], count, hidden);
                multiply(h, Write::Replace, input, net.turned(layer));
                pass::sine_layer(bias, h, cosine);
            }
        }
    }
    let last = net.sines() - 1;
    let (v, bias) = net.layer(net.sines());
    let top = &mut work.layers[last];
    pass::dot_rows(
        &top.tangent_and_h[size..2 * size],
        v,
        bias[0],
        &mut work.values[..count],
    );
    pass::multiply_row(v, &top.cosine[..size], &mut top.p_and_z[..size]);
    for layer in (0..last).rev() {
        let (below, above) = work.layers.split_at_mut(layer + 1);
        let p_above = View::new(&above[0].p_and_z, count, hidden);
        let weight = View::new(net.layer(layer + 1).0, hidden, hidden);
        let LayerBuffers { p_and_z, cosine, .. } = &mut below[layer];
        let (p, a) = p_and_z.split_at_mut(size);
        multiply(a, Write::Replace, p_above, weight);
        pass::multiply(&a[..size], &cosine[..size], p);
    }
    let p = &work.layers[0].p_and_z[..size];
    pass::spatial_gradient(p, net.columns(), &mut work.gradients[..count]);
}

/// After [`values_and_gradients`] of the same points, and with `value_bars` and `gradient_bars` filled:
/// adds the loss's gradient by every parameter to `out`, laid out as the parameters are.
pub(crate) fn backward(work: &mut Workspace, net: &Network<'_>, points: &[Vec3], out: &mut [f32]) {
    tangent_sweep(work, net, points.len());
    backward_sweep(work, net, points.len(), out);
    first_weight_gradient(work, net, points, out);
}

fn tangent_sweep(work: &mut Workspace, net: &Network<'_>, count: usize) {
    let hidden = work.hidden;
    let size = count * hidden;
    let last = net.sines() - 1;
    for layer in 0..=last {
        let (before, from) = work.layers.split_at_mut(layer);
        let LayerBuffers { tangent_and_h, p_and_z, cosine } = &mut from[0];
        let (t, h) = tangent_and_h.split_at_mut(size);
        let z = &mut p_and_z[size..2 * size];
        let activation = Activation { sine: &h[..size], cosine: &cosine[..size] };
        if let Some(previous) = before.last() {
            let input = View::new(&previous.tangent_and_h, count, hidden);
            multiply(t, Write::Replace, input, net.turned(layer));
            if layer == last {
                pass::last_tangent(net.layer(last + 1).0, activation, t, z);
            } else {
                pass::tangent(activation, t, z);
            }
        } else {
            let bars = &work.gradient_bars[..count];
            if layer == last {
                for row in z.chunks_exact_mut(hidden) {
                    row.copy_from_slice(net.layer(last + 1).0);
                }
            }
            pass::first_tangent(bars, net.columns(), activation, t, z);
        }
    }
}

fn backward_sweep(work: &mut Workspace, net: &Network<'_>, count: usize, out: &mut [f32]) {
    let hidden = work.hidden;
    let (size, last) = (count * hidden, net.sines() - 1);
    let (below, top) = out.split_at_mut(net.config.layer_range(last + 1).start);
    let (v_gradient, bias_gradient) = top.split_at_mut(hidden);
    let LayerBuffers { tangent_and_h, p_and_z, cosine } = &mut work.layers[last];
    let (t, h) = tangent_and_h.split_at(size);
    pass::last_backward(
        &work.value_bars[..count],
        net.layer(last + 1).0,
        Activation { sine: &h[..size], cosine: &cosine[..size] },
        t,
        &mut p_and_z[size..2 * size],
        LastSums { bias: net.config.split_mut(below, last).1, weight: v_gradient },
    );
    bias_gradient[0] += work.value_bars[..count].iter().sum::<f32>();
    for layer in (1..=last).rev() {
        let (lower, upper) = work.layers.split_at_mut(layer);
        let (lower, upper) = (&mut lower[layer - 1], &upper[0]);
        let h_bar = &mut work.h_bar[..size];
        let z = View::new(&upper.p_and_z[size..], count, hidden);
        multiply(
            h_bar,
            Write::Replace,
            z,
            View::new(net.layer(layer).0, hidden, hidden),
        );
        let bias = net.config.split_mut(below, layer - 1).1;
        pass::backward(
            h_bar,
            &lower.cosine[..size],
            &mut lower.p_and_z[size..2 * size],
            bias,
        );
        multiply(
            net.config.split_mut(below, layer).0,
            Write::Add,
            View::new(&upper.p_and_z, 2 * count, hidden).transposed(),
            View::new(&lower.tangent_and_h, 2 * count, hidden),
        );
    }
}

fn first_weight_gradient(
    work: &mut Workspace,
    net: &Network<'_>,
    points: &[Vec3],
    out: &mut [f32],
) {
    let size = points.len() * work.hidden;
    let (p, z) = work.layers[0].p_and_z.split_at(size);
    let [first, second, third] = &mut work.first_columns;
    for column in [&mut *first, &mut *second, &mut *third] {
        column.fill(0.0);
    }
    let bars = &work.gradient_bars[..points.len()];
    pass::first_weight(points, bars, p, &z[..size], [first, second, third]);
    let weight = net.config.split_mut(out, 0).0;
    for (axis, column) in work.first_columns.iter().enumerate() {
        for (out, gradient) in weight.iter_mut().skip(axis).step_by(3).zip(column) {
            *out += gradient;
        }
    }
}
