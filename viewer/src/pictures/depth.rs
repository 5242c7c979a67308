//! Depth as colour, with the relief of its normals and the person in front of a dimmed room.

use effigy_capture::DepthImage;
use effigy_fusion::{CleanFrame, DepthMap, NormalMap};
use glam::{Vec3, vec3};
use image::Rgb;

use super::{Framing, Picture, colormap::near_to_far, palette};

/// Where the light of the relief comes from, in camera space: over the left shoulder of the camera.
const LIGHT_IN_CAMERA: Vec3 = vec3(-0.45, -0.62, -0.64);
/// What the darkest slope keeps of its colour.
const RELIEF_FLOOR: f32 = 0.45;
/// How far what is not the person sinks into the background.
const ROOM_DIMMING: f32 = 0.72;
/// Parts of the person's depths at either end that do not stretch the colours.
const TAIL: f32 = 0.01;
/// The person's colours span at least this much, so that noise does not become a rainbow.
const MIN_SPAN_M: f32 = 0.5;

/// The depths that the colours span.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DepthRange {
    pub near_m: f32,
    pub far_m: f32,
}

impl DepthRange {
    /// From nearest to farthest of the person with a little room; of everything measured if there is nobody.
    pub fn of(clean: &CleanFrame) -> Self {
        let person = clean.depth.metres.iter().zip(&clean.person);
        let of_person = person.filter(|(_, inside)| **inside).map(|(d, _)| *d);
        Self::spanned_by(of_person)
            .or_else(|| Self::of_map(&clean.depth))
            .unwrap_or(Self { near_m: 0.5, far_m: 4.0 })
    }

    fn of_map(depth: &DepthMap) -> Option<Self> {
        Self::spanned_by(depth.metres.iter().copied())
    }

    fn spanned_by(depths: impl Iterator<Item = f32>) -> Option<Self> {
        let mut depths: Vec<f32> = depths.filter(|d| d.is_finite() && *d > 0.0).collect();
        if depths.is_empty() {
            return None;
        }
        let tail = (depths.len() as f32 * TAIL) as usize;
        let last = depths.len() - 1 - tail;
        let near = *depths.select_nth_unstable_by(tail, f32::total_cmp).1;
        let far = *depths.select_nth_unstable_by(last, f32::total_cmp).1;
        let room = 0.5 * (MIN_SPAN_M - (far - near)).max(0.1 * (far - near));
        Some(Self { near_m: near - room, far_m: far + room })
    }
}

/// Metric depth as colour; pixels without a measurement show the panel behind.
pub fn depth_picture(depth: &DepthMap, range: DepthRange, framing: &Framing) -> Picture {
    draw(framing, [depth.width, depth.height], |index| {
        let metres = depth.metres[index];
        metres
            .is_finite()
            .then(|| near_to_far(metres, range.near_m, range.far_m))
    })
}

/// A sensor's own depth as colour; 0 shows the panel behind.
pub fn raw_depth_picture(
    depth: &DepthImage,
    metres_per_unit: f32,
    range: DepthRange,
    framing: &Framing,
) -> Picture {
    let pixels = depth.pixels();
    draw(
        framing,
        [depth.width() as usize, depth.height() as usize],
        |index| {
            let units = pixels[index];
            let metres = f32::from(units) * metres_per_unit;
            (units != 0).then(|| near_to_far(metres, range.near_m, range.far_m))
        },
    )
}

/// A clean frame: the person in full colour with relief, the room behind in the dark.
pub fn clean_picture(clean: &CleanFrame, range: DepthRange, framing: &Framing) -> Picture {
    draw(framing, [clean.depth.width, clean.depth.height], |index| {
        let metres = clean.depth.metres[index];
        if !metres.is_finite() {
            return None;
        }
        let color = near_to_far(metres, range.near_m, range.far_m);
        let lit = palette::mix([0; 3], color, relief(&clean.normals, index));
        let person = clean.person[index];
        Some(if person {
            lit
        } else {
            palette::mix(grey(lit), palette::PANEL, ROOM_DIMMING)
        })
    })
}

/// As [`clean_picture`] without colour: a ground to draw on.
pub(super) fn relief_picture(clean: &CleanFrame, framing: &Framing) -> Picture {
    draw(framing, [clean.depth.width, clean.depth.height], |index| {
        if !clean.depth.metres[index].is_finite() {
            return None;
        }
        let share = relief(&clean.normals, index) * if clean.person[index] { 0.8 } else { 0.12 };
        Some(palette::mix(palette::PANEL, palette::TEXT, share))
    })
}

/// Traces the edge of the person mask.
pub fn outline_person(
    picture: &mut Picture,
    clean: &CleanFrame,
    framing: &Framing,
    color: [u8; 3],
) {
    let source = [clean.depth.width, clean.depth.height];
    let inside = |x: i64, y: i64| {
        let index = u32::try_from(x).ok().zip(u32::try_from(y).ok());
        index
            .and_then(|(x, y)| framing.source_index(x, y, source))
            .is_some_and(|index| clean.person[index])
    };
    outline(picture, inside, color);
}

/// Colours each pixel that is inside and has a 4-neighbour that is not.
pub(super) fn outline(picture: &mut Picture, inside: impl Fn(i64, i64) -> bool, color: [u8; 3]) {
    for (x, y, pixel) in picture.enumerate_pixels_mut() {
        let (x, y) = (i64::from(x), i64::from(y));
        let steps = [(1, 0), (-1, 0), (0, 1), (0, -1)];
        if inside(x, y) && steps.iter().any(|(dx, dy)| !inside(x + dx, y + dy)) {
            pixel.0 = color;
        }
    }
}

/// Draws each output pixel from the source pixel under it.
fn draw(
    framing: &Framing,
    source: [usize; 2],
    color: impl Fn(usize) -> Option<[u8; 3]>,
) -> Picture {
    Picture::from_fn(framing.width, framing.height, |x, y| {
        let under = framing.source_index(x, y, source);
        Rgb(under.and_then(&color).unwrap_or(palette::PANEL))
    })
}

fn relief(normals: &NormalMap, index: usize) -> f32 {
    let facing = normals.normals[index].dot(LIGHT_IN_CAMERA);
    if facing.is_finite() {
        RELIEF_FLOOR + (1.0 - RELIEF_FLOOR) * facing.max(0.0)
    } else {
        1.0
    }
}

fn grey(color: [u8; 3]) -> [u8; 3] {
    let [r, g, b] = color.map(u32::from);
    [((r * 54 + g * 183 + b * 19) / 256) as u8; 3]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pictures::colormap::color_of_share;

    const RANGE: DepthRange = DepthRange { near_m: 1.0, far_m: 3.0 };

    fn step() -> DepthMap {
        let metres = vec![1.0, 3.0, f32::NAN, 2.0];
        DepthMap { width: 2, height: 2, metres }
    }

    #[test]
    fn near_is_bright_far_is_dark_and_nothing_is_the_panel() {
        let picture = depth_picture(&step(), RANGE, &Framing::whole(2, 2));
        assert_eq!(picture.get_pixel(0, 0).0, color_of_share(0.0));
        assert_eq!(picture.get_pixel(1, 0).0, color_of_share(1.0));
        assert_eq!(picture.get_pixel(0, 1).0, palette::PANEL);
    }

    #[test]
    fn raw_depth_in_millimetres_looks_like_depth_in_metres() {
        let raw = DepthImage::new(2, 2, vec![1000, 3000, 0, 2000]).expect("four pixels");
        let whole = Framing::whole(2, 2);
        assert_eq!(
            raw_depth_picture(&raw, 0.001, RANGE, &whole),
            depth_picture(&step(), RANGE, &whole)
        );
    }

    #[test]
    fn outliers_do_not_stretch_the_colours() {
        let depths = (0..1000).map(|i| if i < 5 { 60.0 } else { 2.0 + 0.0005 * i as f32 });
        let range = DepthRange::spanned_by(depths).expect("depths");
        assert!(range.near_m > 1.8 && range.far_m < 2.7, "{range:?}");
        assert!(DepthRange::spanned_by([f32::NAN, 0.0].into_iter()).is_none());
    }
}
