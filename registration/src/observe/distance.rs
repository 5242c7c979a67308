//! For a place in an image the nearest cell of a mask.

use effigy_fusion::simd;

/// More cells than an image has along a side.
const FAR: i16 = i16::MAX;

/// A mask that is asked for its nearest cell: how far each cell is from the mask along its column is known beforehand,
/// the rest is looked for along the row when asked (the two passes of Saito and Toriwaki 1994, the second on demand).
#[derive(Clone, Debug)]
pub(super) struct Nearest {
    width: usize,
    /// For each cell how many cells down (or, negative, up) the nearest one of the mask is in its column; [`FAR`] in a
    /// column without any. Row-major.
    down: Vec<i16>,
}

impl Nearest {
    /// Row-major; no more than 16,383 cells a side.
    pub(super) fn of(inside: &[bool], width: usize) -> Self {
        let width = width.max(1);
        let mut down = vec![FAR; inside.len()];
        simd::run(
            #[inline(always)]
            || {
                for (cell, &inside) in down.iter_mut().zip(inside) {
                    *cell = if inside { 0 } else { FAR };
                }
                for y in 1..inside.len() / width {
                    let (above, row) = down.split_at_mut(y * width);
                    take_over(&mut row[..width], &above[(y - 1) * width..], -1);
                }
                for y in (1..inside.len() / width).rev() {
                    let (above, row) = down.split_at_mut(y * width);
                    take_over(&mut above[(y - 1) * width..], &row[..width], 1);
                }
            },
        );
        Self { width, down }
    }

    /// The mask's nearest cell `[x, y]` to a cell; `None` of an empty mask.
    pub(super) fn to(&self, [x, y]: [usize; 2]) -> Option<[usize; 2]> {
        let row = &self.down[y * self.width..][..self.width];
        let (mut best, mut squared) = (None, i32::MAX);
        let mut across = 0;
        loop {
            let off = i32::from(across as i16).pow(2);
            let (left, right) = (x.checked_sub(across), x + across);
            if off >= squared || (left.is_none() && right >= self.width) {
                return best;
            }
            for column in left
                .into_iter()
                .chain((right < self.width).then_some(right))
            {
                let down = row[column];
                let distance = off + i32::from(down).pow(2);
                if down != FAR && distance < squared {
                    squared = distance;
                    best = Some([column, y.saturating_add_signed(down.into())]);
                }
            }
            across += 1;
        }
    }

    /// Which cells are farther than this from the mask.
    pub(super) fn farther_than(&self, radius: f32) -> Vec<bool> {
        let reach = (radius as usize).min(self.width);
        let mut far = vec![true; self.down.len()];
        let rows = far
            .chunks_exact_mut(self.width)
            .zip(self.down.chunks_exact(self.width));
        for (far, down) in rows {
            for across in 0..=reach {
                // A disc this far beside its middle is this high.
                let height = (radius * radius - (across * across) as f32).sqrt() as i16;
                let count = self.width - across;
                clear_within(&mut far[across..], &down[..count], height);
                clear_within(&mut far[..count], &down[across..], height);
            }
        }
        far
    }
}

/// A cell is no farther than its neighbour, and a step more.
#[expect(clippy::inline_always, reason = "compiled anew for each vector unit")]
#[inline(always)]
fn take_over(row: &mut [i16], neighbours: &[i16], step: i16) {
    for (cell, neighbour) in row.iter_mut().zip(neighbours) {
        let through = if *neighbour == FAR {
            FAR
        } else {
            neighbour + step
        };
        if through.unsigned_abs() < cell.unsigned_abs() {
            *cell = through;
        }
    }
}

fn clear_within(far: &mut [bool], down: &[i16], height: i16) {
    for (far, down) in far.iter_mut().zip(down) {
        *far &= down.unsigned_abs() > height.unsigned_abs();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const WIDTH: usize = 41;
    const HEIGHT: usize = 30;

    fn seeds() -> Vec<bool> {
        let mut inside = vec![false; WIDTH * HEIGHT];
        for [x, y] in [[3, 4], [25, 10], [26, 11], [10, 28], [40, 0]] {
            inside[y * WIDTH + x] = true;
        }
        inside
    }

    /// Squared, by looking everywhere.
    fn distance([x, y]: [usize; 2]) -> usize {
        let inside = seeds();
        let cells = (0..inside.len()).filter(|&cell| inside[cell]);
        cells
            .map(|cell| (cell % WIDTH).abs_diff(x).pow(2) + (cell / WIDTH).abs_diff(y).pow(2))
            .min()
            .unwrap()
    }

    #[test]
    fn nearest_cells_are_those_of_an_exhaustive_search() {
        let inside = seeds();
        let nearest = Nearest::of(&inside, WIDTH);
        for cell in 0..inside.len() {
            let place = [cell % WIDTH, cell / WIDTH];
            let [x, y] = nearest.to(place).unwrap();
            assert!(inside[y * WIDTH + x]);
            let found = x.abs_diff(place[0]).pow(2) + y.abs_diff(place[1]).pow(2);
            assert_eq!(found, distance(place), "{place:?}");
        }
    }

    #[test]
    fn far_cells_are_those_beyond_the_radius() {
        let nearest = Nearest::of(&seeds(), WIDTH);
        for radius in [1.0, 4.9, 5.0, 11.3] {
            for (cell, &far) in nearest.farther_than(radius).iter().enumerate() {
                let squared = distance([cell % WIDTH, cell / WIDTH]);
                assert_eq!(far, squared as f32 > radius * radius, "{radius}, {cell}");
            }
        }
    }

    #[test]
    fn an_empty_mask_has_no_nearest_cell() {
        let nearest = Nearest::of(&[false; 6], 3);
        assert_eq!(nearest.to([1, 1]), None);
        assert!(nearest.farther_than(2.0).iter().all(|&far| far));
    }
}
