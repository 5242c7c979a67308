//! How good an avatar or a body is: MetaAvatar's measures to the letter, and symmetric ones beside them.

use effigy_fusion::{
    FusionError, TriangleMesh,
    mesh::{closest_point::ClosestPoint, normals::vertex_normals, sample::sample_surface},
};
use effigy_registration::smpl::{JOINT_COUNT, MEASURED_JOINTS, VertexWeights};
use glam::Vec3;
use kiddo::{ImmutableKdTree, SquaredEuclidean};
use serde::{Deserialize, Serialize};

/// MetaAvatar's three measures, as its code computes them: from masked truth vertices to the prediction only.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SurfaceMetrics {
    /// Mean distance to the nearest predicted vertex; depends on how dense the prediction is.
    pub d_p_cm: f32,
    /// Mean distance to the predicted surface.
    pub d_f_cm: f32,
    /// One minus the mean chord between the normals at nearest vertices: in [-1, 1], not a cosine.
    pub nc: f32,
}

/// Which vertices of a surface count: those that its triangles use and whose largest weight is a measured bone's.
pub fn measured_vertices(weights: &[VertexWeights], triangles: &[[u32; 3]]) -> Vec<bool> {
    let mut used = vec![false; weights.len()];
    for &vertex in triangles.iter().flatten() {
        used[vertex as usize] = true;
    }
    let on_measured_bone = weights
        .iter()
        .map(|weights| MEASURED_JOINTS.contains(&weights.main_bone()));
    on_measured_bone
        .zip(used)
        .map(|(on, used)| on && used)
        .collect()
}

/// `D_p`, `D_f` and NC of a prediction; `measured` says which truth vertices count.
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

/// Points that stand for a surface: their mean distance errs by less than a percent.
const SURFACE_SAMPLES: usize = 20_000;

/// Mean distance from points spread evenly over each surface to the other surface, both ways averaged, in mm.
/// Depends on neither mesh's density. NaN if a mesh has no area.
pub fn p2s_mm(a: &TriangleMesh, b: &TriangleMesh) -> Result<f32, FusionError> {
    let points = |mesh: &TriangleMesh| -> Vec<Vec3> {
        sample_surface(mesh, SURFACE_SAMPLES, 0)
            .iter()
            .map(|sample| sample.point)
            .collect()
    };
    let a_to_b = mean_distance_m(&points(a), b)?;
    let b_to_a = mean_distance_m(&points(b), a)?;
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

#[cfg(test)]
mod tests {
    use effigy_fusion::mesh::primitives::sphere;
    use glam::vec3;

    use super::*;

    fn plane(z: f32, cells: u32) -> TriangleMesh {
        let side = cells + 1;
        let vertices = (0..side * side)
            .map(|index| vec3((index % side) as f32, (index / side) as f32, 0.0) / cells as f32)
            .map(|vertex| vertex + z * Vec3::Z)
            .collect();
        let triangles = (0..cells * cells)
            .flat_map(|cell| {
                let at = cell / cells * side + cell % cells;
                [[at, at + 1, at + side + 1], [at, at + side + 1, at + side]]
            })
            .collect();
        TriangleMesh::new(vertices, triangles)
    }

    fn measure(truth: &TriangleMesh, predicted: &TriangleMesh) -> SurfaceMetrics {
        let measured = vec![true; truth.vertices.len()];
        surface_metrics(truth, &measured, predicted)
            .unwrap()
            .unwrap()
    }

    #[test]
    fn identical_meshes_are_at_zero_zero_one() {
        let mesh = sphere(Vec3::ZERO, 0.5, 3);
        assert_eq!(
            measure(&mesh, &mesh),
            SurfaceMetrics { d_p_cm: 0.0, d_f_cm: 0.0, nc: 1.0 }
        );
        // Samples lie on the facets to single precision.
        assert!(p2s_mm(&mesh, &mesh).unwrap() < 1e-3);
    }

    #[test]
    fn opposite_normals_have_a_consistency_of_minus_one() {
        let mesh = sphere(Vec3::ZERO, 0.5, 3);
        let mut turned = mesh.clone();
        turned
            .triangles
            .iter_mut()
            .for_each(|triangle| triangle.swap(0, 1));
        assert!((measure(&mesh, &turned).nc + 1.0).abs() < 1e-6);
    }

    #[test]
    fn a_plane_offset_by_two_centimetres_is_two_centimetres_off() {
        let metrics = measure(&plane(0.0, 8), &plane(0.02, 8));
        assert!((metrics.d_p_cm - 2.0).abs() < 1e-4 && (metrics.d_f_cm - 2.0).abs() < 1e-4);
        assert!((p2s_mm(&plane(0.0, 8), &plane(0.02, 8)).unwrap() - 20.0).abs() < 1e-3);
    }

    #[test]
    fn only_d_p_depends_on_how_dense_the_prediction_is() {
        let truth = plane(0.0, 64);
        let (coarse, fine) = (
            measure(&truth, &plane(0.01, 8)),
            measure(&truth, &plane(0.01, 64)),
        );
        assert!(coarse.d_p_cm > 3.0 * fine.d_p_cm);
        assert!((coarse.d_f_cm - fine.d_f_cm).abs() < 1e-4);
    }

    #[test]
    fn p2s_does_not_depend_on_how_dense_either_mesh_is() {
        let of = |cells| p2s_mm(&plane(0.0, 64), &plane(0.01, cells)).unwrap();
        assert!((of(2) - of(64)).abs() < 1e-3);
        assert!((of(2) - 10.0).abs() < 1e-3);
    }

    #[test]
    fn the_distance_runs_from_the_measured_truth_vertices_only() {
        let (near, mut both) = (sphere(Vec3::ZERO, 0.5, 2), sphere(Vec3::ZERO, 0.5, 2));
        let first = both.vertices.len() as u32;
        let far = sphere(vec3(5.0, 0.0, 0.0), 0.5, 2);
        both.vertices.extend(&far.vertices);
        both.triangles
            .extend(far.triangles.iter().map(|t| t.map(|vertex| vertex + first)));
        // Far prediction: no harm. Far truth: harm, unless it is masked out.
        assert!(measure(&near, &both).d_f_cm < 1e-4);
        assert!(measure(&both, &near).d_f_cm > 100.0);
        let measured: Vec<bool> = (0..both.vertices.len())
            .map(|v| v < first as usize)
            .collect();
        assert!(
            surface_metrics(&both, &measured, &near)
                .unwrap()
                .unwrap()
                .d_f_cm
                < 1e-4
        );
        assert_eq!(surface_metrics(&both, &[], &near).unwrap(), None);
    }

    #[test]
    fn head_hands_and_feet_are_not_measured() {
        let body = effigy_registration::smpl::builtin::body();
        let measured = measured_vertices(&body.skinning, &body.triangles);
        let (mut top, mut tip) = (Vec3::NEG_INFINITY, Vec3::NEG_INFINITY);
        for (vertex, _) in body
            .template
            .iter()
            .zip(&measured)
            .filter(|(_, measured)| **measured)
        {
            top = if vertex.y > top.y { *vertex } else { top };
            tip = if vertex.x > tip.x { *vertex } else { tip };
        }
        let joints = body.joints(&body.template);
        assert!(top.y < joints[15].y + 0.1, "the crown is the head's");
        assert!(
            tip.x < joints[20].x + 0.05,
            "the hand is the wrist's and beyond"
        );
        let share =
            measured.iter().filter(|measured| **measured).count() as f32 / measured.len() as f32;
        assert!((0.2..0.9).contains(&share), "{share}");
    }

    #[test]
    fn joints_and_vertices_are_compared_one_by_one() {
        let truth = [Vec3::ZERO; JOINT_COUNT];
        let mut predicted = truth;
        predicted[3].x = 0.024;
        assert!((mpjpe_mm(&truth, &predicted) - 1.0).abs() < 1e-5);
        assert!(v2v_mm(&truth, &predicted[..3]).is_nan());
    }
}
