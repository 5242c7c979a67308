//! The dress form: the body in the pose in which clothes are cut, with what a tailor asks about it.

use effigy_fusion::mesh::closest_point::{ClosestPoint, Hit};
use effigy_registration::{
    motion::MotionPose,
    smpl::{BoneTransforms, JOINT_COUNT, VertexWeights},
};
use glam::{Vec2, Vec3, vec2};

use super::sheet::Sheet;
use crate::person::{
    Person,
    chart::{Chart, Place},
};

/// Arms hang this far below horizontal while clothes are cut.
const ARMS_DOWN_RAD: f32 = 0.80;
/// Cloth sees a body smoothed this many rounds.
const SMOOTHING: usize = 14;

/// A posed body to cut clothes on.
pub(super) struct Form {
    /// The body with its shoes and hair.
    pub(super) surface: Sheet,
    /// Normals of the smoothed surface.
    pub(super) normals: Vec<Vec3>,
    pub(super) tree: ClosestPoint,
    pub(super) chart: Chart,
    pub(super) skinning: Vec<VertexWeights>,
    pub(super) joints: [Vec3; JOINT_COUNT],
    /// From the zero pose to this one.
    pub(super) bones: BoneTransforms,
    /// The height of the lowest point of the trunk between the legs.
    pub(super) crotch_m: f32,
}

/// A horizontal outline around the legs: convex, counter-clockwise seen from above.
pub(super) struct Outline(Vec<Vec2>);

/// The pose in which clothes are cut. Trousers are cut with hips and knees bent a little, for a seat that one
/// can sit down in.
pub(super) fn cut_pose(legs_apart_rad: f32, bent_rad: f32) -> MotionPose {
    let mut theta = [Vec3::ZERO; JOINT_COUNT];
    for (side, sign) in [(0, 1.0), (1, -1.0)] {
        theta[1 + side] = Vec3::new(-bent_rad, 0.0, legs_apart_rad * sign);
        theta[4 + side] = Vec3::X * bent_rad;
        theta[13 + side] = Vec3::Z * -0.15 * ARMS_DOWN_RAD * sign;
        theta[16 + side] = Vec3::Z * -0.85 * ARMS_DOWN_RAD * sign;
    }
    MotionPose { theta, trans: Vec3::ZERO }
}

impl Form {
    pub(super) fn new(person: &Person, pose: &MotionPose) -> Self {
        let points = person.clothed_posed_vertices(&pose.theta, pose.trans);
        let surface = Sheet { points, triangles: person.body.triangles.clone() };
        let mut smoothed = surface.clone();
        let (neighbours, border) = (surface.neighbours(), surface.border_links());
        for _ in 0..SMOOTHING {
            smoothed.smooth(&neighbours, &border, 0.5);
        }
        let tree = ClosestPoint::new(&surface.points, &surface.triangles)
            .expect("a body has triangles and finite vertices");
        let (bones, joints) = BoneTransforms::from_pose(&pose.theta, &person.rest_joints);
        Self {
            normals: smoothed.normals(),
            tree,
            chart: person.chart(),
            skinning: person.body.skinning.clone(),
            joints: joints.map(|joint| joint + pose.trans),
            surface,
            bones,
            crotch_m: crotch_m(person) + pose.trans.y,
        }
    }

    /// A point that moves with these bones, taken from this pose to the zero pose.
    pub(super) fn at_rest(&self, point: Vec3, weights: &VertexWeights) -> Vec3 {
        self.bones.blend(weights).inverse().transform_point3(point)
    }

    /// A value of the nearest point of the body, interpolated.
    pub(super) fn blend(&self, hit: &Hit, value: impl Fn(usize) -> f32) -> f32 {
        let corners = self.surface.triangles[hit.triangle as usize];
        (0..3)
            .map(|k| hit.barycentric[k] * value(corners[k] as usize))
            .sum()
    }

    pub(super) fn normal(&self, hit: &Hit) -> Vec3 {
        let corners = self.surface.triangles[hit.triangle as usize];
        let sum: Vec3 = (0..3)
            .map(|k| self.normals[corners[k] as usize] * hit.barycentric[k])
            .sum();
        sum.normalize_or(self.tree.triangle_normal(hit.triangle))
    }

    pub(super) fn place(&self, hit: &Hit) -> Place {
        let corners = self.surface.triangles[hit.triangle as usize];
        let nearest = corners[hit.barycentric.max_position()] as usize;
        let places = &self.chart.places;
        Place {
            side: places[nearest].side,
            arm: self.blend(hit, |v| places[v].arm),
            leg: self.blend(hit, |v| places[v].leg),
            trunk: self.blend(hit, |v| places[v].trunk),
            head_share: self.blend(hit, |v| places[v].head_share),
            arm_share: self.blend(hit, |v| places[v].arm_share),
            leg_share: self.blend(hit, |v| places[v].leg_share),
            foot_share: self.blend(hit, |v| places[v].foot_share),
        }
    }

    pub(super) fn nearest_vertex(&self, point: Vec3) -> u32 {
        let hit = self.tree.query(point);
        self.surface.triangles[hit.triangle as usize][hit.barycentric.max_position()]
    }

    /// Whether a point is nearer to trunk and legs than to a hand that hangs beside them.
    pub(super) fn trunk_side(&self, point: Vec3) -> bool {
        let hit = self.tree.query(point);
        self.blend(&hit, |v| self.chart.places[v].arm_share) < 0.5
            || (point.x - self.joints[0].x).abs() < 0.22
    }

    /// Skinning of the nearest point of the body. Cloth that hangs knows only hips and thighs: knees bend
    /// under a skirt without it.
    pub(super) fn bone_shares(&self, point: Vec3, hangs: bool) -> [f32; JOINT_COUNT] {
        let mut shares = [0.0; JOINT_COUNT];
        let hit = self.tree.query(point);
        let corners = self.surface.triangles[hit.triangle as usize];
        for (corner, part) in corners.into_iter().zip(hit.barycentric.to_array()) {
            let weights = &self.skinning[corner as usize];
            for (&bone, &weight) in weights.bones.iter().zip(&weights.weights) {
                let bone = match bone {
                    4 | 7 | 10 if hangs => 1,
                    5 | 8 | 11 if hangs => 2,
                    3 | 6 | 13..=23 if hangs => 0,
                    other => other,
                };
                shares[bone as usize] += weight * part;
            }
        }
        shares
    }

    /// Height of a station of the legs (0 hip, 1 knee, 2 ankle).
    pub(super) fn leg_height_m(&self, station: f32) -> f32 {
        let y = |joint: usize| 0.5 * (self.joints[joint].y + self.joints[joint + 1].y);
        if station < 1.0 {
            y(1) + (y(4) - y(1)) * station
        } else {
            y(4) + (y(7) - y(4)) * (station - 1.0)
        }
    }

    /// The convex outline of trunk and legs at a height.
    pub(super) fn outline(&self, height_m: f32) -> Outline {
        let points = self.surface.points.iter().zip(&self.chart.places);
        let near = points
            .filter(|(p, place)| (p.y - height_m).abs() < 0.02 && place.arm_share < 0.3)
            .map(|(p, _)| vec2(p.x, p.z))
            .collect();
        Outline(convex_hull(near))
    }
}

impl Outline {
    /// From a point inside, how far it is to the outline in a direction; 0 if there is nothing.
    pub(super) fn radius_m(&self, center: Vec2, direction: Vec2) -> f32 {
        let corners = &self.0;
        let mut radius_m = 0.0_f32;
        for (i, &a) in corners.iter().enumerate() {
            let b = corners[(i + 1) % corners.len()];
            let (from, side) = (a - center, b - a);
            let cross = direction.perp_dot(side);
            if cross.abs() < 1e-9 {
                continue;
            }
            let along = from.perp_dot(side) / cross;
            let share = from.perp_dot(direction) / cross;
            if (-1e-4..=1.0001).contains(&share) {
                radius_m = radius_m.max(along);
            }
        }
        radius_m
    }
}

/// The lowest point between the legs, looked for with the legs so far apart that they do not touch.
fn crotch_m(person: &Person) -> f32 {
    const APART_RAD: f32 = 0.4;
    let apart = cut_pose(APART_RAD, 0.0);
    let points = person.clothed_posed_vertices(&apart.theta, apart.trans);
    let middle = person.rest_joints[0].x;
    let inner = points.iter().filter(|p| (p.x - middle).abs() < 0.012);
    inner.map(|p| p.y).fold(f32::MAX, f32::min)
}

/// Andrew's monotone chain.
fn convex_hull(mut points: Vec<Vec2>) -> Vec<Vec2> {
    points.sort_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)));
    points.dedup();
    if points.len() < 3 {
        return Vec::new();
    }
    let mut hull: Vec<Vec2> = Vec::new();
    for pass in 0..2 {
        let start = hull.len();
        let ordered: Box<dyn Iterator<Item = &Vec2>> = if pass == 0 {
            Box::new(points.iter())
        } else {
            Box::new(points.iter().rev())
        };
        for &point in ordered {
            while hull.len() >= start + 2 {
                let [a, b] = [hull[hull.len() - 2], hull[hull.len() - 1]];
                if (b - a).perp_dot(point - b) > 0.0 {
                    break;
                }
                hull.pop();
            }
            hull.push(point);
        }
        hull.pop();
    }
    hull
}
