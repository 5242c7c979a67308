//! Noise and holes inside a person, from the depth image alone: the same for real frames and simulated ones.

/// What one depth image looks like inside a mask.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Interior {
    pub depth_m: f64,
    /// Deviation from the mean of the 7x7 pixels around (a plane fitted there has the same value in the middle):
    /// 1.48 times the median of its size, so that folds and edges hardly count.
    pub sigma_m: f64,
    /// How alike that deviation is 1, 2, 3, 4 and 6 pixels along a row.
    pub correlation: [f64; 5],
    /// Share of the mask without an answer.
    pub hole_share: f64,
    /// Connected holes for 10,000 pixels of mask; their median and 90th percentile in pixels.
    pub holes_per_10k: f64,
    pub hole_px: [f64; 2],
}

const RADIUS: usize = 3;
const LAGS: [usize; 5] = [1, 2, 3, 4, 6];

/// Measures a depth image in metres, row-major, 0 for no answer.
pub fn interior(depth_m: &[f32], width: usize, mask: &[bool]) -> Interior {
    let residuals = residuals(depth_m, width, mask);
    let mut sizes: Vec<f64> = residuals.iter().flatten().map(|r| r.abs()).collect();
    let sigma_m = 1.4826 * percentile(&mut sizes, 0.5);
    let mut holes = hole_sizes(depth_m, width, mask);
    let masked = mask.iter().filter(|&&inside| inside).count() as f64;
    let mut depths: Vec<f64> = depth_m
        .iter()
        .zip(mask)
        .filter(|(z, inside)| **inside && **z > 0.0)
        .map(|(z, _)| f64::from(*z))
        .collect();
    Interior {
        depth_m: percentile(&mut depths, 0.5),
        sigma_m,
        correlation: LAGS.map(|lag| correlation(&residuals, width, lag, 4.0 * sigma_m)),
        hole_share: holes.iter().sum::<f64>() / masked.max(1.0),
        holes_per_10k: holes.len() as f64 * 1e4 / masked.max(1.0),
        hole_px: [percentile(&mut holes, 0.5), percentile(&mut holes, 0.9)],
    }
}

/// Everything between two depths, with gaps narrower than twice the reach closed.
pub fn closed_mask(
    depth_m: &[f32],
    width: usize,
    [near, far]: [f32; 2],
    reach: usize,
) -> Vec<bool> {
    let inside: Vec<bool> = depth_m.iter().map(|z| (near..far).contains(z)).collect();
    let grown = spread(&inside, width, reach, true);
    spread(&grown, width, reach, false)
}

/// Every pixel within reach (along rows, then columns) of one that is `value` becomes `value`.
fn spread(mask: &[bool], width: usize, reach: usize, value: bool) -> Vec<bool> {
    let height = mask.len() / width;
    let mut rows = mask.to_vec();
    let mut both = mask.to_vec();
    for y in 0..height {
        for x in 0..width {
            let mut near = x.saturating_sub(reach)..(x + reach + 1).min(width);
            if near.any(|at| mask[y * width + at] == value) {
                rows[y * width + x] = value;
            }
        }
    }
    for y in 0..height {
        for x in 0..width {
            let mut near = y.saturating_sub(reach)..(y + reach + 1).min(height);
            let found = near.any(|at| rows[at * width + x] == value);
            both[y * width + x] = if found { value } else { !value };
        }
    }
    both
}

/// Each pixel minus the mean around it, where all of that is there and of one surface.
fn residuals(depth_m: &[f32], width: usize, mask: &[bool]) -> Vec<Option<f64>> {
    const SURFACE_M: f32 = 0.03;
    let height = depth_m.len() / width;
    let mut residuals = vec![None; depth_m.len()];
    for y in RADIUS..height.saturating_sub(RADIUS) {
        for x in RADIUS..width - RADIUS {
            let here = depth_m[y * width + x];
            let around = (y - RADIUS..=y + RADIUS)
                .flat_map(|row| (x - RADIUS..=x + RADIUS).map(move |column| row * width + column));
            let whole = around
                .clone()
                .all(|p| mask[p] && depth_m[p] > 0.0 && (depth_m[p] - here).abs() < SURFACE_M);
            if whole {
                let mean = around.map(|p| f64::from(depth_m[p])).sum::<f64>()
                    / ((2 * RADIUS + 1) * (2 * RADIUS + 1)) as f64;
                residuals[y * width + x] = Some(f64::from(here) - mean);
            }
        }
    }
    residuals
}

fn correlation(residuals: &[Option<f64>], width: usize, lag: usize, limit: f64) -> f64 {
    let (mut products, mut squares) = (0.0, 0.0);
    for (pixel, here) in residuals.iter().enumerate() {
        if pixel % width + lag >= width {
            continue;
        }
        if let (Some(a), Some(b)) = (here, residuals[pixel + lag]) {
            let (a, b) = (a.clamp(-limit, limit), b.clamp(-limit, limit));
            products += a * b;
            squares += 0.5 * (a * a + b * b);
        }
    }
    if squares > 0.0 {
        products / squares
    } else {
        0.0
    }
}

/// Sizes of connected holes, in pixels.
fn hole_sizes(depth_m: &[f32], width: usize, mask: &[bool]) -> Vec<f64> {
    let is_hole = |p: usize| mask[p] && depth_m[p] <= 0.0;
    let mut seen = vec![false; depth_m.len()];
    let mut sizes = Vec::new();
    for start in 0..depth_m.len() {
        if seen[start] || !is_hole(start) {
            continue;
        }
        let mut size = 0.0;
        let mut open = vec![start];
        seen[start] = true;
        while let Some(pixel) = open.pop() {
            size += 1.0;
            let (x, y) = (pixel % width, pixel / width);
            let mut visit = |there: bool, p: usize| {
                if there && !seen[p] && is_hole(p) {
                    seen[p] = true;
                    open.push(p);
                }
            };
            visit(x > 0, pixel.wrapping_sub(1));
            visit(x + 1 < width, pixel + 1);
            visit(y > 0, pixel.wrapping_sub(width));
            visit(pixel + width < depth_m.len(), pixel + width);
        }
        sizes.push(size);
    }
    sizes
}

fn percentile(values: &mut [f64], share: f64) -> f64 {
    if values.is_empty() {
        return 0.0;
    }
    values.sort_by(f64::total_cmp);
    values[((values.len() - 1) as f64 * share).round() as usize]
}
