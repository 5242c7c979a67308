//! Derivatives against finite differences, for every activation and encoding.

use glam::Vec3;
use rand::{RngExt as _, SeedableRng as _, rngs::StdRng};

use super::*;
use crate::sdf::loss::{Known, LossConfig, LossPoint, point_loss};

fn random_point(rng: &mut StdRng) -> Vec3 {
    Vec3::from_array(std::array::from_fn(|_| rng.random_range(-0.9_f32..0.9)))
}

/// A network, points, what is known there, and a code.
type Example = (FieldMlp, Vec<Vec3>, Vec<LossPoint>, Vec<f32>);

/// Networks of every kind, 150 points of every kind (so that the last tile is not full), and a code.
fn examples() -> Vec<Example> {
    let kinds = [
        (Activation::SmoothRamp, Encoding::Raw),
        (Activation::Sine, Encoding::Raw),
        (Activation::SmoothRamp, Encoding::Octaves(2)),
        (Activation::Relu, Encoding::Octaves(1)),
    ];
    let example = |(activation, encoding)| {
        let config = FieldMlpConfig { encoding, code: 5, hidden: 24, layers: 4, activation };
        let mut rng = StdRng::seed_from_u64(5);
        let mlp = FieldMlp::init(config, &mut rng);
        let points: Vec<_> = (0..150).map(|_| random_point(&mut rng)).collect();
        let known = (0..points.len())
            .map(|index| {
                let known = match index % 4 {
                    0 => Known::Surface { normal: random_point(&mut rng).normalize_or(Vec3::X) },
                    1 => Known::Distance(0.03),
                    2 => Known::Free { at_least: 0.05 },
                    _ => Known::Nothing,
                };
                LossPoint { known, weight: 0.5 + index as f32 / 150.0 }
            })
            .collect();
        let code = (0..5).map(|_| rng.random_range(-1.0_f32..1.0)).collect();
        (mlp, points, known, code)
    };
    kinds.into_iter().map(example).collect()
}

#[test]
fn spatial_gradients_match_finite_differences() {
    for (mlp, points, _, code) in examples() {
        let mut values = vec![0.0; points.len()];
        let mut gradients = vec![Vec3::ZERO; points.len()];
        mlp.values_and_gradients(&points, &code, &mut values, &mut gradients);
        let mut only = vec![0.0; points.len()];
        mlp.values(&points, &code, &mut only);
        assert_eq!(values, only);
        let (mut off, mut size) = (0.0, 0.0);
        for (&point, gradient) in points.iter().zip(&gradients) {
            for axis in 0..3 {
                let step = Vec3::AXES[axis] * 1e-3;
                let mut ends = [0.0; 2];
                mlp.values(&[point + step, point - step], &code, &mut ends);
                off += ((ends[0] - ends[1]) / 2e-3 - gradient[axis]).abs();
                size += gradient[axis].abs();
            }
        }
        // Single precision over a step of 1e-3, and kinks that some steps straddle.
        assert!(off < 0.02 * size, "{:?}: {off} of {size}", mlp.config);
    }
}

#[test]
fn parameter_gradients_match_finite_differences_of_the_loss() {
    let config = LossConfig::default();
    for (mut mlp, points, known, code) in examples() {
        let loss = |scale, point: &LossPoint, value, gradient| {
            point_loss(&config, scale, point, value, gradient)
        };
        let frame = MlpFrame { codes: &code, points: &points, known: &known };
        let mut gradients = MlpGradients::default();
        gradients.compute(&mlp, &[frame], &loss);
        let gradient = gradients.sum.clone();
        let norm = gradient.iter().map(|g| g * g).sum::<f32>().sqrt();
        let mut rng = StdRng::seed_from_u64(9);
        for _ in 0..3 {
            // Half along the gradient, half random: differences by single weights drown in rounding.
            let random: Vec<f32> = gradient
                .iter()
                .map(|_| rng.random_range(-1.0_f32..1.0))
                .collect();
            let random_norm = random.iter().map(|r| r * r).sum::<f32>().sqrt();
            let direction: Vec<f32> = gradient
                .iter()
                .zip(&random)
                .map(|(g, r)| g / norm + r / random_norm)
                .collect();
            let slope: f32 = direction.iter().zip(&gradient).map(|(d, g)| d * g).sum();
            let start = mlp.parameters.clone();
            let mut at = |step: f32| {
                let moved = start.iter().zip(&direction);
                mlp.parameters = moved.map(|(p, d)| p + step * d).collect();
                gradients.compute(&mlp, &[frame], &loss).total()
            };
            let step = 2e-4;
            let measured = (at(step) - at(-step)) / (2.0 * f64::from(step));
            mlp.parameters = start;
            // Curvature, absolute values in the loss and kinks of the network within the step.
            let error = (measured - f64::from(slope)).abs();
            assert!(
                error < 0.05 * f64::from(norm),
                "{:?}: {measured} {slope}",
                mlp.config
            );
        }
    }
}

#[test]
fn the_gradient_does_not_depend_on_the_thread_count() {
    let config = LossConfig::default();
    let (mlp, points, known, code) = examples().swap_remove(1);
    let loss = |scale, point: &LossPoint, value, gradient| {
        point_loss(&config, scale, point, value, gradient)
    };
    let frame = MlpFrame { codes: &code, points: &points, known: &known };
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        let mut gradients = MlpGradients::default();
        pool.install(|| gradients.compute(&mlp, &[frame; 3], &loss));
        gradients.sum
    };
    assert_eq!(on(1), on(3));
}
