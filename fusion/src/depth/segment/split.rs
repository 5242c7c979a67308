//! Parts two people who stand shoulder to shoulder: no step in depth divides them, but they have two heads.
//!
//! Seen from the front each person is a column with a head on top. Raised hands are columns too, but narrow
//! ones over one trunk, so the trunk must be wide enough for two.

use glam::Vec3;

use super::{coarse::Coarse, label::Labels};
use crate::clean::FloorPlane;

/// Width of the profile's columns and height of its rows.
const BIN_M: f32 = 0.04;
const ROWS: usize = 64;
/// A head stands out above everything this near.
const HEAD_CLEARANCE_M: f32 = 0.16;
/// Below a head there is body for at least this far.
const TRUNK_M: f32 = 0.7;
/// Share of the trunk's rows that must be seen.
const TRUNK_SHARE: f32 = 0.85;
/// Heads are at least this far apart...
const HEAD_DISTANCE_M: f32 = 0.32;
/// ...with a dip between them at least this deep: heads rise 0.25 m above shoulders.
const DIP_M: f32 = 0.12;
/// Two people's trunks, with their arms, are at least this wide, at this depth below the lower head.
const TWO_WIDE_M: f32 = 0.7;
const CHEST_BELOW_M: [f32; 2] = [0.5, 0.8];
/// Nobody smaller is looked for.
const MIN_HEIGHT_M: f32 = 0.9;

/// Cells of a part counted by place across and by height.
struct Profile {
    left_m: f32,
    bottom_m: f32,
    /// Row-major, a column of heights for each place across.
    occupied: Vec<bool>,
    columns: usize,
}

/// Gives each person in a part a label of their own; returns whether there were several.
pub(super) fn split_people(
    coarse: &Coarse,
    labels: &mut Labels,
    label: u32,
    floor: Option<FloorPlane>,
) -> bool {
    let up = floor.unwrap_or(FloorPlane { normal: Vec3::NEG_Y, offset_m: 0.0 });
    let cells: Vec<usize> = (0..coarse.points.len())
        .filter(|&cell| labels.of_cell(cell) == label)
        .collect();
    let Some(profile) = Profile::new(coarse, &cells, up) else {
        return false;
    };
    let heads = profile.heads();
    if heads.len() < 2 || !profile.is_wide_enough(&heads) {
        return false;
    }
    let axes: Vec<Vec3> = heads
        .iter()
        .map(|&head| profile.axis(head, coarse, &cells, up))
        .collect();
    let numbers: Vec<u32> = (0..axes.len())
        .map(|index| if index == 0 { label } else { labels.add() })
        .collect();
    for cell in cells {
        let across = |axis: &Vec3| {
            let offset = coarse.points[cell] - *axis;
            (offset - up.normal * up.normal.dot(offset)).length_squared()
        };
        let nearest = (0..axes.len())
            .min_by(|&a, &b| across(&axes[a]).total_cmp(&across(&axes[b])))
            .unwrap_or(0);
        labels.set(cell, numbers[nearest]);
    }
    true
}

impl Profile {
    fn new(coarse: &Coarse, cells: &[usize], up: FloorPlane) -> Option<Self> {
        let (mut left_m, mut right_m) = (f32::INFINITY, f32::NEG_INFINITY);
        let (mut bottom_m, mut top_m) = (f32::INFINITY, f32::NEG_INFINITY);
        for &cell in cells {
            let point = coarse.points[cell];
            let height_m = up.height_m(point);
            (left_m, right_m) = (left_m.min(point.x), right_m.max(point.x));
            (bottom_m, top_m) = (bottom_m.min(height_m), top_m.max(height_m));
        }
        let height_m = top_m - bottom_m;
        if !(right_m - left_m > TWO_WIDE_M && height_m > MIN_HEIGHT_M) {
            return None;
        }
        // Whatever is higher than the rows reach is no head.
        let columns = (((right_m - left_m) / BIN_M) as usize + 1).min(128);
        let mut profile = Self { left_m, bottom_m, occupied: vec![false; columns * ROWS], columns };
        for &cell in cells {
            let point = coarse.points[cell];
            let column = ((point.x - left_m) / BIN_M) as usize;
            let row = ((up.height_m(point) - bottom_m) / BIN_M) as usize;
            if column < columns && row < ROWS {
                profile.occupied[column * ROWS + row] = true;
            }
        }
        Some(profile)
    }

    fn is_occupied(&self, column: usize, row: usize) -> bool {
        self.occupied[column * ROWS + row]
    }

    fn top(&self, column: usize) -> usize {
        (0..ROWS)
            .rev()
            .find(|&row| self.is_occupied(column, row))
            .unwrap_or(0)
    }

    /// The columns of heads, from left to right.
    fn heads(&self) -> Vec<usize> {
        let tops: Vec<usize> = (0..self.columns).map(|column| self.top(column)).collect();
        let clearance = (HEAD_CLEARANCE_M / BIN_M) as usize;
        let mut heads: Vec<usize> = Vec::new();
        for column in 0..self.columns {
            let near = column.saturating_sub(clearance)..(column + clearance + 1).min(self.columns);
            let highest = near.clone().all(|other| tops[other] <= tops[column]);
            if !highest || !self.has_trunk(column, tops[column]) {
                continue;
            }
            match heads.last().copied() {
                Some(last) if !is_another_head(&tops, last, column) => {
                    if tops[column] > tops[last] {
                        heads.pop();
                        heads.push(column);
                    }
                }
                _ => heads.push(column),
            }
        }
        heads
    }

    fn has_trunk(&self, column: usize, top: usize) -> bool {
        let rows = (TRUNK_M / BIN_M) as usize;
        if top < rows {
            return false;
        }
        let columns = column.saturating_sub(1)..(column + 2).min(self.columns);
        let seen = (top - rows..top)
            .filter(|&row| columns.clone().any(|column| self.is_occupied(column, row)))
            .count();
        seen as f32 >= TRUNK_SHARE * rows as f32
    }

    fn is_wide_enough(&self, heads: &[usize]) -> bool {
        let lowest = heads.iter().map(|&head| self.top(head)).min().unwrap_or(0);
        let [near, far] = CHEST_BELOW_M.map(|below_m| (below_m / BIN_M) as usize);
        let rows = lowest.saturating_sub(far)..lowest.saturating_sub(near);
        let widest = rows
            .map(|row| {
                (0..self.columns)
                    .filter(|&column| self.is_occupied(column, row))
                    .count()
            })
            .max()
            .unwrap_or(0);
        widest as f32 * BIN_M >= TWO_WIDE_M * 0.5 * heads.len() as f32
    }

    /// The middle of a person's head and chest.
    fn axis(&self, head: usize, coarse: &Coarse, cells: &[usize], up: FloorPlane) -> Vec3 {
        let center_m = self.left_m + (head as f32 + 0.5) * BIN_M;
        let least_m = self.bottom_m + self.top(head) as f32 * BIN_M - TRUNK_M;
        let (mut sum, mut count) = (Vec3::ZERO, 0.0);
        for &cell in cells {
            let point = coarse.points[cell];
            if (point.x - center_m).abs() < HEAD_CLEARANCE_M && up.height_m(point) > least_m {
                sum += point;
                count += 1.0;
            }
        }
        // The head itself is among these cells.
        sum / f32::max(count, 1.0)
    }
}

/// Whether a dip divides two peaks that are far enough apart.
fn is_another_head(tops: &[usize], left: usize, right: usize) -> bool {
    let apart = (right - left) as f32 * BIN_M >= HEAD_DISTANCE_M;
    let dip = tops[left..=right].iter().min().copied().unwrap_or(0);
    let lower = tops[left].min(tops[right]);
    apart && (lower - dip) as f32 * BIN_M >= DIP_M
}
