//! Even triangles: edges are split, collapsed and flipped until they are about one length
//! (after Botsch and Kobbelt, *A remeshing approach to multiresolution modeling*, SGP 2004).

use glam::Vec3;

use super::sheet::{NONE, Sheet};

/// Edges longer than this share of the aim are split, shorter than that one collapsed.
const LONG: f32 = 4.0 / 3.0;
const SHORT: f32 = 4.0 / 5.0;
/// Independent changes are made together; what had to wait gets this many turns.
const TURNS: usize = 6;

/// The same surface with edges of about `edge_m`; `onto` puts a point back on the surface.
pub(super) fn remeshed(
    sheet: &Sheet,
    edge_m: f32,
    rounds: usize,
    onto: impl Fn(Vec3) -> Vec3,
) -> Sheet {
    let mut sheet = sheet.clone();
    for _ in 0..rounds {
        for _ in 0..TURNS {
            if !split(&mut sheet, edge_m) {
                break;
            }
        }
        for _ in 0..TURNS {
            if !collapse(&mut sheet, edge_m) {
                break;
            }
        }
        for _ in 0..2 {
            flip(&mut sheet);
        }
        relax(&mut sheet, &onto);
    }
    sheet
}

fn length_m(sheet: &Sheet, ends: [u32; 2]) -> f32 {
    sheet.points[ends[0] as usize].distance(sheet.points[ends[1] as usize])
}

/// Halves long edges whose triangles nobody else has changed.
fn split(sheet: &mut Sheet, edge_m: f32) -> bool {
    let mut long: Vec<_> = (sheet.edges().into_iter())
        .map(|edge| (length_m(sheet, edge.ends), edge))
        .filter(|(length, _)| *length > LONG * edge_m)
        .collect();
    long.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.ends.cmp(&b.1.ends)));
    let mut changed = vec![false; sheet.triangles.len()];
    for (_, edge) in &long {
        let sides = edge.triangles.iter().filter(|&&t| t != NONE);
        if sides.clone().any(|&t| changed[t as usize]) {
            continue;
        }
        let [a, b] = edge.ends;
        let middle = sheet.points.len() as u32;
        let point = 0.5 * (sheet.points[a as usize] + sheet.points[b as usize]);
        sheet.points.push(point);
        for &side in sides {
            changed[side as usize] = true;
            let whole = sheet.triangles[side as usize];
            let with = |old: u32| whole.map(|v| if v == old { middle } else { v });
            sheet.triangles.push(with(b));
            sheet.triangles[side as usize] = with(a);
        }
    }
    !long.is_empty()
}

/// Draws short edges together to a point where that keeps the surface in one piece.
fn collapse(sheet: &mut Sheet, edge_m: f32) -> bool {
    let neighbours = sheet.neighbours();
    let around = sheet.triangles_of_points();
    let border = sheet.border_links();
    let on_border = |v: u32| border[v as usize][1] != NONE;
    let mut short: Vec<_> = (sheet.edges().into_iter())
        .map(|edge| (length_m(sheet, edge.ends), edge))
        .filter(|(length, _)| *length < SHORT * edge_m)
        .collect();
    short.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.ends.cmp(&b.1.ends)));
    let mut locked = vec![false; sheet.points.len()];
    let mut into: Vec<u32> = (0..sheet.points.len() as u32).collect();
    let mut any = false;
    for (_, edge) in short {
        let [mut a, mut b] = edge.ends;
        if locked[a as usize] || locked[b as usize] {
            continue;
        }
        if on_border(b) && !on_border(a) {
            (a, b) = (b, a);
        }
        let both = on_border(a) && on_border(b);
        if both && !edge.is_border() {
            continue;
        }
        let shared = neighbours.get(a).iter();
        let shared = shared.filter(|v| neighbours.get(b).contains(v)).count();
        if shared != edge.opposite.iter().filter(|&&v| v != NONE).count() {
            continue;
        }
        let target = if on_border(a) && !both {
            sheet.points[a as usize]
        } else {
            0.5 * (sheet.points[a as usize] + sheet.points[b as usize])
        };
        let near = |v: &u32| sheet.points[*v as usize].distance(target) < LONG * edge_m;
        let ring = || neighbours.get(a).iter().chain(neighbours.get(b));
        let facing = |v: u32| {
            let mut triangles = around.get(v).iter();
            triangles.all(|&t| keeps_facing(sheet, t, [a, b], target))
        };
        if !ring().all(near) || !facing(a) || !facing(b) {
            continue;
        }
        for &v in ring() {
            locked[v as usize] = true;
        }
        sheet.points[a as usize] = target;
        into[b as usize] = a;
        any = true;
    }
    for corners in &mut sheet.triangles {
        *corners = corners.map(|v| into[v as usize]);
    }
    sheet
        .triangles
        .retain(|[a, b, c]| a != b && b != c && c != a);
    drop_unused_points(sheet);
    any
}

/// Whether a triangle looks the same way once both ends of an edge are at the target.
fn keeps_facing(sheet: &Sheet, triangle: u32, ends: [u32; 2], target: Vec3) -> bool {
    let corners = sheet.triangles[triangle as usize];
    if corners.iter().filter(|v| ends.contains(v)).count() != 1 {
        return true;
    }
    let normal = |points: [Vec3; 3]| {
        (points[1] - points[0])
            .cross(points[2] - points[0])
            .normalize_or_zero()
    };
    let before = corners.map(|v| sheet.points[v as usize]);
    let after = corners.map(|v| {
        if ends.contains(&v) {
            target
        } else {
            sheet.points[v as usize]
        }
    });
    normal(before).dot(normal(after)) > 0.3 || normal(before) == Vec3::ZERO
}

fn drop_unused_points(sheet: &mut Sheet) {
    let mut number = vec![NONE; sheet.points.len()];
    let mut kept = Vec::new();
    for corners in &mut sheet.triangles {
        *corners = corners.map(|v| {
            if number[v as usize] == NONE {
                number[v as usize] = kept.len() as u32;
                kept.push(sheet.points[v as usize]);
            }
            number[v as usize]
        });
    }
    sheet.points = kept;
}

/// Turns edges where that brings points closer to six neighbours (four on the border).
fn flip(sheet: &mut Sheet) {
    let neighbours = sheet.neighbours();
    let border = sheet.border_links();
    let excess = |v: u32| {
        let wanted = if border[v as usize][1] == NONE { 6 } else { 4 };
        neighbours.get(v).len() as i32 - wanted
    };
    let mut locked = vec![false; sheet.points.len()];
    for edge in sheet.edges() {
        let ([a, b], [c, d]) = (edge.ends, edge.opposite);
        let four = [a, b, c, d];
        if edge.is_border() || c == d || four.iter().any(|&v| locked[v as usize]) {
            continue;
        }
        let now = four.map(|v| excess(v).pow(2)).iter().sum::<i32>();
        let then = [excess(a) - 1, excess(b) - 1, excess(c) + 1, excess(d) + 1];
        if then.map(|e| e.pow(2)).iter().sum::<i32>() >= now || neighbours.get(c).contains(&d) {
            continue;
        }
        let point = |v: u32| sheet.points[v as usize];
        let normal = |[a, b, c]: [u32; 3]| {
            (point(b) - point(a))
                .cross(point(c) - point(a))
                .normalize_or_zero()
        };
        let [first, second] = edge.triangles.map(|t| sheet.triangles[t as usize]);
        // The first triangle without b, the second without a, each with the other's far corner.
        let turned = [
            first.map(|v| if v == b { d } else { v }),
            second.map(|v| if v == a { c } else { v }),
        ];
        let flat = normal(first) + normal(second);
        if turned.iter().any(|&t| normal(t).dot(flat) < 0.6) {
            continue;
        }
        for v in four {
            locked[v as usize] = true;
        }
        sheet.triangles[edge.triangles[0] as usize] = turned[0];
        sheet.triangles[edge.triangles[1] as usize] = turned[1];
    }
}

/// Spreads points evenly over the surface, border points along the border.
fn relax(sheet: &mut Sheet, onto: impl Fn(Vec3) -> Vec3) {
    let neighbours = sheet.neighbours();
    let border = sheet.border_links();
    let normals = sheet.normals();
    let before = sheet.points.clone();
    for v in 0..before.len() {
        let at = before[v];
        let [last, next] = border[v];
        if next != NONE && last != NONE {
            let (last, next) = (before[last as usize], before[next as usize]);
            let along = (next - last).normalize_or_zero();
            sheet.points[v] = at + 0.5 * along * along.dot(0.5 * (last + next) - at);
        } else {
            let around = neighbours.get(v as u32);
            let sum: Vec3 = around.iter().map(|&o| before[o as usize]).sum();
            let aside = sum / around.len().max(1) as f32 - at;
            sheet.points[v] = onto(at + 0.7 * (aside - normals[v] * normals[v].dot(aside)));
        }
    }
}
