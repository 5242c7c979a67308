//! Text from the dot-matrix alphabet, drawn with smooth strokes at any size.

use glam::{Vec2, vec2};

use super::{
    Picture,
    font::{GLYPH_COLUMNS, GLYPH_ROWS, glyph},
    palette::mix,
};

/// Dots of a capital letter's height.
const CAP_ROWS: f32 = 7.0;
/// Dots between letters.
const SPACING_DOTS: f32 = 1.4;
const SPACE_DOTS: f32 = 3.0;
/// Half the thickness of a stroke, in dots.
const STROKE_DOTS: f32 = 0.52;

/// How wide a text will be.
pub fn text_width_px(text: &str, cap_height_px: f32) -> f32 {
    let dot = cap_height_px / CAP_ROWS;
    let dots: f32 = text.chars().map(|c| advance_dots(&Glyph::of(c))).sum();
    (dots - SPACING_DOTS).max(0.0) * dot
}

/// Draws text with its upper left corner at `at`; `cap_height_px` is the height of a capital letter.
pub fn draw_text(
    picture: &mut Picture,
    at: [f32; 2],
    cap_height_px: f32,
    color: [u8; 3],
    text: &str,
) {
    let dot = cap_height_px / CAP_ROWS;
    let mut pen = Vec2::from(at);
    for character in text.chars() {
        let glyph = Glyph::of(character);
        draw_glyph(picture, pen, dot, color, &glyph);
        pen.x += advance_dots(&glyph) * dot;
    }
}

/// A glyph as strokes between neighbouring dots, shifted to start at column 0; in dots.
struct Glyph {
    strokes: Vec<[Vec2; 2]>,
    width_dots: f32,
}

impl Glyph {
    fn of(character: char) -> Self {
        let rows = *glyph(character);
        let used = rows.iter().fold(0, |all, row| all | row);
        if used == 0 {
            return Self { strokes: Vec::new(), width_dots: SPACE_DOTS };
        }
        let first = used.leading_zeros() as usize - (8 - GLYPH_COLUMNS);
        let last = GLYPH_COLUMNS - 1 - used.trailing_zeros() as usize;
        // Digits keep one width, so that columns of numbers stand still.
        let (first, last) = if character.is_ascii_digit() {
            (0, 4)
        } else {
            (first, last)
        };
        let lit = |x: isize, y: isize| is_lit(rows, x, y);
        let mut strokes = Vec::new();
        for y in 0..GLYPH_ROWS as isize {
            for x in (0..GLYPH_COLUMNS as isize).filter(|&x| lit(x, y)) {
                let from = vec2((x - first as isize) as f32 + 0.5, y as f32 + 0.5);
                let before = strokes.len();
                for (dx, dy) in [(1, 0), (0, 1), (1, 1), (-1, 1)] {
                    // A diagonal joins two dots only where no corner between them does.
                    let corner = dx != 0 && dy != 0 && (lit(x + dx, y) || lit(x, y + dy));
                    if lit(x + dx, y + dy) && !corner {
                        strokes.push([from, from + vec2(dx as f32, dy as f32)]);
                    }
                }
                if strokes.len() == before {
                    strokes.push([from, from]);
                }
            }
        }
        Self { strokes, width_dots: (last - first + 1) as f32 }
    }
}

fn is_lit(rows: [u8; GLYPH_ROWS], x: isize, y: isize) -> bool {
    let columns = GLYPH_COLUMNS as isize;
    (0..columns).contains(&x)
        && (0..GLYPH_ROWS as isize).contains(&y)
        && rows[y as usize] >> (columns - 1 - x) & 1 == 1
}

fn advance_dots(glyph: &Glyph) -> f32 {
    glyph.width_dots + SPACING_DOTS
}

fn draw_glyph(picture: &mut Picture, pen: Vec2, dot: f32, color: [u8; 3], glyph: &Glyph) {
    let end = pen + vec2(glyph.width_dots, GLYPH_ROWS as f32) * dot + 1.0;
    let (width, height) = picture.dimensions();
    for y in (pen.y - 1.0).max(0.0) as u32..(end.y.max(0.0) as u32).min(height) {
        for x in (pen.x - 1.0).max(0.0) as u32..(end.x.max(0.0) as u32).min(width) {
            let at = (vec2(x as f32, y as f32) + 0.5 - pen) / dot;
            let distance = glyph
                .strokes
                .iter()
                .map(|s| distance_to_stroke(at, *s))
                .fold(9.0, f32::min);
            // Half a pixel on either side of the edge is soft.
            let cover = ((STROKE_DOTS - distance) * dot + 0.5).clamp(0.0, 1.0);
            if cover > 0.0 {
                let pixel = picture.get_pixel_mut(x, y);
                pixel.0 = mix(pixel.0, color, cover);
            }
        }
    }
}

fn distance_to_stroke(at: Vec2, [from, to]: [Vec2; 2]) -> f32 {
    let along = to - from;
    let share = (at - from).dot(along) / along.length_squared().max(1e-6);
    at.distance(from + along * share.clamp(0.0, 1.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ink(text: &str) -> (u32, u32) {
        let mut picture = Picture::new(200, 40);
        draw_text(&mut picture, [10.0, 10.0], 14.0, [255; 3], text);
        let columns: Vec<u32> = picture
            .enumerate_pixels()
            .filter(|(_, _, p)| p.0[0] > 127)
            .map(|(x, ..)| x)
            .collect();
        (
            *columns.iter().min().expect("ink"),
            *columns.iter().max().expect("ink"),
        )
    }

    #[test]
    fn text_is_as_wide_as_announced() {
        for text in ["Avatar", "p95 12.5 ms", "Hi"] {
            let (first, last) = ink(text);
            let width = (last + 1 - first) as f32;
            // A pixel of softness on either side, and glyphs' own margins.
            assert!(
                (width - text_width_px(text, 14.0)).abs() <= 2.5,
                "{text}: {width}"
            );
        }
    }

    #[test]
    fn every_printable_character_leaves_ink_of_its_own() {
        let all: Vec<_> = ('!'..='~').map(|c| *glyph(c)).collect();
        for (i, one) in all.iter().enumerate() {
            assert!(one.iter().any(|row| *row != 0));
            // O and 0 share a shape; their widths differ in context.
            let twins = all.iter().filter(|other| *other == one).count();
            assert!(
                twins == 1 || one == glyph('O'),
                "{:?}",
                (b'!' + i as u8) as char
            );
        }
    }

    #[test]
    fn text_that_leaves_the_picture_is_cut_off() {
        let mut picture = Picture::new(20, 10);
        draw_text(
            &mut picture,
            [-30.0, -4.0],
            14.0,
            [255; 3],
            "far too long for this",
        );
        draw_text(&mut picture, [15.0, 8.0], 14.0, [255; 3], "\u{00b5}");
        assert_eq!(picture.dimensions(), (20, 10));
    }
}
