//! For each cell of an image the nearest cell of a mask.

/// Cells without any: the mask is empty.
const FAR: i16 = i16::MAX;

/// Two sweeps that pass the nearest mask cell on to neighbours (Danielsson 1980): exact but for rare ties, which is
/// far below a cell. Row-major; the result names a cell as `[x, y]`.
pub(super) fn nearest_inside(inside: &[bool], width: usize) -> Vec<[i16; 2]> {
    let width = width.max(1);
    let mut nearest = vec![[FAR; 2]; inside.len()];
    for (y, (row, inside)) in nearest
        .chunks_exact_mut(width)
        .zip(inside.chunks_exact(width))
        .enumerate()
    {
        for (x, (cell, _)) in row.iter_mut().zip(inside).enumerate().filter(|(_, c)| *c.1) {
            *cell = [x as i16, y as i16];
        }
    }
    let height = inside.len() / width;
    for y in 0..height {
        let (above, row) = rows(&mut nearest, width, y, y.wrapping_sub(1));
        sweep(row, above, y);
    }
    for y in (0..height).rev() {
        let (below, row) = rows(&mut nearest, width, y, y + 1);
        sweep(row, below, y);
    }
    nearest
}

/// The finished row beside a row, if there is one, and the row itself.
fn rows(
    nearest: &mut [[i16; 2]],
    width: usize,
    y: usize,
    finished: usize,
) -> (Option<&[[i16; 2]]>, &mut [[i16; 2]]) {
    if finished >= nearest.len() / width {
        return (None, &mut nearest[y * width..(y + 1) * width]);
    }
    let (upper, lower) = nearest.split_at_mut(y.max(finished) * width);
    let (first, second) = (&mut upper[y.min(finished) * width..], &mut lower[..width]);
    if finished < y {
        (Some(first), second)
    } else {
        (Some(second), first)
    }
}

/// Takes over what the finished row knows, then passes it on along the row, both ways.
fn sweep(row: &mut [[i16; 2]], finished: Option<&[[i16; 2]]>, y: usize) {
    let y = y as i32;
    if let Some(finished) = finished {
        for x in 0..row.len() {
            let left = finished[x.saturating_sub(1)];
            let right = finished[(x + 1).min(finished.len() - 1)];
            row[x] = nearer(
                nearer(nearer(row[x], finished[x], x, y), left, x, y),
                right,
                x,
                y,
            );
        }
    }
    for x in 1..row.len() {
        row[x] = nearer(row[x], row[x - 1], x, y);
    }
    for x in (1..row.len()).rev() {
        row[x - 1] = nearer(row[x - 1], row[x], x - 1, y);
    }
}

#[inline]
fn nearer(present: [i16; 2], candidate: [i16; 2], x: usize, y: i32) -> [i16; 2] {
    let squared = |cell: [i16; 2]| squared_distance(cell, x as i32, y);
    if squared(candidate) < squared(present) {
        candidate
    } else {
        present
    }
}

#[inline]
fn squared_distance([cx, cy]: [i16; 2], x: i32, y: i32) -> i32 {
    let (dx, dy) = (i32::from(cx) - x, i32::from(cy) - y);
    // Twice the square of 32767 is more than an i32 holds.
    (dx * dx).saturating_add(dy * dy)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nearest_cells_are_those_of_an_exhaustive_search_to_a_tenth_of_a_cell() {
        let (width, height) = (40, 30);
        let seeds = [[3, 4], [25, 10], [26, 11], [10, 28]];
        let mut inside = vec![false; width * height];
        for [x, y] in seeds {
            inside[y * width + x] = true;
        }
        let nearest = nearest_inside(&inside, width);
        for (i, &cell) in nearest.iter().enumerate() {
            let (x, y) = (i % width, i / width);
            let exact = seeds
                .iter()
                .map(|s| squared_distance([s[0] as i16, s[1] as i16], x as i32, y as i32))
                .min()
                .unwrap();
            let error = f64::from(squared_distance(cell, x as i32, y as i32)).sqrt()
                - f64::from(exact).sqrt();
            assert!(error < 0.1, "{error} cells at {x}, {y}");
        }
    }
}
