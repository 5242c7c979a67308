//! A U-Net: convolutions on images that get smaller and wider, and back, with what was there beside them.

use super::{
    convolution::{Convolution, Doubling, Images},
    dense::{Bias, Dense, apart, beside, relu_backward, relu_in_place},
    layout::Layout,
};

/// Sizes of a U-Net.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct UNetConfig {
    /// Sizes of image, each half of the one before.
    pub depth: usize,
    /// Channels at full size; twice as many at each smaller one.
    pub width: usize,
}

/// Two convolutions, each followed by `ReLU`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Pair([Convolution; 2]);

#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct UNet {
    down: Vec<Pair>,
    /// From the smallest size up.
    up: Vec<(Doubling, Pair)>,
    last: Dense,
}

/// A pair's input and what either `ReLU` gave.
#[derive(Debug)]
struct PairCache {
    input: Images,
    middle: Images,
    output: Images,
}

/// What the backward pass needs.
#[derive(Debug)]
pub(crate) struct UNetCache {
    down: Vec<PairCache>,
    pooled: Vec<Vec<u8>>,
    /// The small images before doubling, and the pair after it.
    up: Vec<(Images, PairCache)>,
    before_last: Images,
}

impl UNet {
    /// From and to `channels`.
    pub(crate) fn new(layout: &mut Layout, channels: usize, config: UNetConfig) -> Self {
        let width = |level: usize| config.width << level;
        let down = (0..config.depth).map(|level| {
            let inputs = if level == 0 {
                channels
            } else {
                width(level - 1)
            };
            Pair::new(layout, &format!("unet.down{level}"), inputs, width(level))
        });
        let down = down.collect();
        let up = (0..config.depth - 1).rev().map(|level| {
            let name = format!("unet.up{level}");
            let doubling = Doubling::new(
                layout,
                &format!("{name}.double"),
                width(level + 1),
                width(level),
            );
            (
                doubling,
                Pair::new(layout, &name, 2 * width(level), width(level)),
            )
        });
        let up = up.collect();
        let last = Dense::new(layout, "unet.last", (config.width, channels), Bias::With);
        Self { down, up, last }
    }

    /// For one image of this many pixels a side.
    pub(crate) fn multiply_adds(&self, side: usize) -> usize {
        let pixels = |level: usize| (side >> level).pow(2);
        let down = self.down.iter().enumerate();
        let mut sum: usize = down
            .map(|(level, pair)| pair.multiply_adds() * pixels(level))
            .sum();
        for (level, (doubling, pair)) in self.up.iter().rev().enumerate() {
            sum += pair.multiply_adds() * pixels(level);
            sum += doubling.multiply_adds() * pixels(level + 1);
        }
        sum + self.last.multiply_adds() * pixels(0)
    }

    pub(crate) fn forward(&self, parameters: &[f32], input: Images) -> (Images, UNetCache) {
        let (mut down, mut pooled) = (Vec::<PairCache>::new(), Vec::new());
        let mut images = input;
        for (level, pair) in self.down.iter().enumerate() {
            if level > 0 {
                let (small, chosen) = down[level - 1].output.max_pool();
                pooled.push(chosen);
                images = small;
            }
            let cache = pair.forward(parameters, std::mem::take(&mut images));
            down.push(cache);
        }
        let mut small = down[self.down.len() - 1].output.clone();
        let mut up = Vec::new();
        for (step, (doubling, pair)) in self.up.iter().enumerate() {
            let doubled = doubling.forward(parameters, &small);
            let beside_it = &down[self.down.len() - 2 - step].output;
            let both = Images {
                side: doubled.side,
                channels: doubled.channels + beside_it.channels,
                values: beside(
                    &doubled.values,
                    doubled.channels,
                    &beside_it.values,
                    beside_it.channels,
                ),
            };
            let cache = pair.forward(parameters, both);
            let output = cache.output.clone();
            up.push((std::mem::replace(&mut small, output), cache));
        }
        let values = self.last.forward(parameters, &small.values);
        let out = Images { side: small.side, channels: self.last.outputs, values };
        (out, UNetCache { down, pooled, up, before_last: small })
    }

    /// Adds the gradient of all layers to `gradient`; the gradient by the input.
    pub(crate) fn backward(
        &self,
        parameters: &[f32],
        cache: &UNetCache,
        output_bar: &Images,
        gradient: &mut [f32],
    ) -> Images {
        let mut bar = Images {
            values: self.last.backward(
                parameters,
                &cache.before_last.values,
                &output_bar.values,
                gradient,
            ),
            ..cache.before_last
        };
        let mut side_bars: Vec<Option<Images>> = self.down.iter().map(|_| None).collect();
        for (step, (doubling, pair)) in self.up.iter().enumerate().rev() {
            let (small, pair_cache) = &cache.up[step];
            let both = pair.backward(parameters, pair_cache, bar, gradient);
            let level = self.down.len() - 2 - step;
            let own = cache.down[level].output.channels;
            let (doubled, beside_it) = apart(&both.values, both.channels - own, own);
            let channels = both.channels - own;
            side_bars[level] = Some(Images { side: both.side, channels: own, values: beside_it });
            let doubled = Images { side: both.side, channels, values: doubled };
            bar = doubling.backward(parameters, small, &doubled, gradient);
        }
        for (level, pair) in self.down.iter().enumerate().rev() {
            if let Some(side_bar) = side_bars[level].take() {
                let sums = bar.values.iter_mut().zip(&side_bar.values);
                sums.for_each(|(sum, x)| *sum += x);
            }
            bar = pair.backward(parameters, &cache.down[level], bar, gradient);
            if level > 0 {
                let large = &cache.down[level - 1].output;
                bar = large.max_pool_backward(&bar, &cache.pooled[level - 1]);
            }
        }
        bar
    }
}

impl Pair {
    fn new(layout: &mut Layout, name: &str, inputs: usize, outputs: usize) -> Self {
        Self([
            Convolution::new(layout, &format!("{name}.conv0"), inputs, outputs),
            Convolution::new(layout, &format!("{name}.conv1"), outputs, outputs),
        ])
    }

    fn multiply_adds(&self) -> usize {
        self.0.iter().map(Convolution::multiply_adds).sum()
    }

    fn forward(&self, parameters: &[f32], input: Images) -> PairCache {
        let mut middle = self.0[0].forward(parameters, &input);
        relu_in_place(&mut middle.values);
        let mut output = self.0[1].forward(parameters, &middle);
        relu_in_place(&mut output.values);
        PairCache { input, middle, output }
    }

    fn backward(
        &self,
        parameters: &[f32],
        cache: &PairCache,
        mut bar: Images,
        gradient: &mut [f32],
    ) -> Images {
        relu_backward(&cache.output.values, &mut bar.values);
        let mut bar = self.0[1].backward(parameters, &cache.middle, &mut bar, gradient);
        relu_backward(&cache.middle.values, &mut bar.values);
        self.0[0].backward(parameters, &cache.input, &mut bar, gradient)
    }
}
