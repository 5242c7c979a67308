//! The network: from a cloud, and what is known of its points, to some numbers a point.

use glam::Vec3;
use rand::rngs::StdRng;
use rayon::prelude::*;

use super::{
    config::NetworkConfig,
    planes::{Cells, Planes},
};
use crate::nn::{
    convolution::Images,
    dense::{Bias, Dense, apart, beside, relu, relu_backward},
    group_norm::{GroupCache, GroupNorm},
    layout::Layout,
    residual::{Residual, ResidualCache},
    unet::{UNet, UNetCache},
};

/// Points the decoder takes at a time: what lies between its layers stays in the cache.
const POINTS_AT_ONCE: usize = 256;

/// The layers, without their numbers.
#[derive(Clone, Debug)]
pub(super) struct Net {
    pub(super) config: NetworkConfig,
    pub(super) layout: Layout,
    planes: Planes,
    first: Dense,
    blocks: Vec<Residual>,
    to_planes: Dense,
    unet: UNet,
    decoder_first: Dense,
    decoder: Vec<Residual>,
    last_norm: Option<GroupNorm>,
    last: Dense,
}

/// A cloud as the network sees it.
#[derive(Clone, Debug, Default)]
pub(super) struct Cloud {
    /// Normalised: the cloud lies in about +-0.75.
    pub(super) points: Vec<Vec3>,
    /// What is known of each point; [points, features]
    pub(super) features: Vec<f32>,
}

/// What the backward pass needs.
pub(super) struct NetCache {
    /// Place and features; [points, 3 + features]
    input: Vec<f32>,
    cells: Cells,
    blocks: Vec<ResidualCache>,
    /// What the last block gave; [points, hidden]
    encoded: Vec<f32>,
    unet: UNetCache,
    decoder: Vec<DecoderCache>,
}

/// Of some of the points.
struct DecoderCache {
    input: Vec<f32>,
    blocks: Vec<ResidualCache>,
    norm: Option<GroupCache>,
    active: Vec<f32>,
}

impl Net {
    pub(super) fn new(config: NetworkConfig) -> Self {
        let mut layout = Layout::default();
        let NetworkConfig { features, hidden, channels, groups, decoder, .. } = config;
        let known = 3 + features;
        let first = Dense::new(
            &mut layout,
            "encoder.first",
            (known, 2 * hidden),
            Bias::With,
        );
        let blocks = (0..config.blocks).map(|k| {
            let sizes = (2 * hidden, hidden, hidden);
            Residual::new(&mut layout, &format!("encoder.block{k}"), sizes, 0)
        });
        let blocks = blocks.collect();
        let to_planes = Dense::new(
            &mut layout,
            "encoder.planes",
            (hidden, channels),
            Bias::With,
        );
        let unet = UNet::new(&mut layout, channels, config.unet);
        let sizes = (known + 3 * channels, decoder[0]);
        let decoder_first = Dense::new(&mut layout, "decoder.first", sizes, Bias::With);
        let decoder = decoder
            .windows(2)
            .enumerate()
            .map(|(k, widths)| {
                let sizes = (widths[0], widths[0].min(widths[1]), widths[1]);
                Residual::new(&mut layout, &format!("decoder.block{k}"), sizes, groups)
            })
            .collect();
        let width = config.decoder[4];
        let last_norm =
            (groups > 0).then(|| GroupNorm::new(&mut layout, "decoder.norm", width, groups));
        let last = Dense::silent(
            &mut layout,
            "decoder.last",
            (width, config.outputs),
            Bias::With,
        );
        let planes = Planes { side: config.side, half_extent: config.half_extent };
        Self {
            config,
            layout,
            planes,
            first,
            blocks,
            to_planes,
            unet,
            decoder_first,
            decoder,
            last_norm,
            last,
        }
    }

    pub(super) fn init(&self, rng: &mut StdRng) -> Vec<f32> {
        self.layout.init(rng)
    }

    /// Multiply-adds for a cloud of this many points.
    pub(super) fn multiply_adds(&self, points: usize) -> usize {
        let blocks = self.blocks.iter().chain(&self.decoder);
        let layers = [self.first, self.to_planes, self.decoder_first, self.last];
        let a_point = blocks.map(Residual::multiply_adds).sum::<usize>()
            + layers.iter().map(Dense::multiply_adds).sum::<usize>();
        points * a_point + 3 * self.unet.multiply_adds(self.config.side)
    }

    /// The answer for each point; the decoder's pieces run in parallel where a pool allows.
    ///
    /// # Shapes
    /// result [points, outputs]
    pub(super) fn forward(&self, parameters: &[f32], cloud: &Cloud) -> Vec<f32> {
        let input = self.input(cloud);
        let cells = self.planes.cells(&cloud.points);
        let (encoded, _) = self.encode(parameters, &input, &cells);
        let images = self.to_images(parameters, &encoded, &cells);
        let (images, _) = self.unet.forward(parameters, images);
        let pieces: Vec<Vec<f32>> = self
            .decoder_inputs(&input, &images, &cloud.points)
            .into_par_iter()
            .map(|piece| self.decode(parameters, piece).0)
            .collect();
        pieces.concat()
    }

    /// As [`Self::forward`], on one thread, with what the backward pass needs.
    pub(super) fn forward_to_learn(
        &self,
        parameters: &[f32],
        cloud: &Cloud,
    ) -> (Vec<f32>, NetCache) {
        let input = self.input(cloud);
        let cells = self.planes.cells(&cloud.points);
        let (encoded, blocks) = self.encode(parameters, &input, &cells);
        let images = self.to_images(parameters, &encoded, &cells);
        let (images, unet) = self.unet.forward(parameters, images);
        let (mut out, mut decoder) = (Vec::new(), Vec::new());
        for piece in self.decoder_inputs(&input, &images, &cloud.points) {
            let (logits, cache) = self.decode(parameters, piece);
            out.extend(logits);
            decoder.push(cache);
        }
        (
            out,
            NetCache { input, cells, blocks, encoded, unet, decoder },
        )
    }

    /// Adds the gradient of all parameters to `gradient`.
    ///
    /// # Shapes
    /// `output_bar` [points, outputs]
    pub(super) fn backward(
        &self,
        parameters: &[f32],
        cloud: &Cloud,
        cache: &NetCache,
        output_bar: &[f32],
        gradient: &mut [f32],
    ) {
        let known = 3 + self.config.features;
        let channels = self.config.channels;
        let mut sampled_bar = Vec::with_capacity(cloud.points.len() * 3 * channels);
        let bars = output_bar.chunks(POINTS_AT_ONCE * self.config.outputs);
        for (bar, cache) in bars.zip(&cache.decoder) {
            let bar = self.decode_backward(parameters, cache, bar, gradient);
            sampled_bar.extend(apart(&bar, known, 3 * channels).1);
        }
        let images = self
            .planes
            .sample_backward(&sampled_bar, &cloud.points, channels);
        let images = self
            .unet
            .backward(parameters, &cache.unet, &images, gradient);
        let bar = cache.cells.mean_backward(&images);
        self.encode_backward(parameters, cache, &bar, gradient);
    }

    fn input(&self, cloud: &Cloud) -> Vec<f32> {
        let places: Vec<f32> = cloud.points.iter().flat_map(Vec3::to_array).collect();
        match self.config.features {
            0 => places,
            features => beside(&places, 3, &cloud.features, features),
        }
    }

    fn encode(
        &self,
        parameters: &[f32],
        input: &[f32],
        cells: &Cells,
    ) -> (Vec<f32>, Vec<ResidualCache>) {
        let hidden = self.config.hidden;
        let mut values = self.first.forward(parameters, input);
        let mut caches = Vec::new();
        for (k, block) in self.blocks.iter().enumerate() {
            if k > 0 {
                let pooled = cells.pool(&values, hidden);
                values = beside(&values, hidden, &pooled, hidden);
            }
            let (out, cache) = block.forward(parameters, values);
            values = out;
            caches.push(cache);
        }
        (values, caches)
    }

    fn to_images(&self, parameters: &[f32], encoded: &[f32], cells: &Cells) -> Images {
        let values = self.to_planes.forward(parameters, encoded);
        cells.mean(&values, self.config.channels)
    }

    fn encode_backward(
        &self,
        parameters: &[f32],
        cache: &NetCache,
        bar: &[f32],
        gradient: &mut [f32],
    ) {
        let hidden = self.config.hidden;
        let mut bar = self
            .to_planes
            .backward(parameters, &cache.encoded, bar, gradient);
        for (k, block) in self.blocks.iter().enumerate().rev() {
            bar = block.backward(parameters, &cache.blocks[k], &bar, gradient);
            if k > 0 {
                let (own, pooled) = apart(&bar, hidden, hidden);
                bar = cache.cells.pool(&pooled, hidden);
                bar.iter_mut().zip(&own).for_each(|(sum, x)| *sum += x);
            }
        }
        self.first.add_gradient(&cache.input, &bar, gradient);
    }

    /// Place, features and what the planes hold there, for some points at a time.
    fn decoder_inputs(&self, input: &[f32], images: &Images, points: &[Vec3]) -> Vec<Vec<f32>> {
        let known = 3 + self.config.features;
        let pieces = points.par_chunks(POINTS_AT_ONCE);
        pieces
            .zip(input.par_chunks(POINTS_AT_ONCE * known))
            .map(|(points, input)| {
                let sampled = self.planes.sample(images, points);
                beside(input, known, &sampled, 3 * images.channels)
            })
            .collect()
    }

    fn decode(&self, parameters: &[f32], input: Vec<f32>) -> (Vec<f32>, DecoderCache) {
        let mut values = self.decoder_first.forward(parameters, &input);
        let mut blocks = Vec::new();
        for block in &self.decoder {
            let (out, cache) = block.forward(parameters, values);
            values = out;
            blocks.push(cache);
        }
        let mut norm = None;
        if let Some(last_norm) = &self.last_norm {
            let (normed, cache) = last_norm.forward(parameters, &values);
            (values, norm) = (normed, Some(cache));
        }
        let active = relu(&values);
        let out = self.last.forward(parameters, &active);
        (out, DecoderCache { input, blocks, norm, active })
    }

    fn decode_backward(
        &self,
        parameters: &[f32],
        cache: &DecoderCache,
        output_bar: &[f32],
        gradient: &mut [f32],
    ) -> Vec<f32> {
        let mut bar = self
            .last
            .backward(parameters, &cache.active, output_bar, gradient);
        relu_backward(&cache.active, &mut bar);
        if let (Some(norm), Some(cache)) = (&self.last_norm, &cache.norm) {
            bar = norm.backward(parameters, cache, &bar, gradient);
        }
        for (block, cache) in self.decoder.iter().zip(&cache.blocks).rev() {
            bar = block.backward(parameters, cache, &bar, gradient);
        }
        self.decoder_first
            .backward(parameters, &cache.input, &bar, gradient)
    }
}
