//! Sewing: from a pattern and a dress form to a garment with its rest shape, weights and belt.

use effigy_fusion::mesh::closest_point::ClosestPoint;
use effigy_registration::smpl::VertexWeights;
use glam::{Vec3, vec2};

use super::{
    cut::{clipped_by, covered, seam_height_m, tucked_hem_m},
    form::Form,
    pattern::{Front, Limbs, Pattern, Top},
    remesh::remeshed,
    sheet::{NONE, Sheet},
    weights,
};
use crate::person::{chart::Place, smoothstep};

/// Points a garment gets, and edges between which that may be reached.
const POINTS: f32 = 3000.0;
const EDGE_M: [f32; 2] = [0.014, 0.023];
/// Nothing is cut closer to the skin, or to another garment, than this.
pub(super) const CLOSEST_M: f32 = 0.004;
/// Rounds in which the cut surface is smoothed and pushed out of the body again.
const SHAPING: usize = 12;
const HOOD_SHAPING: usize = 60;
/// Room between a leg's cloth and the body's middle plane.
const MIDLINE_GAP_M: f32 = 0.004;
/// Cloth this close below the waist is held by the belt.
const BELT_M: f32 = 0.028;
/// Belts give a little; so does what keeps a shirt in its place on the neck and shoulders.
const BELT_COMPLIANCE: f32 = 1e-4;
const NECK_COMPLIANCE: f32 = 3e-4;
/// How far the seam of the neck and shoulders reaches from the neck's joint.
const NECK_SEAM_M: f32 = 0.09;
const RIB_M: f32 = 0.06;
/// Half the gap between the free front edges: at the buttons and at the collar.
const FRONT_GAP_M: [f32; 2] = [0.012, 0.075];

/// A garment cut to one person, in the pose it was cut in.
#[derive(Clone, Debug)]
pub struct Garment {
    pub pattern: Pattern,
    /// The shape in which cloth is neither stretched nor bent.
    pub rest: Sheet,
    /// The same points in the pose in which clothes are put on.
    pub(super) laid_out: Vec<Vec3>,
    /// Skinning weights, diffused over the garment.
    pub weights: Vec<VertexWeights>,
    /// The body's vertex nearest to each point when it was cut.
    pub home: Vec<u32>,
    pub(super) held: Vec<Held>,
}

/// A point of a garment that is held in its place by a belt or a seam.
#[derive(Clone, Copy, Debug)]
pub(super) struct Held {
    pub(super) point: u32,
    /// Its place in the zero pose, and the bones of the trunk that move it.
    pub(super) at_rest: Vec3,
    pub(super) weights: VertexWeights,
    /// For unit mass, in seconds squared.
    pub(super) compliance: f32,
}

/// Cuts and sews one garment on its form, over the others on theirs, and lays it out on the form on which
/// clothes are put on.
pub(super) fn sew(form: &Form, pattern: &Pattern, inner: &[Garment], put_on: &Form) -> Garment {
    let skin = covered(form, pattern);
    let mut edge_m = edge_for(skin.area_m2());
    let onto_body = |p: Vec3| form.tree.query(p).point;
    let mut sheet = remeshed(&skin, 1.2 * edge_m, 5, onto_body);
    let under = Under::new(form, inner);
    ease_out(&mut sheet, form, pattern, &under);
    if let Some(hem) = pattern.hem {
        sheet = with_hanging_part(&sheet, form, pattern, form.leg_height_m(hem));
    }
    edge_m = edge_for(sheet.area_m2());
    sheet = evened(&sheet, edge_m, 5);
    if pattern.front == Front::Open {
        let middle = form.joints[0];
        let neck_m = form.joints[12].y;
        sheet = clipped_by(&sheet, |p| front_gap(p - middle, neck_m - middle.y));
        sheet = evened(&sheet, edge_m, 3);
    }
    under.push_out(&mut sheet);
    if matches!(pattern.top, Top::FoldedCollar { .. }) {
        add_folded_collar(&mut sheet, form.joints[12]);
    }
    let weights = weights::diffused(form, &sheet, pattern);
    let held = held(form, pattern, &sheet);
    let home = sheet
        .points
        .iter()
        .map(|&point| form.nearest_vertex(point))
        .collect();
    let mut laid_out = sheet.clone();
    for (point, weights) in laid_out.points.iter_mut().zip(&weights) {
        let at_rest = form.bones.blend(weights).inverse().transform_point3(*point);
        *point = put_on.bones.blend(weights).transform_point3(at_rest);
    }
    Under::new(put_on, inner).push_out(&mut laid_out);
    Garment { pattern: *pattern, rest: sheet, laid_out: laid_out.points, weights, home, held }
}

fn edge_for(area_m2: f32) -> f32 {
    (area_m2 / (0.866 * POINTS))
        .sqrt()
        .clamp(EDGE_M[0], EDGE_M[1])
}

fn evened(sheet: &Sheet, edge_m: f32, rounds: usize) -> Sheet {
    let tree = ClosestPoint::new(&sheet.points, &sheet.triangles)
        .expect("what is cut from a body has triangles");
    remeshed(sheet, edge_m, rounds, |p| tree.query(p).point)
}

/// What lies under a garment while it is cut.
struct Under<'a> {
    form: &'a Form,
    inner: Vec<(ClosestPoint, Vec<bool>)>,
}

impl<'a> Under<'a> {
    fn new(form: &'a Form, inner: &[Garment]) -> Self {
        let tree = |garment: &Garment| {
            let rest = &garment.rest;
            let tree =
                ClosestPoint::new(&rest.points, &rest.triangles).expect("garments have triangles");
            let links = rest.border_links();
            (tree, links.iter().map(|link| link[1] != NONE).collect())
        };
        Self { form, inner: inner.iter().map(tree).collect() }
    }

    /// Moves a point out to this distance from the skin, and out of other garments.
    fn outside(&self, mut point: Vec3, distance_m: f32) -> Vec3 {
        for _ in 0..2 {
            let hit = self.form.tree.query(point);
            let distance = self.form.tree.sign(point, &hit);
            if distance < distance_m {
                point = hit.point + self.form.normal(&hit) * distance_m;
            }
            for (tree, rim) in &self.inner {
                let Some(hit) = tree.query_within(point, 0.04) else {
                    continue;
                };
                let corners = tree.triangles()[hit.triangle as usize];
                let on_rim = (0..3).all(|k| hit.barycentric[k] == 0.0 || rim[corners[k] as usize]);
                let distance = tree.sign(point, &hit);
                if !on_rim && distance < CLOSEST_M {
                    let normal = tree.triangle_normal(hit.triangle);
                    point = hit.point + normal * CLOSEST_M;
                }
            }
        }
        point
    }

    fn push_out(&self, sheet: &mut Sheet) {
        for point in &mut sheet.points {
            *point = self.outside(*point, CLOSEST_M);
        }
    }
}

/// Moves cloth off the skin by its ease, smoothly, bridging hollows.
fn ease_out(sheet: &mut Sheet, form: &Form, pattern: &Pattern, under: &Under<'_>) {
    let mut eases = Vec::with_capacity(sheet.points.len());
    let mut places = Vec::with_capacity(sheet.points.len());
    for point in &mut sheet.points {
        let hit = form.tree.query(*point);
        let place = form.place(&hit);
        let ease = ease_m(pattern, &place, *point, form);
        *point += form.normal(&hit) * ease;
        eases.push(ease);
        places.push(place);
    }
    let (neighbours, border) = (sheet.neighbours(), sheet.border_links());
    let rounds = if pattern.top == Top::Hood {
        HOOD_SHAPING
    } else {
        SHAPING
    };
    for _ in 0..rounds {
        sheet.smooth(&neighbours, &border, 0.5);
        for (v, point) in sheet.points.iter_mut().enumerate() {
            *point = under.outside(*point, (0.75 * eases[v]).max(CLOSEST_M));
            if matches!(pattern.limbs, Limbs::Legs { .. }) && places[v].leg > -0.1 {
                let sign = if places[v].side == 0 { 1.0 } else { -1.0 };
                let aside = (point.x - form.joints[0].x) * sign;
                point.x += sign * (MIDLINE_GAP_M * places[v].leg_share.min(1.0) - aside).max(0.0);
            }
        }
    }
}

/// How far a garment stands off at a place of the body.
fn ease_m(pattern: &Pattern, place: &Place, point: Vec3, form: &Form) -> f32 {
    let ease = &pattern.ease;
    let (along, end) = match pattern.limbs {
        Limbs::Arms { end } => (place.arm, end),
        Limbs::Legs { end } => (place.leg, end),
        Limbs::None => (-1.0, 1.0),
    };
    let on_limb = smoothstep(-0.1, 0.45, along);
    let to_end = if ease.ribbed {
        smoothstep(end - 0.22, end - 0.06, along)
    } else {
        (along / end).clamp(0.0, 1.0)
    };
    let mut ease_m = ease.trunk_m + (ease.limb_m - ease.trunk_m) * on_limb;
    ease_m += (ease.end_m - ease_m) * to_end * on_limb;
    match pattern.top {
        Top::Waist { above_hips_m } => {
            let below_m = form.leg_height_m(0.0) + above_hips_m - point.y;
            ease_m = CLOSEST_M + (ease_m - CLOSEST_M) * smoothstep(0.02, 0.12, below_m);
        }
        Top::Hood => ease_m += (0.020 - ease_m) * smoothstep(0.2, 0.8, place.head_share),
        Top::Collar { .. } | Top::FoldedCollar { .. } => {
            let from_neck_m = point.distance(form.joints[12]);
            ease_m = CLOSEST_M + (ease_m - CLOSEST_M) * smoothstep(0.09, 0.19, from_neck_m);
        }
    }
    if pattern.is_tucked_in() {
        let above_m = point.y - tucked_hem_m(form);
        ease_m = CLOSEST_M + (ease_m - CLOSEST_M) * smoothstep(0.02, 0.10, above_m);
    }
    if pattern.hem.is_some() && !matches!(pattern.top, Top::Waist { .. }) {
        let above_m = point.y - seam_height_m(form);
        let near_hem = smoothstep(0.40, 0.0, above_m) * (1.0 - smoothstep(-0.1, 0.1, along));
        if !ease.ribbed {
            ease_m += (ease.hem_m - ease_m) * near_hem;
        }
    }
    ease_m.max(CLOSEST_M)
}

/// Hangs rows of cloth from the lowest border: around both legs, never narrower than above.
fn with_hanging_part(sheet: &Sheet, form: &Form, pattern: &Pattern, hem_m: f32) -> Sheet {
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
fn sew_rows(sheet: &mut Sheet, border: &[u32], row: &[u32], closed: bool) {
    let count = border.len();
    for i in 0..if closed { count } else { count - 1 } {
        let next = (i + 1) % count;
        let [a, b, below_a, below_b] = [border[i], border[next], row[i], row[next]];
        sheet.triangles.push([b, a, below_a]);
        sheet.triangles.push([b, below_a, below_b]);
    }
}

/// Positive beside the front opening of a jacket; `neck_m` is the neck's height over the pelvis.
fn front_gap(from_pelvis: Vec3, neck_m: f32) -> f32 {
    let up = from_pelvis.y / neck_m;
    let lapel = smoothstep(0.35, 1.0, up);
    let round = smoothstep(-0.25, -0.75, up);
    let half_gap_m = FRONT_GAP_M[0] + (FRONT_GAP_M[1] - FRONT_GAP_M[0]) * lapel + 0.05 * round;
    (from_pelvis.x.abs() - half_gap_m).max(0.02 - from_pelvis.z)
}

/// A collar that stands around the neck and falls over, open in front.
fn add_folded_collar(sheet: &mut Sheet, neck: Vec3) {
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

/// What keeps a garment on: a belt around the waist, or the seam around the neck.
fn held(form: &Form, pattern: &Pattern, sheet: &Sheet) -> Vec<Held> {
    let waist_m = form.leg_height_m(0.0);
    let neck = form.joints[12];
    const WAIST: (&[u8], f32) = (&[0, 3], BELT_COMPLIANCE);
    const NECK: (&[u8], f32) = (&[6, 9, 12, 13, 14], NECK_COMPLIANCE);
    let holding = |point: Vec3| match pattern.top {
        Top::Waist { above_hips_m } => (point.y > waist_m + above_hips_m - BELT_M).then_some(WAIST),
        Top::Collar { .. } | Top::FoldedCollar { .. } => {
            let on_neck = point.z < neck.z + 0.02 && point.distance(neck) < NECK_SEAM_M;
            let under_belt = pattern.is_tucked_in() && point.y < tucked_hem_m(form) + BELT_M;
            if on_neck {
                Some(NECK)
            } else {
                under_belt.then_some(WAIST)
            }
        }
        Top::Hood => None,
    };
    let held = |(v, &point): (usize, &Vec3)| {
        let (bones, compliance) = holding(point)?;
        let shares = form.bone_shares(point, false);
        let total: f32 = bones.iter().map(|&bone| shares[bone as usize]).sum();
        let mut weights = VertexWeights::default();
        weights.bones[0] = bones[0];
        weights.weights[0] = 1.0;
        if total > 0.01 {
            // The four strongest are enough: no point of a neck or waist has more.
            let mut order = bones.to_vec();
            order.sort_by(|&a, &b| shares[b as usize].total_cmp(&shares[a as usize]));
            let kept: f32 = order
                .iter()
                .take(4)
                .map(|&bone| shares[bone as usize])
                .sum();
            for (slot, &bone) in order.iter().take(4).enumerate() {
                weights.bones[slot] = bone;
                weights.weights[slot] = shares[bone as usize] / kept;
            }
        }
        let at_rest = form.bones.blend(&weights).inverse().transform_point3(point);
        Some(Held { point: v as u32, at_rest, weights, compliance })
    };
    sheet.points.iter().enumerate().filter_map(held).collect()
}
