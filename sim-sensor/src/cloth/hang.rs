//! What hangs below a garment's lowest border: shirt tails, coat tails and skirts, around both legs.

use glam::{Vec3, vec2};

use super::{form::Form, pattern::Pattern, sheet::Sheet};
use crate::person::smoothstep;

/// How far above the hem ribs draw cloth together.
const RIB_M: f32 = 0.06;

/// Hangs rows of cloth from the lowest border: around both legs, never narrower than above.
pub(super) fn with_hanging_part(
    sheet: &Sheet,
    form: &Form,
    pattern: &Pattern,
    hem_m: f32,
) -> Sheet {
    let mut sheet = sheet.clone();
    let loops = sheet.border_loops();
    let mean_y = |around: &Vec<u32>| {
        around
            .iter()
            .map(|&v| sheet.points[v as usize].y)
            .sum::<f32>()
            / around.len() as f32
    };
    let Some(border) = loops.iter().min_by(|a, b| mean_y(a).total_cmp(&mean_y(b))) else {
        return sheet;
    };
    let top: Vec<Vec3> = border.iter().map(|&v| sheet.points[v as usize]).collect();
    let top_m = mean_y(border);
    let middle: Vec3 = top.iter().sum::<Vec3>() / top.len() as f32;
    let center = vec2(middle.x, middle.z);
    let spacing_m = perimeter_m(&top) / border.len() as f32;
    let rows = ((top_m - hem_m) / spacing_m).round().max(1.0) as usize;
    let directions: Vec<_> = top
        .iter()
        .map(|p| (vec2(p.x, p.z) - center).normalize_or_zero())
        .collect();
    let mut radii: Vec<f32> = top
        .iter()
        .map(|p| vec2(p.x, p.z).distance(center))
        .collect();
    let mut last = border.clone();
    for row in 1..=rows {
        let share = row as f32 / rows as f32;
        let height_m = top_m + (hem_m - top_m) * share;
        let step_m = (top_m - hem_m) / rows as f32;
        let outline = form.outline(height_m);
        let ribs = if pattern.ease.ribbed {
            smoothstep(RIB_M, 0.02, height_m - hem_m)
        } else {
            0.0
        };
        for (radius, &direction) in radii.iter_mut().zip(&directions) {
            let body_m = outline.radius_m(center, direction) + pattern.ease.hem_m;
            let hanging_m = radius.max(body_m) + pattern.ease.flare * step_m;
            *radius = hanging_m + (body_m - hanging_m).min(0.0) * ribs;
        }
        smooth_ring(&mut radii);
        let first = sheet.points.len() as u32;
        for (i, (&direction, &radius)) in directions.iter().zip(&radii).enumerate() {
            let at = center + direction * radius;
            let y = top[i].y + (hem_m - top[i].y) * share;
            sheet.points.push(Vec3::new(at.x, y, at.y));
        }
        let next: Vec<u32> = (first..sheet.points.len() as u32).collect();
        sew_rows(&mut sheet, &last, &next, true);
        last = next;
    }
    sheet
}

fn perimeter_m(points: &[Vec3]) -> f32 {
    (0..points.len())
        .map(|i| points[i].distance(points[(i + 1) % points.len()]))
        .sum()
}

fn smooth_ring(radii: &mut [f32]) {
    let count = radii.len();
    let before = radii.to_vec();
    for (i, radius) in radii.iter_mut().enumerate() {
        let beside = before[(i + count - 1) % count] + before[(i + 1) % count];
        *radius = radius.max(0.5 * before[i] + 0.25 * beside);
    }
}

/// Joins a border, in the order of its triangles, with a new row of as many points.
pub(super) fn sew_rows(sheet: &mut Sheet, border: &[u32], row: &[u32], closed: bool) {
    let count = border.len();
    for i in 0..if closed { count } else { count - 1 } {
        let next = (i + 1) % count;
        let [a, b, below_a, below_b] = [border[i], border[next], row[i], row[next]];
        sheet.triangles.push([b, a, below_a]);
        sheet.triangles.push([b, below_a, below_b]);
    }
}
