//! How human the built-in body is: fitted to scans' mean bodies, its surface comes within millimetres.
#![expect(
    clippy::print_stdout,
    reason = "says what it measured, and what it skipped"
)]

mod support;

use std::path::{Path, PathBuf};

use effigy_fusion::mesh::TriangleMesh;
use effigy_registration::smpl::{BodyModel, BodyParams, builtin};
use glam::{Vec3, vec3};

/// The bar for going on (the goal is 15).
const PROCEED_MM: f32 = 20.0;

#[test]
fn comes_near_the_male_smpl_surface() {
    yardstick("smpl-body-ccby/human_man.obj", None, 1.0, 0.0);
}

#[test]
fn comes_near_the_female_smpl_surface() {
    yardstick("smpl-body-ccby/human_woman.obj", None, 1.0, 0.0);
}

#[test]
fn comes_near_the_makehuman_base_surface() {
    yardstick("makehuman-cc0/base.obj", Some("body"), 0.1, 0.75);
}

fn yardstick(file: &str, group: Option<&str>, metres_per_unit: f32, arms_down_rad: f32) {
    let Some(path) = data(file) else {
        println!("skipped: no data folder with {file}");
        return;
    };
    let target = on_floor(&load(&path, group, metres_per_unit));
    let body = builtin::body();
    let fitted = support::fit(&body, &target, &start(&body, arms_down_rad));
    let distance = support::distance(&body, &fitted.posed, &target, |i| is_counted(&body, i));
    println!(
        "{file}: {:.1} mm {distance:?} betas {:.2?}",
        distance.symmetric_mm(),
        fitted.params.betas
    );
    assert!(
        distance.symmetric_mm() < PROCEED_MM,
        "{:.1} mm",
        distance.symmetric_mm()
    );
}

/// All but hands, face and ears: those vary by expression, grip and how a scan was cleaned.
fn is_counted(body: &BodyModel, vertex: usize) -> bool {
    let joints = body.joints(&body.template);
    let p = body.template[vertex];
    let fingers = p.x.abs() > joints[22].x;
    let from_head = p - joints[15];
    let face = from_head.y > 0.0 && from_head.y < 0.16 && from_head.z > 0.03;
    let ears = from_head.y > 0.0 && from_head.y < 0.13 && p.x.abs() > 0.06;
    !(fingers || face || ears)
}

fn start(body: &BodyModel, arms_down_rad: f32) -> BodyParams {
    let mut params = BodyParams::ZERO;
    params.theta[16] = vec3(0.0, 0.0, -arms_down_rad);
    params.theta[17] = vec3(0.0, 0.0, arms_down_rad);
    let lowest = body.template.iter().map(|v| v.y).fold(f32::MAX, f32::min);
    params.trans = vec3(0.0, -lowest, 0.0);
    params
}

fn data(file: &str) -> Option<PathBuf> {
    let folder = std::env::var("EFFIGY_DATA").map_or_else(
        |_| PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared/data")),
        PathBuf::from,
    );
    let path = folder.join(file);
    path.exists().then_some(path)
}

fn load(path: &Path, group: Option<&str>, metres_per_unit: f32) -> TriangleMesh {
    let options = tobj::LoadOptions { triangulate: true, ..Default::default() };
    let (models, _) = tobj::load_obj(path, &options).expect("a readable OBJ file");
    let mut mesh = TriangleMesh::default();
    for model in models
        .iter()
        .filter(|m| group.is_none_or(|name| m.name == name))
    {
        let first = mesh.vertices.len() as u32;
        let vertices = model.mesh.positions.chunks_exact(3);
        mesh.vertices
            .extend(vertices.map(|p| Vec3::from_slice(p) * metres_per_unit));
        let triangles = model.mesh.indices.chunks_exact(3);
        mesh.triangles
            .extend(triangles.map(|t| [t[0] + first, t[1] + first, t[2] + first]));
    }
    assert!(
        !mesh.triangles.is_empty(),
        "{} has no group {group:?}",
        path.display()
    );
    mesh
}

/// Soles at y = 0, centred on the body's axis.
fn on_floor(mesh: &TriangleMesh) -> TriangleMesh {
    let used: Vec<Vec3> = mesh
        .triangles
        .iter()
        .flatten()
        .map(|&i| mesh.vertices[i as usize])
        .collect();
    let lowest = used.iter().map(|v| v.y).fold(f32::MAX, f32::min);
    let vertices = mesh.vertices.iter().map(|v| v - Vec3::Y * lowest).collect();
    TriangleMesh::new(vertices, mesh.triangles.clone())
}
