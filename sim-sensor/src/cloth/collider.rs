//! A moving surface that cloth cannot pass: the body, or a garment worn underneath.

use effigy_fusion::mesh::{closest_point::ClosestPoint, normals::vertex_normals_into};
use effigy_registration::smpl::VertexWeights;
use glam::Vec3;

use super::sheet::{NONE, Sheet};

/// How far around a point surfaces are looked for: deeper than cloth ever gets between two looks.
pub(super) const REACH_M: f32 = 0.035;

/// The furthest that skin pushes out in one step what is inside. Where limbs run into each other, the nearest surface
/// is another one from one moment to the next; a push all the way would tear the garment.
const DEPENETRATION_M: f32 = 0.004;

/// A triangle mesh at the end of a step, and where it was at the step's start.
#[derive(Clone, Debug)]
pub(super) struct Collider {
    tree: ClosestPoint,
    normals: Vec<Vec3>,
    pub(super) now: Vec<Vec3>,
    before: Vec<Vec3>,
    /// No point has moved further than this since the surface was placed.
    pub(super) travel_m: f32,
    /// Border points: beyond them there is no surface.
    rim: Vec<bool>,
}

/// The nearest point of a collider.
#[derive(Clone, Copy, Debug)]
pub(super) struct Touch {
    pub(super) point: Vec3,
    /// Outwards, of unit length.
    pub(super) normal: Vec3,
    /// Negative inside.
    pub(super) distance_m: f32,
    /// How far the surface moved in this step.
    pub(super) moved: Vec3,
    /// Where on the surface; a next search may start from this triangle.
    pub(super) triangle: u32,
    pub(super) barycentric: Vec3,
    /// Whether the surface ends here, so that nothing is inside or outside.
    pub(super) on_rim: bool,
}

/// What a garment touches: how near it may come to each surface.
pub(super) struct Obstacle<'a> {
    pub(super) collider: &'a Collider,
    pub(super) thickness_m: f32,
    /// What is further inside than this is left alone: thin cloth has an inside for no more than that.
    pub(super) deepest_m: f32,
    /// The furthest a point is pushed out in one step, beyond what the surface itself moves.
    pub(super) push_m: f32,
    /// The garment's number, if it is one.
    pub(super) layer: Option<usize>,
    /// Only for sleeves of this arm, which nothing else of the body then pushes: an arm pressed against the trunk
    /// keeps its sleeve.
    pub(super) sleeve: Option<Arm>,
}

/// Which arm a sleeve is on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Arm {
    Left,
    Right,
}

impl Arm {
    pub(super) const BOTH: [Self; 2] = [Self::Left, Self::Right];

    /// The arm of a bone: upper arm, forearm or hand.
    pub(super) fn of_bone(bone: u8) -> Option<Self> {
        match bone {
            16 | 18 | 20 | 22 => Some(Self::Left),
            17 | 19 | 21 | 23 => Some(Self::Right),
            _ => None,
        }
    }
}

/// A part of the body as an obstacle of its own.
#[derive(Clone, Debug)]
pub(super) struct Part {
    pub(super) arm: Arm,
    pub(super) collider: Collider,
    /// The body's vertices it has.
    vertices: Vec<u32>,
}

impl Part {
    /// One arm of a body, from the shoulder to the fingers.
    pub(super) fn arm(arm: Arm, body: &Sheet, skinning: &[VertexWeights]) -> Self {
        let is_arms = |v: u32| Arm::of_bone(skinning[v as usize].main_bone()) == Some(arm);
        let of_arm = body
            .triangles
            .iter()
            .filter(|t| t.iter().all(|&v| is_arms(v)));
        let mut vertices: Vec<u32> = of_arm.clone().flatten().copied().collect();
        vertices.sort_unstable();
        vertices.dedup();
        let number = |v: &u32| vertices.binary_search(v).expect("it was collected") as u32;
        let triangles = of_arm.map(|t| [number(&t[0]), number(&t[1]), number(&t[2])]);
        let sheet = Sheet {
            points: vertices.iter().map(|&v| body.points[v as usize]).collect(),
            triangles: triangles.collect(),
        };
        Self { arm, collider: Collider::new(&sheet), vertices }
    }

    /// Jumps to where the body is.
    pub(super) fn place(&mut self, body: &[Vec3]) {
        let points: Vec<Vec3> = self.vertices.iter().map(|&v| body[v as usize]).collect();
        self.collider.place(&points);
    }

    /// Moves on with the body.
    pub(super) fn advance(&mut self, body: &[Vec3]) {
        let points = self.vertices.iter().map(|&v| body[v as usize]);
        self.collider.advance(points);
    }
}

impl<'a> Obstacle<'a> {
    pub(super) fn body(collider: &'a Collider, thickness_m: f32) -> Self {
        Self {
            collider,
            thickness_m,
            deepest_m: REACH_M,
            push_m: DEPENETRATION_M,
            layer: None,
            sleeve: None,
        }
    }

    pub(super) fn part(part: &'a Part, thickness_m: f32) -> Self {
        Self { sleeve: Some(part.arm), ..Self::body(&part.collider, thickness_m) }
    }

    pub(super) fn layer(number: usize, collider: &'a Collider, thickness_m: f32) -> Self {
        Self {
            deepest_m: 0.010,
            push_m: 0.001,
            layer: Some(number),
            ..Self::body(collider, thickness_m)
        }
    }
}

impl Collider {
    pub(super) fn new(sheet: &Sheet) -> Self {
        let tree = ClosestPoint::new(&sheet.points, &sheet.triangles)
            .expect("bodies and garments have triangles and finite points");
        Self {
            tree,
            normals: sheet.normals(),
            now: sheet.points.clone(),
            before: sheet.points.clone(),
            travel_m: 0.0,
            rim: sheet
                .border_links()
                .iter()
                .map(|link| link[1] != NONE)
                .collect(),
        }
    }

    /// Jumps to a place, at rest.
    pub(super) fn place(&mut self, points: &[Vec3]) {
        self.now.copy_from_slice(points);
        self.before.copy_from_slice(points);
        self.moved();
        self.travel_m = 0.0;
    }

    /// Moves on: what was the end of the last step is the start of this one.
    pub(super) fn advance(&mut self, points: impl Iterator<Item = Vec3>) {
        std::mem::swap(&mut self.now, &mut self.before);
        for (now, point) in self.now.iter_mut().zip(points) {
            *now = point;
        }
        self.moved();
    }

    fn moved(&mut self) {
        let steps = self.now.iter().zip(&self.before);
        let furthest = steps
            .map(|(now, before)| now.distance_squared(*before))
            .fold(0.0, f32::max);
        self.travel_m += furthest.sqrt();
        // Points that are not finite keep the surface where it was.
        if self.tree.refit_distances(&self.now).is_ok() {
            vertex_normals_into(&self.now, self.tree.triangles(), &mut self.normals);
        }
    }

    pub(super) fn corners(&self, triangle: u32) -> [u32; 3] {
        self.tree.triangles()[triangle as usize]
    }

    /// The nearest point within reach.
    pub(super) fn nearest(&self, point: Vec3, reach_m: f32, hint: u32) -> Option<Touch> {
        let mut within_m = reach_m;
        if hint != NONE {
            let corner = self.tree.triangles()[hint as usize][0];
            within_m = within_m.min(point.distance(self.now[corner as usize]) + 1e-5);
        }
        let hit = self.tree.query_within(point, within_m)?;
        let corners = self.tree.triangles()[hit.triangle as usize].map(|v| v as usize);
        let weights = hit.barycentric;
        let on_rim = (0..3).all(|k| weights[k] == 0.0 || self.rim[corners[k]]);
        let blend = |of: &dyn Fn(usize) -> Vec3| -> Vec3 {
            (0..3).map(|k| of(corners[k]) * weights[k]).sum()
        };
        let smooth = blend(&|v| self.normals[v]);
        let aside = point - hit.point;
        let outside = aside.dot(smooth) >= 0.0;
        let sign = if outside { 1.0 } else { -1.0 };
        // Too close to tell a direction, the surface's own normal is the better one.
        let normal = if hit.distance > 1e-4 {
            aside * (sign / hit.distance)
        } else {
            smooth.normalize_or(Vec3::Y)
        };
        Some(Touch {
            point: hit.point,
            normal,
            distance_m: sign * hit.distance,
            moved: blend(&|v| self.now[v] - self.before[v]),
            triangle: hit.triangle,
            barycentric: weights,
            on_rim,
        })
    }
}
