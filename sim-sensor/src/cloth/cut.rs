//! Cutting: the part of a surface on the positive side of a field, with a clean edge.

use std::collections::BTreeMap;

use glam::Vec3;

use super::{
    form::Form,
    pattern::{Limbs, Pattern, Top},
    sheet::Sheet,
};
use crate::person::chart::Place;

/// Shirts and skirts follow the body down to here; what hangs below has a shape of its own.
const SEAM_ABOVE_CROTCH_M: f32 = 0.085;
/// A shirt that is tucked in ends here, under the belt.
const TUCKED_ABOVE_HIPS_M: f32 = 0.070;
/// The collar's plane leans forwards.
const COLLAR_UP: Vec3 = Vec3::new(0.0, 0.92, 0.39);
/// A collar is this much wider than the neck.
const COLLAR_ROOM: f32 = 1.25;
/// A hood's rim: how far in front of the head's joint, and from where above the base of the neck.
const HOOD_RIM_M: f32 = 0.045;
const HOOD_ABOVE_NECK_M: f32 = 0.050;

/// The height of the seam between what follows the body and what hangs.
pub(super) fn seam_height_m(form: &Form) -> f32 {
    form.crotch_m + SEAM_ABOVE_CROTCH_M
}

/// Where a shirt ends that is tucked in.
pub(super) fn tucked_hem_m(form: &Form) -> f32 {
    form.leg_height_m(0.0) + TUCKED_ABOVE_HIPS_M
}

/// The part of the body that a garment follows, in the cut pose.
pub(super) fn covered(form: &Form, pattern: &Pattern) -> Sheet {
    let mut fields = Vec::new();
    match pattern.top {
        Top::Collar { above_neck_m, front_drop_m }
        | Top::FoldedCollar { above_neck_m, front_drop_m } => {
            fields.push(below_collar(form, above_neck_m, front_drop_m));
        }
        Top::Hood => fields.push(behind_face(form)),
        Top::Waist { above_hips_m } => {
            let waist_m = form.leg_height_m(0.0) + above_hips_m;
            fields.push(of_points(form, |p, place| {
                waist_m - p.y - 10.0 * smooth_arm(place)
            }));
        }
    }
    match pattern.limbs {
        Limbs::Arms { end } => fields.push(limb(form, end, |place| place.arm, [16, 18, 20])),
        Limbs::Legs { end } => fields.push(limb(form, end, |place| place.leg, [1, 4, 7])),
        Limbs::None => {}
    }
    if pattern.hem.is_some() || pattern.is_tucked_in() {
        let seam_m = if pattern.is_tucked_in() {
            tucked_hem_m(form)
        } else {
            seam_height_m(form)
        };
        // Hands hang as low as the seam in this pose; the zero pose tells them from the hips.
        fields.push(of_points(form, |p, place| {
            (p.y - seam_m).max(4.0 * smooth_arm(place) - 0.5)
        }));
    }
    let mut sheet = form.surface.clone();
    for number in 0..fields.len() {
        sheet = clipped(&sheet, number, &mut fields);
    }
    sheet.largest_part()
}

/// The part of a surface where a field of its points is not negative.
pub(super) fn clipped_by(sheet: &Sheet, field: impl Fn(Vec3) -> f32) -> Sheet {
    let mut fields = [sheet.points.iter().map(|&p| field(p)).collect()];
    clipped(sheet, 0, &mut fields).largest_part()
}

fn smooth_arm(place: &Place) -> f32 {
    (place.arm_share - 0.4).max(0.0)
}

fn of_points(form: &Form, field: impl Fn(Vec3, &Place) -> f32) -> Vec<f32> {
    let points = form.surface.points.iter().zip(&form.chart.places);
    points.map(|(&p, place)| field(p, place)).collect()
}

/// Metres to the end of a limb, along it.
fn limb(form: &Form, end: f32, station: impl Fn(&Place) -> f32, joints: [usize; 3]) -> Vec<f32> {
    let at = &form.chart.joints;
    let segment = usize::from(end >= 1.0);
    let length_m = at[joints[segment]].distance(at[joints[segment + 1]]);
    let places = form.chart.places.iter();
    places
        .map(|place| (end - station(place)) * length_m)
        .collect()
}

/// Below a plane through the base of the neck, lower in front; shoulders are covered however high they are.
fn below_collar(form: &Form, above_neck_m: f32, front_drop_m: f32) -> Vec<f32> {
    let chart = &form.chart;
    let neck = chart.joints[12];
    let axis = (chart.joints[15] - neck).normalize_or(Vec3::Y);
    let around_m = COLLAR_ROOM * neck_radius_m(form, neck, axis);
    let field = |p: &Vec3| {
        let from_neck = *p - neck;
        let front = (from_neck.z / 0.06).clamp(0.0, 1.0);
        let below_m = above_neck_m - front_drop_m * front - from_neck.dot(COLLAR_UP);
        let beside_m = from_neck.reject_from(axis).length() - around_m;
        below_m.max(beside_m - 0.5 * from_neck.dot(axis).max(0.0))
    };
    chart.vertices.iter().map(field).collect()
}

/// How thick the neck is above its base.
fn neck_radius_m(form: &Form, neck: Vec3, axis: Vec3) -> f32 {
    let chart = &form.chart;
    let (mut sum_m, mut count) = (0.0, 0.0);
    for (point, place) in chart.vertices.iter().zip(&chart.places) {
        let from_neck = *point - neck;
        if place.head_share > 0.5 && (0.02..0.06).contains(&from_neck.dot(axis)) {
            sum_m += from_neck.reject_from(axis).length();
            count += 1.0;
        }
    }
    if count > 0.0 { sum_m / count } else { 0.06 }
}

fn behind_face(form: &Form) -> Vec<f32> {
    let chart = &form.chart;
    let field = |p: &Vec3| {
        let rim = HOOD_RIM_M - (p.z - chart.joints[15].z);
        rim.max(chart.joints[12].y + HOOD_ABOVE_NECK_M - p.y)
    };
    chart.vertices.iter().map(field).collect()
}

/// Cuts along the zero line of one field; the values of all fields follow to new points.
fn clipped(sheet: &Sheet, number: usize, fields: &mut [Vec<f32>]) -> Sheet {
    let mut points = sheet.points.clone();
    let mut crossings: BTreeMap<[u32; 2], u32> = BTreeMap::new();
    let mut triangles = Vec::new();
    for &corners in &sheet.triangles {
        let inside = corners.map(|v| fields[number][v as usize] >= 0.0);
        let mut polygon = Vec::with_capacity(4);
        for k in 0..3 {
            let (from, to) = (corners[k], corners[(k + 1) % 3]);
            if inside[k] {
                polygon.push(from);
            }
            if inside[k] != inside[(k + 1) % 3] {
                let ends = [from.min(to), from.max(to)];
                let next = points.len() as u32;
                let crossing = *crossings.entry(ends).or_insert(next);
                if crossing == next {
                    let [a, b] = ends.map(|v| v as usize);
                    let share = fields[number][a] / (fields[number][a] - fields[number][b]);
                    points.push(points[a].lerp(points[b], share));
                    for field in fields.iter_mut() {
                        field.push(field[a] + (field[b] - field[a]) * share);
                    }
                    fields[number][next as usize] = 0.0;
                }
                polygon.push(crossing);
            }
        }
        for k in 2..polygon.len() {
            triangles.push([polygon[0], polygon[k - 1], polygon[k]]);
        }
    }
    Sheet { points, triangles }
}
