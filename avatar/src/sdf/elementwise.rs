//! The loops between the field kernel's matrix products, one pass over memory each.
//!
//! Arrays hold a tile: `[points, hidden]`, row-major; `w` is omega. Symbols are those of `kernel.rs`.

use effigy_fusion::simd;
use glam::Vec3;

use super::{config::OMEGA, sincos::sincos};

/// Lanes of a partial sum: one AVX-512 register. The order of additions is the same on every unit.
const LANES: usize = 16;

/// First layer: `h = sin(w (W x + b))`, `c = w cos(..)`. `weight` is `[hidden, 3]` turned to three columns.
pub(super) fn first_layer(
    points: &[Vec3],
    columns: [&[f32]; 3],
    bias: &[f32],
    h: &mut [f32],
    c: &mut [f32],
) {
    let hidden = bias.len();
    simd::run(
        #[inline(always)]
        || {
            let rows = h.chunks_exact_mut(hidden).zip(c.chunks_exact_mut(hidden));
            for (point, (h, c)) in points.iter().zip(rows) {
                let weights = columns[0].iter().zip(columns[1]).zip(columns[2]).zip(bias);
                for ((((wx, wy), wz), b), (h, c)) in weights.zip(h.iter_mut().zip(c)) {
                    let z = wx.mul_add(point.x, wy.mul_add(point.y, wz.mul_add(point.z, *b)));
                    let (sine, cosine) = sincos(OMEGA * z);
                    *h = sine;
                    *c = OMEGA * cosine;
                }
            }
        },
    );
}

/// `h` holds `W h_before`; becomes `sin(w (h + b))`, and `c = w cos(..)`.
pub(super) fn sine_layer(bias: &[f32], h: &mut [f32], c: &mut [f32]) {
    let hidden = bias.len();
    simd::run(
        #[inline(always)]
        || {
            for (h, c) in h.chunks_exact_mut(hidden).zip(c.chunks_exact_mut(hidden)) {
                for ((h, c), b) in h.iter_mut().zip(c).zip(bias) {
                    let (sine, cosine) = sincos(OMEGA * (*h + b));
                    *h = sine;
                    *c = OMEGA * cosine;
                }
            }
        },
    );
}

/// [`first_layer`] without the derivative.
pub(super) fn first_layer_value(
    points: &[Vec3],
    columns: [&[f32]; 3],
    bias: &[f32],
    h: &mut [f32],
) {
    let hidden = bias.len();
    simd::run(
        #[inline(always)]
        || {
            for (point, h) in points.iter().zip(h.chunks_exact_mut(hidden)) {
                let weights = columns[0].iter().zip(columns[1]).zip(columns[2]).zip(bias);
                for ((((wx, wy), wz), b), h) in weights.zip(h) {
                    let z = wx.mul_add(point.x, wy.mul_add(point.y, wz.mul_add(point.z, *b)));
                    *h = sincos(OMEGA * z).0;
                }
            }
        },
    );
}

/// [`sine_layer`] without the derivative.
pub(super) fn sine_layer_value(bias: &[f32], h: &mut [f32]) {
    let hidden = bias.len();
    simd::run(
        #[inline(always)]
        || {
            for h in h.chunks_exact_mut(hidden) {
                for (h, b) in h.iter_mut().zip(bias) {
                    *h = sincos(OMEGA * (*h + b)).0;
                }
            }
        },
    );
}

/// Last layer: one dot product a row.
pub(super) fn dot_rows(h: &[f32], v: &[f32], bias: f32, out: &mut [f32]) {
    simd::run(
        #[inline(always)]
        || {
            for (out, h) in out.iter_mut().zip(h.chunks_exact(v.len())) {
                *out = dot(h, v) + bias;
            }
        },
    );
}

/// `out = a * b`, element by element.
pub(super) fn multiply(a: &[f32], b: &[f32], out: &mut [f32]) {
    simd::run(
        #[inline(always)]
        || {
            for ((out, a), b) in out.iter_mut().zip(a).zip(b) {
                *out = a * b;
            }
        },
    );
}

/// `out = v * c` with one `v` for all rows: the reverse sweep's start.
pub(super) fn multiply_row(v: &[f32], c: &[f32], out: &mut [f32]) {
    simd::run(
        #[inline(always)]
        || {
            for (out, c) in out.chunks_exact_mut(v.len()).zip(c.chunks_exact(v.len())) {
                for ((out, c), v) in out.iter_mut().zip(c).zip(v) {
                    *out = v * c;
                }
            }
        },
    );
}

/// The reverse sweep's end: `grad f = p_0 W_0`, a row each.
pub(super) fn spatial_gradient(p: &[f32], columns: [&[f32]; 3], out: &mut [Vec3]) {
    simd::run(
        #[inline(always)]
        || {
            for (out, p) in out.iter_mut().zip(p.chunks_exact(columns[0].len())) {
                *out = Vec3::new(dot(p, columns[0]), dot(p, columns[1]), dot(p, columns[2]));
            }
        },
    );
}

/// Tangent of the first layer along `bar = dL/d(grad f)`: `t = W_0 bar`, then as [`tangent`].
pub(super) fn first_tangent(
    bars: &[Vec3],
    columns: [&[f32]; 3],
    activation: Activation<'_>,
    t: &mut [f32],
    z: &mut [f32],
) {
    let hidden = columns[0].len();
    let Activation { sine, cosine } = activation;
    simd::run(
        #[inline(always)]
        || {
            let rows = t.chunks_exact_mut(hidden).zip(z.chunks_exact_mut(hidden));
            let saved = sine.chunks_exact(hidden).zip(cosine.chunks_exact(hidden));
            for ((bar, (t, z)), (sine, cosine)) in bars.iter().zip(rows).zip(saved) {
                let weights = columns[0].iter().zip(columns[1]).zip(columns[2]);
                let elements = t.iter_mut().zip(z).zip(sine.iter().zip(cosine));
                for (((wx, wy), wz), ((t, z), (s, c))) in weights.zip(elements) {
                    let tangent = wx.mul_add(bar.x, wy.mul_add(bar.y, wz * bar.z));
                    *t = tangent * c;
                    *z *= -(OMEGA * OMEGA) * tangent * s;
                }
            }
        },
    );
}

/// What the forward pass keeps of a layer: `sin(w z)` and `w cos(w z)`.
#[derive(Clone, Copy)]
pub(super) struct Activation<'a> {
    pub(super) sine: &'a [f32],
    pub(super) cosine: &'a [f32],
}

/// `t` holds the tangent of z, `z` holds `a = dL/dh` of the reverse sweep. Becomes the tangent of h,
/// `t c`, and the part of dL/dz that comes through the spatial gradient, `-w^2 t a s`.
pub(super) fn tangent(activation: Activation<'_>, t: &mut [f32], z: &mut [f32]) {
    let Activation { sine, cosine } = activation;
    simd::run(
        #[inline(always)]
        || {
            for (((t, z), s), c) in t.iter_mut().zip(z).zip(sine).zip(cosine) {
                *z *= -(OMEGA * OMEGA) * *t * s;
                *t *= c;
            }
        },
    );
}

/// [`tangent`] of the last sine layer, where `a` is the last layer's weight `v` in every row.
pub(super) fn last_tangent(v: &[f32], activation: Activation<'_>, t: &mut [f32], z: &mut [f32]) {
    let hidden = v.len();
    let Activation { sine, cosine } = activation;
    simd::run(
        #[inline(always)]
        || {
            let rows = t.chunks_exact_mut(hidden).zip(z.chunks_exact_mut(hidden));
            let saved = sine.chunks_exact(hidden).zip(cosine.chunks_exact(hidden));
            for ((t, z), (sine, cosine)) in rows.zip(saved) {
                for ((((t, z), s), c), v) in t.iter_mut().zip(z).zip(sine).zip(cosine).zip(v) {
                    *z = -(OMEGA * OMEGA) * *t * v * s;
                    *t *= c;
                }
            }
        },
    );
}

/// Adds the part of dL/dz that comes through the value at the last sine layer, `f_bar v c`, and sums the
/// gradients of that layer's bias and of the last layer's weight.
pub(super) fn last_backward(
    value_bars: &[f32],
    v: &[f32],
    activation: Activation<'_>,
    t: &[f32],
    z: &mut [f32],
    sums: LastSums<'_>,
) {
    let hidden = v.len();
    let Activation { sine, cosine } = activation;
    let LastSums { bias, weight } = sums;
    simd::run(
        #[inline(always)]
        || {
            let saved = sine.chunks_exact(hidden).zip(cosine.chunks_exact(hidden));
            let rows = z.chunks_exact_mut(hidden).zip(t.chunks_exact(hidden));
            for ((bar, (z, t)), (sine, cosine)) in value_bars.iter().zip(rows).zip(saved) {
                let elements = z.iter_mut().zip(t).zip(sine.iter().zip(cosine)).zip(v);
                let out = bias.iter_mut().zip(weight.iter_mut());
                for ((((z, t), (s, c)), v), (bias, weight)) in elements.zip(out) {
                    *z = (bar * v).mul_add(*c, *z);
                    *bias += *z;
                    *weight += bar.mul_add(*s, *t);
                }
            }
        },
    );
}

/// Where [`last_backward`] adds its sums.
pub(super) struct LastSums<'a> {
    pub(super) bias: &'a mut [f32],
    pub(super) weight: &'a mut [f32],
}

/// `z += h_bar c`, and the bias gradient: the sum of z over the tile.
pub(super) fn backward(h_bar: &[f32], cosine: &[f32], z: &mut [f32], bias: &mut [f32]) {
    let hidden = bias.len();
    simd::run(
        #[inline(always)]
        || {
            let rows = h_bar.chunks_exact(hidden).zip(cosine.chunks_exact(hidden));
            for (z, (h_bar, cosine)) in z.chunks_exact_mut(hidden).zip(rows) {
                for (((z, h), c), bias) in z.iter_mut().zip(h_bar).zip(cosine).zip(bias.iter_mut())
                {
                    *z = h.mul_add(*c, *z);
                    *bias += *z;
                }
            }
        },
    );
}

/// First layer's weight gradient, by columns: `sum_i p_i bar_i + z_i x_i`.
pub(super) fn first_weight(
    points: &[Vec3],
    bars: &[Vec3],
    p: &[f32],
    z: &[f32],
    columns: [&mut [f32]; 3],
) {
    let [first, second, third] = columns;
    let hidden = first.len();
    simd::run(
        #[inline(always)]
        || {
            let rows = p.chunks_exact(hidden).zip(z.chunks_exact(hidden));
            for ((x, bar), (p, z)) in points.iter().zip(bars).zip(rows) {
                let out = first
                    .iter_mut()
                    .zip(second.iter_mut())
                    .zip(third.iter_mut());
                for ((p, z), ((first, second), third)) in p.iter().zip(z).zip(out) {
                    *first += p.mul_add(bar.x, z * x.x);
                    *second += p.mul_add(bar.y, z * x.y);
                    *third += p.mul_add(bar.z, z * x.z);
                }
            }
        },
    );
}

#[expect(
    clippy::inline_always,
    reason = "compiled inside each vector unit's loop"
)]
#[inline(always)]
fn dot(a: &[f32], b: &[f32]) -> f32 {
    let (a_chunks, a_rest) = a.as_chunks::<LANES>();
    let (b_chunks, b_rest) = b.as_chunks::<LANES>();
    let mut lanes = [0.0_f32; LANES];
    for (a, b) in a_chunks.iter().zip(b_chunks) {
        for lane in 0..LANES {
            lanes[lane] = a[lane].mul_add(b[lane], lanes[lane]);
        }
    }
    let rest: f32 = a_rest.iter().zip(b_rest).map(|(a, b)| a * b).sum();
    lanes.iter().sum::<f32>() + rest
}
