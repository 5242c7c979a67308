//! Distances on a surface as colours, with their legend.

use super::{
    Clay, MeshView, Picture, PictureCamera, color_of_share, draw_text, palette, render_mesh,
};

/// The part of the colour map in use, from no distance to the largest: blue, purple, red, yellow. The
/// darkest blues are left out: they would sink into the background.
const AT_ZERO: f32 = 0.86;
const AT_LARGEST: f32 = 0.0;
const LEGEND_PX: [u32; 2] = [7, 64];
const LEGEND_AT_PX: [u32; 2] = [12, 12];
const LEGEND_CAP_PX: f32 = 9.0;

/// What the brightest colour stands for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HeatScale {
    pub largest_m: f32,
}

impl HeatScale {
    pub fn color(self, distance_m: f32) -> [u8; 3] {
        if !distance_m.is_finite() {
            return palette::TEXT_DIM;
        }
        let share = (distance_m.abs() / self.largest_m.max(f32::EPSILON)).min(1.0);
        color_of_share(AT_ZERO + (AT_LARGEST - AT_ZERO) * share)
    }
}

/// A mesh coloured by one distance a vertex, with a legend in the upper left corner. A vertex whose
/// distance is not finite is grey.
pub fn heat_picture(
    mesh: MeshView<'_>,
    distances_m: &[f32],
    scale: HeatScale,
    camera: &PictureCamera,
) -> Picture {
    let colors: Vec<_> = distances_m.iter().map(|d| scale.color(*d)).collect();
    let mut picture = render_mesh(
        MeshView { colors: &colors, ..mesh },
        camera,
        Clay::default(),
    );
    draw_legend(&mut picture, scale);
    picture
}

/// A standing bar of the scale's colours between "0" and its largest distance in millimetres.
pub fn draw_legend(picture: &mut Picture, scale: HeatScale) {
    let [left, top] = LEGEND_AT_PX;
    let [width, height] = LEGEND_PX;
    for y in top..(top + height).min(picture.height()) {
        for x in left..(left + width).min(picture.width()) {
            let share = 1.0 - (y - top) as f32 / (height - 1) as f32;
            picture.get_pixel_mut(x, y).0 = scale.color(share * scale.largest_m);
        }
    }
    let label = format!("{:.0} mm", scale.largest_m * 1000.0);
    let beside = (left + width + 6) as f32;
    let bottom = (top + height) as f32 - LEGEND_CAP_PX;
    draw_text(
        picture,
        [beside, top as f32],
        LEGEND_CAP_PX,
        palette::TEXT_DIM,
        &label,
    );
    draw_text(
        picture,
        [beside, bottom],
        LEGEND_CAP_PX,
        palette::TEXT_DIM,
        "0",
    );
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn larger_distances_are_brighter_and_the_scale_ends() {
        let scale = HeatScale { largest_m: 0.02 };
        let brightness = |d| scale.color(d).iter().map(|c| u32::from(*c)).sum::<u32>();
        assert!(brightness(0.0) < brightness(0.01) && brightness(0.01) < brightness(0.02));
        assert_eq!(scale.color(0.02), scale.color(5.0));
        assert_eq!(scale.color(-0.01), scale.color(0.01));
        assert_eq!(scale.color(f32::NAN), palette::TEXT_DIM);
    }

    #[test]
    fn the_legend_shows_both_ends_of_the_scale() {
        let scale = HeatScale { largest_m: 0.02 };
        let mut picture = Picture::new(300, 100);
        draw_legend(&mut picture, scale);
        let has = |color| picture.pixels().any(|p| p.0 == color);
        assert!(has(scale.color(0.0)) && has(scale.color(0.02)));
    }
}
