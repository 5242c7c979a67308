//! Convolutions over square images: 3 x 3 by a matrix product over gathered neighbourhoods, 2 x 2 pooling, and the
//! 2 x 2 transposed convolution that undoes its size.
//!
//! Some images of one size are handled together: [images * side * side, channels], row-major in each image.

use super::{
    dense::{Bias, Dense},
    layout::{Layout, Start},
    matmul::Write,
};

/// Images of one size.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Images {
    pub(crate) side: usize,
    pub(crate) channels: usize,
    /// [images * side * side, channels]
    pub(crate) values: Vec<f32>,
}

/// Image rows whose neighbourhoods are gathered at a time: they stay in the cache.
const ROWS_AT_ONCE: usize = 8;

impl Images {
    pub(crate) fn zeros(count: usize, side: usize, channels: usize) -> Self {
        Self { side, channels, values: vec![0.0; count * side * side * channels] }
    }

    pub(crate) fn count(&self) -> usize {
        self.values.len() / (self.side * self.side * self.channels)
    }

    /// The largest of each 2 x 2 pixels, and which of the four it was.
    pub(crate) fn max_pool(&self) -> (Self, Vec<u8>) {
        let (side, channels) = (self.side / 2, self.channels);
        let mut small = Self::zeros(self.count(), side, channels);
        let mut chosen = vec![0; small.values.len()];
        for (pixel, out) in small.values.chunks_exact_mut(channels).enumerate() {
            let chosen = &mut chosen[pixel * channels..][..channels];
            for quarter in 0..4 {
                let from = self.fine_pixel(pixel, quarter) * channels;
                let fine = &self.values[from..][..channels];
                for ((best, which), &x) in out.iter_mut().zip(&mut *chosen).zip(fine) {
                    if quarter == 0 || x > *best {
                        (*best, *which) = (x, quarter as u8);
                    }
                }
            }
        }
        (small, chosen)
    }

    /// The gradient by the images that were pooled; `self` has their size.
    pub(crate) fn max_pool_backward(&self, small_bar: &Self, chosen: &[u8]) -> Self {
        let channels = self.channels;
        let mut bar = Self { values: vec![0.0; self.values.len()], ..*self };
        for (pixel, bars) in small_bar.values.chunks_exact(channels).enumerate() {
            for (channel, x) in bars.iter().enumerate() {
                let quarter = chosen[pixel * channels + channel] as usize;
                bar.values[self.fine_pixel(pixel, quarter) * channels + channel] = *x;
            }
        }
        bar
    }

    /// Where a quarter of a half-size image's pixel lies in this one.
    fn fine_pixel(&self, small_pixel: usize, quarter: usize) -> usize {
        let small_side = self.side / 2;
        let (row, column) = (small_pixel / small_side, small_pixel % small_side);
        // Images follow each other, so rows go on counting from one to the next.
        (2 * row + quarter / 2) * self.side + 2 * column + quarter % 2
    }
}

/// 3 x 3, zeros around the image, with bias.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Convolution(Dense);

impl Convolution {
    /// Xavier-normal weights, zero bias.
    pub(crate) fn new(layout: &mut Layout, name: &str, inputs: usize, outputs: usize) -> Self {
        let start = Start::Normal((2.0 / (9 * (inputs + outputs)) as f32).sqrt());
        Self(Dense::starting(
            layout,
            name,
            (9 * inputs, outputs),
            Bias::With,
            start,
        ))
    }

    /// For each pixel.
    pub(crate) fn multiply_adds(&self) -> usize {
        self.0.multiply_adds()
    }

    pub(crate) fn forward(&self, parameters: &[f32], input: &Images) -> Images {
        let side = input.side;
        let mut out = Images::zeros(input.count(), side, self.0.outputs);
        let mut around = Vec::new();
        for (block, out) in blocks(side, &mut out.values, self.0.outputs) {
            gather(input, block, &mut around);
            self.0
                .forward_into(parameters, &around, out, Write::Replace);
        }
        out
    }

    /// Adds the layer's gradient to `gradient`; the gradient by the input.
    pub(crate) fn backward(
        &self,
        parameters: &[f32],
        input: &Images,
        output_bar: &mut Images,
        gradient: &mut [f32],
    ) -> Images {
        let side = input.side;
        let mut input_bar = Images::zeros(input.count(), side, input.channels);
        let mut around = Vec::new();
        for (block, bar) in blocks(side, &mut output_bar.values, self.0.outputs) {
            gather(input, block, &mut around);
            let bars = self.0.backward(parameters, &around, bar, gradient);
            scatter(&mut input_bar, block, &bars);
        }
        input_bar
    }
}

/// Some rows of one image.
#[derive(Clone, Copy)]
struct Block {
    image: usize,
    first: usize,
    rows: usize,
}

/// All images' rows, a few at a time, with their part of `values`.
fn blocks(
    side: usize,
    values: &mut [f32],
    channels: usize,
) -> impl Iterator<Item = (Block, &mut [f32])> {
    let images = values.chunks_exact_mut(side * side * channels);
    images.enumerate().flat_map(move |(image, values)| {
        let parts = values.chunks_mut(ROWS_AT_ONCE * side * channels);
        parts.enumerate().map(move |(number, part)| {
            let rows = part.len() / (side * channels);
            (Block { image, first: number * ROWS_AT_ONCE, rows }, part)
        })
    })
}

/// Calls `visit(neighbourhood offset, pixel offset, length)` for runs of neighbouring values; what lies outside is left out.
fn neighbours(images: &Images, block: Block, mut visit: impl FnMut(usize, usize, usize)) {
    let (side, channels) = (images.side as isize, images.channels);
    let pixels = side * side * block.image as isize;
    let mut place = 0;
    for row in block.first as isize..(block.first + block.rows) as isize {
        for column in 0..side {
            for other in row - 1..=row + 1 {
                let (left, right) = ((column - 1).max(0), (column + 1).min(side - 1));
                if (0..side).contains(&other) {
                    let skipped = (left - (column - 1)) as usize * channels;
                    let from = (pixels + other * side + left) as usize * channels;
                    visit(
                        place + skipped,
                        from,
                        (right - left + 1) as usize * channels,
                    );
                }
                place += 3 * channels;
            }
        }
    }
}

/// The 3 x 3 neighbourhood of each pixel of the block; [rows * side, 9 * channels].
fn gather(images: &Images, block: Block, around: &mut Vec<f32>) {
    around.clear();
    around.resize(block.rows * images.side * 9 * images.channels, 0.0);
    neighbours(images, block, |to, from, length| {
        around[to..to + length].copy_from_slice(&images.values[from..from + length]);
    });
}

/// Adds neighbourhoods back to where they came from.
fn scatter(images: &mut Images, block: Block, around: &[f32]) {
    let Images { side, channels, .. } = *images;
    let shape = Images { side, channels, values: Vec::new() };
    neighbours(&shape, block, |from, to, length| {
        let values = &mut images.values[to..to + length];
        values
            .iter_mut()
            .zip(&around[from..from + length])
            .for_each(|(sum, x)| *sum += x);
    });
}

/// Each pixel becomes 2 x 2 pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Doubling {
    /// To the four pixels' channels, one after the other.
    dense: Dense,
    /// [outputs], the same for the four pixels.
    bias: usize,
    outputs: usize,
}

impl Doubling {
    pub(crate) fn new(layout: &mut Layout, name: &str, inputs: usize, outputs: usize) -> Self {
        let start = Start::Normal((2.0 / (4 * (inputs + outputs)) as f32).sqrt());
        let sizes = (inputs, 4 * outputs);
        let dense = Dense::starting(layout, name, sizes, Bias::Without, start);
        let bias = layout.add(format!("{name}.bias"), vec![outputs], Start::Zero);
        Self { dense, bias, outputs }
    }

    /// For each pixel of the small image.
    pub(crate) fn multiply_adds(&self) -> usize {
        self.dense.multiply_adds()
    }

    pub(crate) fn forward(&self, parameters: &[f32], input: &Images) -> Images {
        let fours = self.dense.forward(parameters, &input.values);
        let mut out = Images::zeros(input.count(), 2 * input.side, self.outputs);
        let bias = &parameters[self.bias..][..self.outputs];
        for (number, pixel) in fours.chunks_exact(self.outputs).enumerate() {
            let to = out.fine_pixel(number / 4, number % 4) * self.outputs;
            let values = out.values[to..][..self.outputs].iter_mut();
            for ((y, x), b) in values.zip(pixel).zip(bias) {
                *y = x + b;
            }
        }
        out
    }

    /// Adds the layer's gradient to `gradient`; the gradient by the input.
    pub(crate) fn backward(
        &self,
        parameters: &[f32],
        input: &Images,
        output_bar: &Images,
        gradient: &mut [f32],
    ) -> Images {
        let small_pixels = input.values.len() / input.channels;
        let mut fours = Vec::with_capacity(output_bar.values.len());
        for number in 0..4 * small_pixels {
            let from = output_bar.fine_pixel(number / 4, number % 4) * self.outputs;
            let bars = &output_bar.values[from..][..self.outputs];
            fours.extend_from_slice(bars);
            let sums = &mut gradient[self.bias..][..self.outputs];
            sums.iter_mut().zip(bars).for_each(|(sum, bar)| *sum += bar);
        }
        let values = self
            .dense
            .backward(parameters, &input.values, &fours, gradient);
        Images { values, ..*input }
    }
}
