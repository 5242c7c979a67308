//! For each cell of an image the nearest cell of a mask.

/// Cells without any: the mask is empty.
const FAR: i32 = i16::MAX as i32;

/// Two sweeps that pass the nearest mask cell on to neighbours (Danielsson 1980): exact but for rare ties, which is
/// far below a cell. Row-major; the result names a cell as `[x, y]`.
pub(super) fn nearest_inside(inside: &[bool], width: usize) -> Vec<[i16; 2]> {
    let height = inside.len() / width.max(1);
    let mut nearest: Vec<[i16; 2]> = (0..inside.len())
        .map(|i| {
            if inside[i] {
                [(i % width) as i16, (i / width) as i16]
            } else {
                [FAR as i16; 2]
            }
        })
        .collect();
    for y in 0..height {
        for x in 0..width {
            improve(
                &mut nearest,
                width,
                [x, y],
                &[[-1, 0], [-1, -1], [0, -1], [1, -1]],
            );
        }
        for x in (0..width).rev() {
            improve(&mut nearest, width, [x, y], &[[1, 0]]);
        }
    }
    for y in (0..height).rev() {
        for x in (0..width).rev() {
            improve(
                &mut nearest,
                width,
                [x, y],
                &[[1, 0], [1, 1], [0, 1], [-1, 1]],
            );
        }
        for x in 0..width {
            improve(&mut nearest, width, [x, y], &[[-1, 0]]);
        }
    }
    nearest
}

fn improve(nearest: &mut [[i16; 2]], width: usize, [x, y]: [usize; 2], neighbours: &[[i32; 2]]) {
    let here = y * width + x;
    let mut best = squared_distance(nearest[here], x, y);
    if best == 0 {
        return;
    }
    for [dx, dy] in neighbours {
        let (nx, ny) = (x as i32 + dx, y as i32 + dy);
        if nx < 0 || ny < 0 || nx >= width as i32 || (ny as usize) * width >= nearest.len() {
            continue;
        }
        let candidate = nearest[ny as usize * width + nx as usize];
        let distance = squared_distance(candidate, x, y);
        if distance < best {
            best = distance;
            nearest[here] = candidate;
        }
    }
}

fn squared_distance(cell: [i16; 2], x: usize, y: usize) -> i32 {
    if i32::from(cell[0]) == FAR {
        return i32::MAX;
    }
    let (dx, dy) = (i32::from(cell[0]) - x as i32, i32::from(cell[1]) - y as i32);
    dx * dx + dy * dy
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
                .map(|s| squared_distance([s[0] as i16, s[1] as i16], x, y))
                .min()
                .unwrap();
            let error = f64::from(squared_distance(cell, x, y)).sqrt() - f64::from(exact).sqrt();
            assert!(error < 0.1, "{error} cells at {x}, {y}");
        }
    }
}
