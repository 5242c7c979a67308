//! How good an avatar or a body is: MetaAvatar's measures to the letter, and symmetric ones beside them.

use effigy_fusion::{
    FusionError, TriangleMesh,
    mesh::{closest_point::ClosestPoint, normals::vertex_normals},
};
use effigy_registration::{BodyModel, smpl::JOINT_COUNT};
use glam::Vec3;
use kiddo::{ImmutableKdTree, SquaredEuclidean};
use serde::{Deserialize, Serialize};

/// MetaAvatar's three measures (seed-systems.md 1.10): from masked truth vertices to the prediction only.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SurfaceMetrics {
    /// Mean distance to the nearest predicted vertex; depends on how dense the prediction is.
    pub d_p_cm: f32,
    /// Mean distance to the predicted surface.
    pub d_f_cm: f32,
    /// One minus the mean chord between the normals at nearest vertices: in [-1, 1], not a cosine.
    pub nc: f32,
}

/// Bones whose vertices count: the body without ankles, feet, neck, head, wrists and hands.
const MEASURED_BONES: [u8; 14] = [0, 1, 2, 3, 4, 5, 6, 9, 13, 14, 16, 17, 18, 19];

/// Which vertices of a mesh on the body's topology count: those whose largest weight is a measured bone's.
pub fn measured_vertices(model: &BodyModel) -> Vec<bool> {
    model
        .skinning
        .iter()
        .map(|weights| {
            let largest = (0..4)
                .rev()
                .max_by(|&a, &b| weights.weights[a].total_cmp(&weights.weights[b]))
                .expect("there are four slots");
            MEASURED_BONES.contains(&weights.bones[largest])
        })
        .collect()
}

/// D_p, D_f and NC of a prediction; `measured` says which truth vertices count.
///
/// `None` if nothing is left to measure. Normals are those of the meshes' triangles, weighted by area.
pub fn surface_metrics(
    truth: &TriangleMesh,
    measured: &[bool],
    predicted: &TriangleMesh,
) -> Result<Option<SurfaceMetrics>, FusionError> {
    let counted: Vec<usize> = (0..truth.vertices.len().min(measured.len()))
        .filter(|&vertex| measured[vertex])
        .collect();
    let Some(tree) = nearest_vertices(&predicted.vertices).filter(|_| !counted.is_empty()) else {
        return Ok(None);
    };
    let truth_normals = vertex_normals(&truth.vertices, &truth.triangles);
    let predicted_normals = vertex_normals(&predicted.vertices, &predicted.triangles);
    let points: Vec<Vec3> = counted
        .iter()
        .map(|&vertex| truth.vertices[vertex])
        .collect();
    let (mut to_vertex, mut chord) = (0.0_f64, 0.0_f64);
    for (&vertex, &point) in counted.iter().zip(&points) {
        let nearest = tree
            .query(&point.to_array())
            .nearest_one::<SquaredEuclidean<f32>>()
            .execute();
        to_vertex += f64::from(nearest.distance).sqrt();
        let normal = predicted_normals[nearest.item as usize];
        chord += f64::from(normal.distance(truth_normals[vertex]));
    }
    let count = counted.len() as f64;
    Ok(Some(SurfaceMetrics {
        d_p_cm: (100.0 * to_vertex / count) as f32,
        d_f_cm: 100.0 * mean_distance_m(&points, predicted)?,
        nc: (1.0 - chord / count) as f32,
    }))
}

/// Mean of the distances from each mesh's vertices to the other's surface, both ways averaged, in mm.
pub fn p2s_mm(a: &TriangleMesh, b: &TriangleMesh) -> Result<f32, FusionError> {
    let a_to_b = mean_distance_m(&a.vertices, b)?;
    let b_to_a = mean_distance_m(&b.vertices, a)?;
    Ok(500.0 * (a_to_b + b_to_a))
}

/// Mean distance of observed points to a posed surface, in mm; NaN without points.
pub fn observed_mm(points: &[Vec3], surface: &TriangleMesh) -> Result<f32, FusionError> {
    Ok(1000.0 * mean_distance_m(points, surface)?)
}

/// Mean distance between corresponding vertices, in mm; NaN if there are none or the counts differ.
pub fn v2v_mm(truth: &[Vec3], predicted: &[Vec3]) -> f32 {
    if truth.len() != predicted.len() {
        return f32::NAN;
    }
    let sum: f64 = truth
        .iter()
        .zip(predicted)
        .map(|(a, b)| f64::from(a.distance(*b)))
        .sum();
    (1000.0 * sum / truth.len() as f64) as f32
}

/// Mean distance between corresponding joints, in mm; nothing is aligned first.
pub fn mpjpe_mm(truth: &[Vec3; JOINT_COUNT], predicted: &[Vec3; JOINT_COUNT]) -> f32 {
    v2v_mm(truth, predicted)
}

fn mean_distance_m(points: &[Vec3], surface: &TriangleMesh) -> Result<f32, FusionError> {
    let hits = ClosestPoint::from_mesh(surface)?.query_all(points);
    let sum: f64 = hits.iter().map(|hit| f64::from(hit.distance)).sum();
    Ok((sum / points.len() as f64) as f32)
}

fn nearest_vertices(vertices: &[Vec3]) -> Option<ImmutableKdTree<f32, 3>> {
    if vertices.is_empty() {
        return None;
    }
    let points: Vec<[f32; 3]> = vertices.iter().map(Vec3::to_array).collect();
    ImmutableKdTree::new_from_slice(&points).ok()
}
