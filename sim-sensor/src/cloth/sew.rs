//! Sewing: from a pattern and a dress form to a garment with its rest shape, weights and belt.

use effigy_fusion::mesh::closest_point::ClosestPoint;
use effigy_registration::smpl::VertexWeights;
use glam::Vec3;

use super::{
    collider::Arm,
    cut::{clipped_by, covered, seam_height_m, tucked_hem_m},
    form::Form,
    hang::with_hanging_part,
    hold::{Held, held},
    opening::{add_folded_collar, front_gap},
    pattern::{Front, Limbs, Pattern, Top},
    remesh::remeshed,
    sheet::{NONE, Sheet},
    sleeve::{Ring, rings},
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
    /// The arm that each point is around.
    pub(super) arms: Vec<Option<Arm>>,
    pub(super) rings: Vec<Ring>,
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
    let arms: Vec<Option<Arm>> = weights
        .iter()
        .map(|weights| Arm::of_bone(weights.main_bone()))
        .collect();
    let rings = rings(form, &sheet, &arms);
    let home = sheet
        .points
        .iter()
        .map(|&point| form.nearest_vertex(point))
        .collect();
    let mut laid_out = sheet.clone();
    for (point, weights) in laid_out.points.iter_mut().zip(&weights) {
        let at_rest = form.at_rest(*point, weights);
        *point = put_on.bones.blend(weights).transform_point3(at_rest);
    }
    Under::new(put_on, inner).push_out(&mut laid_out);
    Garment {
        pattern: *pattern,
        rest: sheet,
        laid_out: laid_out.points,
        weights,
        home,
        held,
        arms,
        rings,
    }
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
