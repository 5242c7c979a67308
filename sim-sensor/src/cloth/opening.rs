//! Openings of a finished garment: a jacket's front, and the collar around a polo's neck.

use glam::Vec3;

use super::{hang::sew_rows, sheet::Sheet};
use crate::person::smoothstep;

/// Half the gap between the free front edges: at the buttons and at the collar.
const FRONT_GAP_M: [f32; 2] = [0.012, 0.075];

/// Positive beside the front opening of a jacket; `neck_m` is the neck's height over the pelvis.
pub(super) fn front_gap(from_pelvis: Vec3, neck_m: f32) -> f32 {
    let up = from_pelvis.y / neck_m;
    let lapel = smoothstep(0.35, 1.0, up);
    let round = smoothstep(-0.25, -0.75, up);
    let half_gap_m = FRONT_GAP_M[0] + (FRONT_GAP_M[1] - FRONT_GAP_M[0]) * lapel + 0.05 * round;
    (from_pelvis.x.abs() - half_gap_m).max(0.02 - from_pelvis.z)
}

/// A collar that stands around the neck and falls over, open in front.
pub(super) fn add_folded_collar(sheet: &mut Sheet, neck: Vec3) {
    const PROFILE_M: [(f32, f32); 4] = [
        (0.020, 0.000),
        (0.024, 0.009),
        (0.010, 0.018),
        (-0.006, 0.026),
    ];
    const OPEN_RAD: f32 = 0.22;
    let highest = sheet.border_loops().into_iter().max_by(|a, b| {
        let y = |around: &Vec<u32>| {
            around
                .iter()
                .map(|&v| sheet.points[v as usize].y)
                .sum::<f32>()
                / around.len() as f32
        };
        y(a).total_cmp(&y(b))
    });
    let Some(around) = highest else { return };
    let middle: Vec3 = around
        .iter()
        .map(|&v| sheet.points[v as usize])
        .sum::<Vec3>()
        / around.len() as f32;
    let aside = |v: u32| {
        let from = sheet.points[v as usize] - middle;
        from.x.atan2(from.z)
    };
    let Some(start) = (0..around.len()).find(|&i| {
        let before = around[(i + around.len() - 1) % around.len()];
        aside(before).abs() < OPEN_RAD && aside(around[i]).abs() >= OPEN_RAD
    }) else {
        return;
    };
    let mut last: Vec<u32> = (0..around.len())
        .map(|i| around[(start + i) % around.len()])
        .take_while(|&v| aside(v).abs() >= OPEN_RAD)
        .collect();
    let foot: Vec<Vec3> = last.iter().map(|&v| sheet.points[v as usize]).collect();
    for (up_m, out_m) in PROFILE_M {
        let first = sheet.points.len() as u32;
        for point in &foot {
            let out = Vec3::new(point.x - middle.x, 0.0, point.z - neck.z).normalize_or_zero();
            sheet.points.push(*point + Vec3::Y * up_m + out * out_m);
        }
        let row: Vec<u32> = (first..sheet.points.len() as u32).collect();
        sew_rows(sheet, &last, &row, false);
        last = row;
    }
}
