//! Soft darkness where a surface lies behind its neighbourhood (after Luft, Colditz and Deussen 2006,
//! "Image enhancement by unsharp masking the depth buffer").

use effigy_fusion::mesh::z_buffer::Raster;

/// Half the width of the neighbourhood, in metres on the surface: about a hand.
const RADIUS_M: f32 = 0.05;
/// This far behind its neighbourhood's mean, a pixel is as dark as it gets.
const FULL_DEPTH_M: f32 = 0.06;
const MAX_RADIUS_PX: usize = 64;

/// 1 for each pixel in the open, towards 0 in a crevice.
pub(super) fn crevices(raster: &Raster, focal_px: f32) -> Vec<f32> {
    let drawn = || raster.depth.iter().copied().filter(|d| *d > 0.0);
    let nearest = drawn().fold(f32::MAX, f32::min);
    let farthest = drawn().fold(0.0, f32::max);
    let radius = (focal_px * RADIUS_M / (0.5 * (nearest + farthest)).max(0.1)).max(1.0) as usize;
    // What is not drawn lies behind everything: it darkens nothing.
    let filled = |d: &f32| if *d > 0.0 { *d } else { farthest };
    let mut mean: Vec<f32> = raster.depth.iter().map(filled).collect();
    for _ in 0..2 {
        blur(
            &mut mean,
            raster.width,
            raster.height,
            radius.min(MAX_RADIUS_PX),
        );
    }
    let open = |(depth, mean): (&f32, &f32)| 1.0 - ((depth - mean) / FULL_DEPTH_M).clamp(0.0, 1.0);
    raster.depth.iter().zip(&mean).map(open).collect()
}

/// A box blur along rows, then along columns; the outermost values go on beyond the edge.
fn blur(values: &mut [f32], width: usize, height: usize, radius: usize) {
    let mut line = Vec::new();
    for y in 0..height {
        blur_line(values, &mut line, y * width, 1, [width, radius]);
    }
    for x in 0..width {
        blur_line(values, &mut line, x, width, [height, radius]);
    }
}

fn blur_line(
    values: &mut [f32],
    line: &mut Vec<f32>,
    start: usize,
    stride: usize,
    [length, radius]: [usize; 2],
) {
    line.clear();
    line.extend((0..length).map(|i| values[start + i * stride]));
    let at = |i: isize| f64::from(line[i.clamp(0, length as isize - 1) as usize]);
    let r = radius as isize;
    let mut sum: f64 = (-r..=r).map(at).sum();
    for i in 0..length {
        values[start + i * stride] = (sum / (2 * radius + 1) as f64) as f32;
        let i = i as isize;
        sum += at(i + r + 1) - at(i - r);
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec2;

    use super::*;

    fn raster(depth: impl Fn(usize, usize) -> f32) -> Raster {
        let (width, height) = (60, 60);
        let depth: Vec<f32> = (0..width * height)
            .map(|i| depth(i % width, i / width))
            .collect();
        let count = depth.len();
        Raster {
            width,
            height,
            depth,
            triangle: vec![0; count],
            barycentric: vec![Vec2::ZERO; count],
        }
    }

    #[test]
    fn a_wall_is_open_and_a_groove_in_it_is_dark() {
        let flat = crevices(&raster(|_, _| 2.0), 300.0);
        assert!(flat.iter().all(|open| (open - 1.0).abs() < 1e-4));
        let grooved = crevices(
            &raster(|x, _| if (28..32).contains(&x) { 2.1 } else { 2.0 }),
            300.0,
        );
        assert!(grooved[30 * 60 + 30] < 0.3 && grooved[30 * 60 + 5] > 0.99);
    }

    #[test]
    fn the_figures_edge_is_not_darkened_by_emptiness() {
        let figure = crevices(&raster(|x, _| if x < 30 { 2.0 } else { 0.0 }), 300.0);
        assert!(figure[30 * 60 + 29] > 0.99);
    }
}
