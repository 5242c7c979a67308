//! Which part of the depth camera's image a picture shows, and how large.

use effigy_capture::Intrinsics;
use effigy_fusion::CleanFrame;

/// Room around the person, as a share of the person's height in the image.
const MARGIN: f32 = 0.08;
/// Below this many pixels a mask is noise, not a person.
const MIN_PERSON_PX: usize = 200;

/// A window into a source image: output pixel to source pixel is a scale and an offset.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Framing {
    pub width: u32,
    pub height: u32,
    /// Source coordinates of the output's upper left corner (a pixel's centre is at an integer).
    left_px: f32,
    top_px: f32,
    /// Output pixels a source pixel.
    scale: f32,
}

impl Framing {
    /// The whole image at its own size.
    pub fn whole(width: usize, height: usize) -> Self {
        let (width, height) = (width as u32, height as u32);
        Self { width, height, left_px: -0.5, top_px: -0.5, scale: 1.0 }
    }

    /// The whole image fitted into a size, centred.
    pub fn fitted(source: [usize; 2], size: [u32; 2]) -> Self {
        Self::of_rectangle(
            [0.0, 0.0, source[0] as f32 - 1.0, source[1] as f32 - 1.0],
            size,
        )
    }

    /// The person with some air around, centred; the whole image if there is nobody.
    pub fn person(clean: &CleanFrame, size: [u32; 2]) -> Self {
        let source = [clean.depth.width, clean.depth.height];
        let Some(bounds) = mask_bounds(&clean.person, source[0]) else {
            return Self::fitted(source, size);
        };
        let air = MARGIN * (bounds[3] - bounds[1]).max(bounds[2] - bounds[0]);
        let [x0, y0, x1, y1] = bounds;
        Self::of_rectangle([x0 - air, y0 - air, x1 + air, y1 + air], size)
    }

    /// The camera that sees what this framing shows.
    pub fn intrinsics(&self, source: &Intrinsics) -> Intrinsics {
        Intrinsics {
            width: self.width,
            height: self.height,
            fx: source.fx * self.scale,
            fy: source.fy * self.scale,
            cx: (source.cx - self.left_px) * self.scale - 0.5,
            cy: (source.cy - self.top_px) * self.scale - 0.5,
        }
    }

    /// The index of the source pixel under an output pixel, if it lies inside the source.
    pub(super) fn source_index(&self, x: u32, y: u32, source: [usize; 2]) -> Option<usize> {
        let column = (self.left_px + (x as f32 + 0.5) / self.scale).round();
        let row = (self.top_px + (y as f32 + 0.5) / self.scale).round();
        let inside = column >= 0.0
            && row >= 0.0
            && (column as usize) < source[0]
            && (row as usize) < source[1];
        inside.then(|| row as usize * source[0] + column as usize)
    }

    /// The framing of `size` that shows all of a rectangle given by the centres of its corner pixels.
    fn of_rectangle([x0, y0, x1, y1]: [f32; 4], size: [u32; 2]) -> Self {
        let [width, height] = size.map(|s| s as f32);
        let scale = (width / (x1 - x0 + 1.0).max(1.0)).min(height / (y1 - y0 + 1.0).max(1.0));
        let left_px = 0.5 * (x0 + x1) - 0.5 * width / scale;
        let top_px = 0.5 * (y0 + y1) - 0.5 * height / scale;
        Self { width: size[0], height: size[1], left_px, top_px, scale }
    }
}

/// Smallest and largest column and row of a mask: `[x0, y0, x1, y1]`.
fn mask_bounds(mask: &[bool], width: usize) -> Option<[f32; 4]> {
    let mut bounds = [usize::MAX, usize::MAX, 0, 0];
    let mut count = 0;
    for (y, row) in mask.chunks(width.max(1)).enumerate() {
        for (x, _) in row.iter().enumerate().filter(|(_, inside)| **inside) {
            bounds = [
                bounds[0].min(x),
                bounds[1].min(y),
                bounds[2].max(x),
                bounds[3].max(y),
            ];
            count += 1;
        }
    }
    (count >= MIN_PERSON_PX).then(|| bounds.map(|b| b as f32))
}

#[cfg(test)]
mod tests {
    use glam::{Vec2, vec2, vec3};

    use super::*;

    const SENSOR: Intrinsics =
        Intrinsics { width: 320, height: 288, fx: 252.0, fy: 252.0, cx: 160.3, cy: 143.1 };

    #[test]
    fn a_whole_framing_is_the_identity() {
        let framing = Framing::whole(320, 288);
        assert_eq!(framing.intrinsics(&SENSOR), SENSOR);
        assert_eq!(framing.source_index(7, 3, [320, 288]), Some(3 * 320 + 7));
    }

    #[test]
    fn the_framed_camera_and_the_framed_pixels_agree() {
        let framing = Framing::of_rectangle([100.0, 50.0, 199.0, 249.0], [300, 600]);
        let point = vec3(-0.1, 0.2, 2.0);
        let in_output: Vec2 = framing.intrinsics(&SENSOR).project(point);
        let [x, y] = in_output.round().to_array().map(|v| v as u32);
        let index = framing.source_index(x, y, [320, 288]).expect("inside");
        let under = vec2((index % 320) as f32, (index / 320) as f32);
        // Half a source pixel, and half an output pixel of rounding at three output pixels a source pixel.
        assert!((under - SENSOR.project(point)).abs().max_element() <= 0.5 + 0.5 / 3.0 + 1e-3);
    }

    #[test]
    fn pixels_outside_the_source_are_nobody() {
        let framing = Framing::fitted([100, 100], [200, 100]);
        assert_eq!(framing.source_index(0, 50, [100, 100]), None);
        assert_eq!(framing.source_index(50, 0, [100, 100]), Some(0));
        assert_eq!(
            framing.source_index(149, 99, [100, 100]),
            Some(100 * 100 - 1)
        );
    }

    #[test]
    fn a_masks_bounds_are_its_outermost_pixels() {
        let mut mask = vec![false; 64 * 64];
        for y in 10..40 {
            mask[y * 64 + 5..y * 64 + 25].fill(true);
        }
        assert_eq!(mask_bounds(&mask, 64), Some([5.0, 10.0, 24.0, 39.0]));
        assert_eq!(mask_bounds(&[true; 9], 3), None);
    }
}
