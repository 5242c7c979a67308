//! The built-in body: made in code at start-up, with the arrays, joints and conventions of SMPL.
//!
//! `cage` sews measured rings into a control mesh, `subdivide` smooths it, the other files add joints,
//! skinning weights, shapes and pose correctives. `docs/body.md` says where each figure comes from.

mod cage;
mod correctives;
mod figures;
mod joints;
mod shapes;
mod skinning;
mod subdivide;

use std::sync::{Arc, OnceLock};

use glam::{Vec3, vec3};

use super::BodyModel;
use subdivide::PolygonSurface;

/// Positions are rounded to this, so that no machine's last bit reaches the identity hash.
const GRID_M: f32 = 1e-5;

/// The built-in body; made once, then shared.
pub fn body() -> Arc<BodyModel> {
    static BODY: OnceLock<Arc<BodyModel>> = OnceLock::new();
    Arc::clone(BODY.get_or_init(|| Arc::new(make())))
}

/// For each vertex the one on the other side.
pub(super) fn mirror_map() -> Vec<u32> {
    surface().mirror
}

fn make() -> BodyModel {
    let surface = surface();
    let template = template(&surface);
    let triangles = triangles(&surface.faces);
    let joints = joints::centres();
    let skin = skinning::Skin::new(&template, &surface, &joints);
    let mut body = BodyModel {
        identity: super::BodyIdentity([0; 16]),
        shape_dirs: shapes::shape_dirs(&template, &skin, &joints, &surface.mirror),
        pose_dirs: correctives::pose_dirs(&template, &skin, &joints, &surface.mirror),
        joint_regressor: joints::regressor(&template, &surface.mirror, &joints),
        skinning: skin.sparse(&surface.mirror),
        template,
        triangles,
    };
    body.identity = super::identity::of(&body);
    body
}

fn surface() -> PolygonSurface {
    let cage = cage::cage();
    let points = cage
        .points
        .iter()
        .zip(&cage.arm)
        .map(|(p, &arm)| p.extend(arm))
        .collect();
    let surface = PolygonSurface { points, faces: cage.faces, mirror: cage.mirror };
    surface.subdivided().subdivided()
}

/// The rounded left half and its exact mirror image.
fn template(surface: &PolygonSurface) -> Vec<Vec3> {
    let rounded: Vec<Vec3> = surface
        .points
        .iter()
        .map(|p| on_grid(p.truncate()))
        .collect();
    mirrored(&rounded, &surface.mirror, |v| v * vec3(-1.0, 1.0, 1.0))
}

/// Values of the left half, and on the right what `reflect` makes of them; the midline reflects onto itself.
fn mirrored(values: &[Vec3], mirror: &[u32], reflect: impl Fn(Vec3) -> Vec3) -> Vec<Vec3> {
    (0..values.len())
        .map(|i| {
            let other = mirror[i] as usize;
            match i.cmp(&other) {
                std::cmp::Ordering::Less => values[i],
                std::cmp::Ordering::Equal => (values[i] + reflect(values[i])) * 0.5,
                std::cmp::Ordering::Greater => reflect(values[other]),
            }
        })
        .collect()
}

fn on_grid(point: Vec3) -> Vec3 {
    // Adding zero turns -0 into +0, which hashes differently.
    (point / GRID_M).round() * GRID_M + Vec3::ZERO
}

fn triangles(quads: &[Vec<u32>]) -> Vec<[u32; 3]> {
    quads
        .iter()
        .flat_map(|q| [[q[0], q[1], q[2]], [q[0], q[2], q[3]]])
        .collect()
}
