//! The field kernel's plain twin in f64: one point at a time, no tiles, no fused passes. For tests only.

use super::{config::SirenConfig, loss::LossConfig, loss::LossPoint};

/// A point's value and spatial gradient.
pub(super) fn value_and_gradient(
    config: SirenConfig,
    parameters: &[f64],
    point: [f64; 3],
) -> (f64, [f64; 3]) {
    // Forward-mode: the value and three tangents go through every layer together.
    let mut jet: [Vec<f64>; 4] = [point.to_vec(), unit(0), unit(1), unit(2)];
    let mut start = 0;
    for layer in 0..config.layers {
        let (inputs, outputs) = config.layer_size(layer);
        let weight = &parameters[start..start + inputs * outputs];
        let bias = &parameters[start + inputs * outputs..start + inputs * outputs + outputs];
        start += inputs * outputs + outputs;
        let product = |x: &[f64], row: usize| -> f64 {
            (0..inputs).map(|k| weight[row * inputs + k] * x[k]).sum()
        };
        let mut next = [const { Vec::new() }; 4];
        for (row, bias) in bias.iter().enumerate() {
            let z: [f64; 4] = std::array::from_fn(|part| product(&jet[part], row));
            let z0 = z[0] + bias;
            if layer + 1 == config.layers {
                next[0].push(z0);
                (1..4).for_each(|part| next[part].push(z[part]));
            } else {
                next[0].push((30.0 * z0).sin());
                (1..4).for_each(|part| next[part].push(30.0 * (30.0 * z0).cos() * z[part]));
            }
        }
        jet = next;
    }
    (jet[0][0], [jet[1][0], jet[2][0], jet[3][0]])
}

fn unit(axis: usize) -> Vec<f64> {
    (0..3).map(|i| f64::from(u8::from(i == axis))).collect()
}

/// The loss of one frame, by its definition.
pub(super) fn loss(
    config: SirenConfig,
    weights: &LossConfig,
    parameters: &[f64],
    points: &[[f64; 3]],
    known: &[LossPoint],
) -> f64 {
    use super::loss::Known;
    let all: f64 = known.iter().map(|point| f64::from(point.weight)).sum();
    let is_data = |point: &&LossPoint| point.known != Known::Repelled;
    let data: f64 = known
        .iter()
        .filter(is_data)
        .map(|point| f64::from(point.weight))
        .sum();
    let mut sum = 0.0;
    for (point, known) in points.iter().zip(known) {
        let (f, g) = value_and_gradient(config, parameters, *point);
        let length = (g[0] * g[0] + g[1] * g[1] + g[2] * g[2]).sqrt();
        let w = f64::from(known.weight);
        sum += w / all * f64::from(weights.eikonal) * (length - 1.0).abs();
        sum += w / data
            * match known.known {
                Known::Surface { normal } => {
                    let n = normal.as_dvec3();
                    let cosine = (g[0] * n.x + g[1] * n.y + g[2] * n.z) / length;
                    let normal = if n == glam::DVec3::ZERO {
                        0.0
                    } else {
                        1.0 - cosine
                    };
                    f64::from(weights.surface) * f.abs() + f64::from(weights.normal) * normal
                }
                Known::Distance(d) => f64::from(weights.distance) * (f - f64::from(d)).abs(),
                Known::Free { at_least } => {
                    f64::from(weights.free) * (f64::from(at_least) - f).max(0.0)
                }
                Known::Nothing | Known::Repelled => {
                    let alpha = f64::from(weights.off_surface_sharpness);
                    f64::from(weights.off_surface) * (-alpha * f.abs()).exp()
                }
            };
    }
    sum
}
