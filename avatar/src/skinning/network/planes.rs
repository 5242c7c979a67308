//! Three planes of cells around a cloud: means of what falls into a cell, and what lies at a point between cells.

use glam::{Vec2, Vec3};

use crate::nn::convolution::Images;

/// xz, xy and yz: which coordinates a plane keeps; the first runs along a row.
const AXES: [[usize; 2]; 3] = [[0, 2], [0, 1], [1, 2]];

/// A grid on each plane.
#[derive(Clone, Copy, Debug)]
pub(super) struct Planes {
    pub(super) side: usize,
    pub(super) half_extent: f32,
}

/// Which cell of each plane each point falls into.
#[derive(Debug)]
pub(super) struct Cells {
    /// [3][points], numbers within a plane.
    cells: [Vec<u32>; 3],
    /// One over the points in a cell, 0 in an empty one; [3][cells].
    shares: [Vec<f32>; 3],
}

/// The four cells around a point on one plane, and their say.
type Corners = [(u32, f32); 4];

impl Planes {
    /// A point's place on a plane, in [0, 1).
    fn place(&self, point: Vec3, plane: usize) -> Vec2 {
        let [first, second] = AXES[plane];
        let on_plane = Vec2::new(point[first], point[second]);
        let unit = on_plane / (2.0 * self.half_extent) + 0.5;
        unit.clamp(Vec2::ZERO, Vec2::splat(1.0 - 1e-5))
    }

    pub(super) fn cells(&self, points: &[Vec3]) -> Cells {
        let side = self.side;
        let cells = [0, 1, 2].map(|plane| -> Vec<u32> {
            let cell = |&point: &Vec3| {
                let place = self.place(point, plane) * side as f32;
                (place.x as usize).min(side - 1) + side * (place.y as usize).min(side - 1)
            };
            points.iter().map(|point| cell(point) as u32).collect()
        });
        let shares = [0, 1, 2].map(|plane| {
            let mut counts = vec![0.0_f32; side * side];
            for &cell in &cells[plane] {
                counts[cell as usize] += 1.0;
            }
            let share = |count: &f32| if *count > 0.0 { 1.0 / count } else { 0.0 };
            counts.iter().map(share).collect()
        });
        Cells { cells, shares }
    }

    /// What lies at the points, bilinearly, one plane after the other.
    ///
    /// # Shapes
    /// `images` 3 x [side, side, channels], result [points, 3 channels]
    pub(super) fn sample(&self, images: &Images, points: &[Vec3]) -> Vec<f32> {
        let channels = images.channels;
        let mut out = vec![0.0; points.len() * 3 * channels];
        for (point, row) in points.iter().zip(out.chunks_exact_mut(3 * channels)) {
            for (plane, row) in row.chunks_exact_mut(channels).enumerate() {
                for (cell, share) in self.corners(*point, plane) {
                    let from = (plane * self.side * self.side + cell as usize) * channels;
                    let values = &images.values[from..from + channels];
                    row.iter_mut()
                        .zip(values)
                        .for_each(|(y, x)| *y += share * x);
                }
            }
        }
        out
    }

    /// The gradient by the images.
    pub(super) fn sample_backward(&self, bars: &[f32], points: &[Vec3], channels: usize) -> Images {
        let mut images = Images::zeros(3, self.side, channels);
        for (point, row) in points.iter().zip(bars.chunks_exact(3 * channels)) {
            for (plane, row) in row.chunks_exact(channels).enumerate() {
                for (cell, share) in self.corners(*point, plane) {
                    let to = (plane * self.side * self.side + cell as usize) * channels;
                    let values = &mut images.values[to..to + channels];
                    values
                        .iter_mut()
                        .zip(row)
                        .for_each(|(y, x)| *y += share * x);
                }
            }
        }
        images
    }

    /// The first and last cell's middles lie on the planes' borders (the paper's framework calls it aligned corners).
    fn corners(&self, point: Vec3, plane: usize) -> Corners {
        let place = self.place(point, plane) * (self.side - 1) as f32;
        let low = place.floor().min(Vec2::splat((self.side - 2) as f32));
        let Vec2 { x, y } = place - low;
        let first = low.x as usize + self.side * low.y as usize;
        let at = |offset: usize| (first + offset) as u32;
        [
            (at(0), (1.0 - x) * (1.0 - y)),
            (at(1), x * (1.0 - y)),
            (at(self.side), (1.0 - x) * y),
            (at(self.side + 1), x * y),
        ]
    }
}

impl Cells {
    /// The mean of what falls into each cell; 0 in empty ones.
    ///
    /// # Shapes
    /// `values` [points, channels], result 3 x [side, side, channels]
    pub(super) fn mean(&self, values: &[f32], channels: usize) -> Images {
        let cells = self.shares[0].len();
        let mut images = Images::zeros(3, cells.isqrt(), channels);
        let planes = images.values.chunks_exact_mut(cells * channels);
        for ((cell, shares), plane) in self.cells.iter().zip(&self.shares).zip(planes) {
            for (&cell, row) in cell.iter().zip(values.chunks_exact(channels)) {
                let sums = &mut plane[cell as usize * channels..][..channels];
                sums.iter_mut().zip(row).for_each(|(sum, x)| *sum += x);
            }
            for (sums, share) in plane.chunks_exact_mut(channels).zip(shares) {
                for sum in sums {
                    *sum *= share;
                }
            }
        }
        images
    }

    /// The gradient by the values whose mean was taken.
    pub(super) fn mean_backward(&self, bar: &Images) -> Vec<f32> {
        let channels = bar.channels;
        let mut out = vec![0.0; self.cells[0].len() * channels];
        let planes = bar.values.chunks_exact(self.shares[0].len() * channels);
        for ((cell, shares), plane) in self.cells.iter().zip(&self.shares).zip(planes) {
            for (&cell, row) in cell.iter().zip(out.chunks_exact_mut(channels)) {
                let share = shares[cell as usize];
                let bars = &plane[cell as usize * channels..][..channels];
                row.iter_mut().zip(bars).for_each(|(y, x)| *y += share * x);
            }
        }
        out
    }

    /// For each point the sum over the planes of the mean in its cell. This map is its own transpose, so it is its
    /// own backward pass too.
    ///
    /// # Shapes
    /// `values` and result [points, channels]
    pub(super) fn pool(&self, values: &[f32], channels: usize) -> Vec<f32> {
        let means = self.mean(values, channels);
        let mut out = vec![0.0; values.len()];
        let planes = means.values.chunks_exact(self.shares[0].len() * channels);
        for (cell, plane) in self.cells.iter().zip(planes) {
            for (&cell, row) in cell.iter().zip(out.chunks_exact_mut(channels)) {
                let mean = &plane[cell as usize * channels..][..channels];
                row.iter_mut().zip(mean).for_each(|(y, x)| *y += x);
            }
        }
        out
    }
}
