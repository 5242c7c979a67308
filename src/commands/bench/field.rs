//! The neural field: against the machine's matrix products, and against plain loops.

use std::hint::black_box;

use effigy_avatar::{
    CanonicalSamples, SignedDistanceField as _, Subject,
    fine_tune::{FineTuneConfig, FineTuner, SamplingConfig},
    hyper::{HyperConfig, HyperNetwork},
    nn::square_product,
    sdf::{
        OMEGA, SirenConfig, SirenField,
        batch::{FieldFrame, FieldGradients},
        loss::{Known, LossConfig, LossPoint},
    },
};
use effigy_registration::smpl::{JOINT_COUNT, builtin};
use glam::Vec3;
use rand::{RngExt as _, SeedableRng as _, rngs::StdRng};
use rayon::prelude::*;

use super::{Row, gpu, in_turn::in_turn};

/// MetaAvatar's few-shot step.
const FRAMES: usize = 8;
const POINTS: usize = 1500;
const SEED: u64 = 1;

pub(super) fn rows(quick: bool) -> anyhow::Result<Vec<Row>> {
    let rounds = if quick { 2 } else { 15 };
    let mut rows = values(rounds);
    rows.extend(training("live", HyperConfig::LIVE, rounds)?);
    if !quick {
        rows.extend(training("paper-size", HyperConfig::PAPER, 5)?);
    }
    Ok(rows)
}

/// Forward only, as the drive asks for it.
fn values(rounds: usize) -> Vec<Row> {
    const COUNT: usize = 8192;
    let config = SirenConfig::LIVE;
    let mut rng = StdRng::seed_from_u64(SEED);
    let field = SirenField::init(config, &mut rng);
    let points = random_points(COUNT, &mut rng);
    let (mut fast, mut slow) = (vec![0.0; COUNT], vec![0.0; COUNT]);
    let mut product = Product::new(config.hidden);
    let [ours, plain, gemm] = in_turn(
        rounds,
        [
            &mut || field.values(&points, &mut fast),
            &mut || {
                let chunk = COUNT.div_ceil(rayon::current_num_threads());
                points
                    .par_chunks(chunk)
                    .zip(slow.par_chunks_mut(chunk))
                    .for_each(|(points, values)| {
                        for (point, value) in points.iter().zip(values) {
                            *value = plain_value(config, field.parameters(), *point);
                        }
                    });
            },
            &mut || product.multiply(),
        ],
    );
    let gflop = 2.0 * multiply_adds(config) as f64 * COUNT as f64 / 1e9;
    let gemm_rate = product.gflop() / gemm;
    let rate = gflop / ours;
    vec![
        Row::new("matrix products, width 128", gemm_rate, "GFLOP/s"),
        Row::new("field values, live", COUNT as f64 / ours / 1e6, "million/s")
            .against("the plain loops on as many threads", plain / ours),
        Row::new("field values, live, arithmetic", rate, "GFLOP/s")
            .against("the matrix products", rate / gemm_rate),
    ]
}

/// A step's field part and the whole step, heads and Adam included.
fn training(name: &str, config: HyperConfig, rounds: usize) -> anyhow::Result<Vec<Row>> {
    let mut rng = StdRng::seed_from_u64(SEED);
    let parameters: Vec<Vec<f32>> = (0..FRAMES)
        .map(|_| {
            SirenField::init(config.field, &mut rng)
                .parameters()
                .to_vec()
        })
        .collect();
    let points: Vec<Vec<Vec3>> = (0..FRAMES)
        .map(|_| random_points(POINTS, &mut rng))
        .collect();
    let known = known_points(&points);
    let frames: Vec<FieldFrame<'_>> = parameters
        .iter()
        .zip(points.iter().zip(&known))
        .map(|(parameters, (points, known))| FieldFrame { parameters, points, known })
        .collect();
    let mut gradients = FieldGradients::new(config.field);
    let loss = LossConfig::paper();
    let settings = FineTuneConfig {
        sampling: SamplingConfig {
            surface: POINTS / 2,
            near: POINTS * 3 / 20,
            free: POINTS / 10,
            uniform: POINTS / 4,
            ..SamplingConfig::default()
        },
        ..FineTuneConfig::default().without_code()
    };
    let (subject, samples) = keyframes(&mut rng)?;
    let metres_per_unit = subject.unit_box.metres_per_unit();
    let made = || {
        let network = HyperNetwork::untrained(config, SEED);
        let tuner = FineTuner::new(network, &samples, metres_per_unit, &settings)?;
        anyhow::Ok(tuner)
    };
    let mut tuner = made()?;
    let mut failed = None;
    let mut product = Product::new(config.field.hidden);
    let [field, whole, gemm] = in_turn(
        rounds,
        [
            &mut || {
                black_box(gradients.compute(&frames, &loss));
            },
            &mut || failed = tuner.step().err().or(failed.take()),
            &mut || product.multiply(),
        ],
    );
    if let Some(error) = failed {
        return Err(error.into());
    }
    let gflop = 2.0 * config.field.training_multiply_adds() as f64 * (FRAMES * POINTS) as f64 / 1e9;
    let share = gflop / field / (product.gflop() / gemm);
    let mut rows = vec![
        Row::new(format!("field step, {name}"), field * 1e3, "ms")
            .against("the matrix products' rate", share),
        Row::new(format!("fine-tuning step, {name}"), whole * 1e3, "ms")
            .against("its field part alone", field / whole),
    ];
    // Two more of the paper's size would be the most memory of the whole run.
    if config == HyperConfig::LIVE {
        rows.extend(gpu::step_rows(name, &made, rounds)?);
    }
    Ok(rows)
}

/// Keyframes of a ball: what a step takes does not depend on what is learned.
fn keyframes(rng: &mut StdRng) -> anyhow::Result<(Subject, Vec<CanonicalSamples>)> {
    const RADIUS: f32 = 0.5;
    let subject = Subject::new(&builtin::body(), &[0.0; 10])?;
    let samples = (0..FRAMES)
        .map(|frame| {
            let mut theta = [Vec3::ZERO; JOINT_COUNT];
            theta[18].y = 0.1 * frame as f32;
            let normals: Vec<Vec3> = random_points(4000, rng)
                .iter()
                .map(|point| point.normalize_or(Vec3::Y))
                .collect();
            let at = |radius: f32| normals.iter().map(|normal| *normal * radius).collect();
            CanonicalSamples {
                theta,
                pose: subject.pose_input(&theta),
                points_in_unit: at(RADIUS),
                weights: vec![1.0; normals.len()],
                free_in_unit: at(RADIUS + 0.1),
                normals,
            }
        })
        .collect();
    Ok((subject, samples))
}

fn random_points(count: usize, rng: &mut StdRng) -> Vec<Vec3> {
    let mut next = || rng.random_range(-1.0..1.0);
    (0..count)
        .map(|_| Vec3::new(next(), next(), next()))
        .collect()
}

/// Half on a surface, half off it.
fn known_points(points: &[Vec<Vec3>]) -> Vec<Vec<LossPoint>> {
    let of_frame = |points: &Vec<Vec3>| {
        let known = |(number, point): (usize, &Vec3)| LossPoint {
            known: if number % 2 == 0 {
                Known::Surface { normal: point.normalize_or(Vec3::Y) }
            } else {
                Known::Repelled
            },
            weight: 1.0,
        };
        points.iter().enumerate().map(known).collect()
    };
    points.iter().map(of_frame).collect()
}

/// Multiply-adds of one value.
fn multiply_adds(config: SirenConfig) -> usize {
    config.training_multiply_adds() / 6
}

/// The field by its definition: one point at a time, the library's sine.
fn plain_value(config: SirenConfig, parameters: &[f32], point: Vec3) -> f32 {
    let mut layer_in = point.to_array().to_vec();
    for layer in 0..config.layers {
        let (inputs, _) = config.layer_size(layer);
        let (weight, bias) = config.split(parameters, layer);
        let last = layer + 1 == config.layers;
        layer_in = bias
            .iter()
            .zip(weight.chunks_exact(inputs))
            .map(|(bias, row)| {
                let z: f32 = row.iter().zip(&layer_in).map(|(w, x)| w * x).sum::<f32>() + bias;
                if last { z } else { (OMEGA * z).sin() }
            })
            .collect();
    }
    layer_in[0]
}

/// What the machine's matrix products reach at the kernel's shapes: a tile of points times a layer, on all threads.
struct Product {
    width: usize,
    tiles: Vec<[Vec<f32>; 2]>,
    layer: Vec<f32>,
}

impl Product {
    const TILE: usize = 256;
    /// Tiles a thread works through.
    const TILES: usize = 48;

    fn new(width: usize) -> Self {
        let tile = || vec![0.01_f32; Self::TILE * width];
        let tiles = (0..rayon::current_num_threads())
            .map(|_| [tile(), tile()])
            .collect();
        Self { width, tiles, layer: vec![0.01; width * width] }
    }

    fn multiply(&mut self) {
        let (width, layer) = (self.width, &self.layer);
        self.tiles.par_iter_mut().for_each(|[left, out]| {
            for _ in 0..Self::TILES {
                square_product(out, left, layer, width);
                black_box(&mut *out);
            }
        });
    }

    fn gflop(&self) -> f64 {
        let products = self.tiles.len() * Self::TILES;
        2.0 * (products * Self::TILE * self.width * self.width) as f64 / 1e9
    }
}
