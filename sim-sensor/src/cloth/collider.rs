//! A moving surface that cloth cannot pass: the body, or a garment worn underneath.

use effigy_fusion::mesh::{closest_point::ClosestPoint, normals::vertex_normals_into};
use glam::Vec3;

use super::sheet::{NONE, Sheet};

/// A triangle mesh at the end of a step, and where it was at the step's start.
#[derive(Clone, Debug)]
pub(super) struct Collider {
    tree: ClosestPoint,
    normals: Vec<Vec3>,
    pub(super) now: Vec<Vec3>,
    before: Vec<Vec3>,
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
    /// Where a next search may start.
    pub(super) hint: u32,
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
        self.moved();
        self.before.copy_from_slice(points);
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
        // Points that are not finite keep the surface where it was.
        if self.tree.refit_distances(&self.now).is_ok() {
            vertex_normals_into(&self.now, self.tree.triangles(), &mut self.normals);
        }
    }

    /// The nearest point within reach, unless it lies on the rim.
    pub(super) fn nearest(&self, point: Vec3, reach_m: f32, hint: u32) -> Option<Touch> {
        let mut within_m = reach_m;
        if hint != NONE {
            let corner = self.tree.triangles()[hint as usize][0];
            within_m = within_m.min(point.distance(self.now[corner as usize]) + 1e-5);
        }
        let hit = self.tree.query_within(point, within_m)?;
        let corners = self.tree.triangles()[hit.triangle as usize].map(|v| v as usize);
        let weights = hit.barycentric;
        if (0..3).all(|k| weights[k] == 0.0 || self.rim[corners[k]]) {
            return None;
        }
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
            hint: hit.triangle,
        })
    }
}
