//! The field of one pose: a SIREN with its weights.

use std::sync::Mutex;

use glam::Vec3;
use rand::{Rng, RngExt as _};
use rayon::prelude::*;

use super::{
    SignedDistanceField,
    config::{OMEGA, SirenConfig},
    kernel::{self, Network, Workspace, tile_points},
};

/// A call of fewer tiles stays on its own thread: waking others costs more.
const PARALLEL_FROM_TILES: usize = 4;

/// A SIREN: unit-space point to signed distance in unit lengths, positive outside.
#[derive(Clone, Debug, PartialEq)]
pub struct SirenField {
    config: SirenConfig,
    parameters: Vec<f32>,
}

impl SirenField {
    /// A field from its flat parameters: for each layer the weight (out x in, row-major), then the bias.
    ///
    /// # Panics
    /// If the number of parameters is not the configuration's.
    pub fn new(config: SirenConfig, parameters: Vec<f32>) -> Self {
        assert_eq!(
            parameters.len(),
            config.parameter_count(),
            "parameters of {config:?}"
        );
        Self { config, parameters }
    }

    /// Random start (Sitzmann et al. 2020, with omega outside the first layer's bound as MetaAvatar has
    /// it): first weight +-1/3, others +-sqrt(6 / hidden) / omega, biases +-1/sqrt(inputs).
    pub fn init(config: SirenConfig, rng: &mut impl Rng) -> Self {
        let mut parameters = vec![0.0; config.parameter_count()];
        for layer in 0..config.layers {
            let inputs = config.layer_size(layer).0 as f32;
            let bound = if layer == 0 {
                1.0 / inputs
            } else {
                (6.0 / inputs).sqrt() / OMEGA
            };
            let (weight, bias) = config.split_mut(&mut parameters, layer);
            weight.fill_with(|| rng.random_range(-bound..bound));
            let bound = 1.0 / inputs.sqrt();
            bias.fill_with(|| rng.random_range(-bound..bound));
        }
        Self { config, parameters }
    }

    pub fn config(&self) -> SirenConfig {
        self.config
    }

    pub fn parameters(&self) -> &[f32] {
        &self.parameters
    }
}

impl SignedDistanceField for SirenField {
    fn values(&self, points: &[Vec3], out: &mut [f32]) {
        assert_eq!(points.len(), out.len(), "one value a point");
        let net = Network::new(self.config, &self.parameters);
        let size = tile_points(self.config);
        let spare = SpareWorkspaces::new(self.config);
        let tiles = points.par_chunks(size).zip(out.par_chunks_mut(size));
        let tile = |(points, out): (&[Vec3], &mut [f32])| {
            spare.with(|work| kernel::values(work, &net, points, out));
        };
        if points.len() < PARALLEL_FROM_TILES * size {
            points.chunks(size).zip(out.chunks_mut(size)).for_each(tile);
        } else {
            tiles.for_each(tile);
        }
    }

    fn values_and_gradients(&self, points: &[Vec3], values: &mut [f32], gradients: &mut [Vec3]) {
        assert!(
            points.len() == values.len() && points.len() == gradients.len(),
            "one a point"
        );
        let net = Network::new(self.config, &self.parameters);
        let size = tile_points(self.config);
        let spare = SpareWorkspaces::new(self.config);
        let tile = |((points, values), gradients): ((&[Vec3], &mut [f32]), &mut [Vec3])| {
            spare.with(|work| {
                kernel::values_and_gradients(work, &net, points);
                values.copy_from_slice(&work.values[..points.len()]);
                gradients.copy_from_slice(&work.gradients[..points.len()]);
            });
        };
        if points.len() < PARALLEL_FROM_TILES * size {
            let tiles = points.chunks(size).zip(values.chunks_mut(size));
            tiles.zip(gradients.chunks_mut(size)).for_each(tile);
        } else {
            let tiles = points.par_chunks(size).zip(values.par_chunks_mut(size));
            tiles.zip(gradients.par_chunks_mut(size)).for_each(tile);
        }
    }
}

/// Workspaces handed from tile to tile: as many as there are threads at work.
pub(crate) struct SpareWorkspaces {
    config: SirenConfig,
    spare: Mutex<Vec<Workspace>>,
}

impl SpareWorkspaces {
    pub(crate) fn new(config: SirenConfig) -> Self {
        Self { config, spare: Mutex::new(Vec::new()) }
    }

    pub(crate) fn with<R>(&self, work: impl FnOnce(&mut Workspace) -> R) -> R {
        let taken = self.lock().pop();
        let mut workspace = taken.unwrap_or_else(|| Workspace::new(self.config));
        let result = work(&mut workspace);
        self.lock().push(workspace);
        result
    }

    fn lock(&self) -> std::sync::MutexGuard<'_, Vec<Workspace>> {
        self.spare
            .lock()
            .expect("no thread panics while it holds this lock")
    }
}
