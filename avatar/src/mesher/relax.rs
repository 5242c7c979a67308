//! Evening out an extracted mesh without leaving the surface.

use effigy_fusion::{TriangleMesh, mesh::normals::vertex_normals_into};
use glam::Vec3;

use crate::{neighbors::Neighbors, sdf::SignedDistanceField};

/// How far a vertex moves towards its neighbours' mean in one round.
const TOWARDS_MEAN: f32 = 0.5;
/// Steps back onto the surface at the end; two leave less than a thousandth of a cell.
const LAST_STEPS: usize = 2;

/// Marching cubes leaves slivers: moves each vertex along the surface towards its neighbours' mean, then
/// back onto the zero level, `rounds` times. Normals become the field's own.
pub fn relax(mesh: &mut TriangleMesh, sdf: &dyn SignedDistanceField, rounds: usize) {
    let neighbors = Neighbors::new(mesh.vertices.len(), &mesh.triangles);
    let longest = 0.5 * neighbors.mean_edge(&mesh.vertices);
    let mut field = FieldAt::new(mesh.vertices.len());
    for _ in 0..rounds {
        vertex_normals_into(&mesh.vertices, &mesh.triangles, &mut mesh.normals);
        mesh.vertices = slide(&mesh.vertices, &mesh.normals, &neighbors);
        field.step_onto_surface(sdf, &mut mesh.vertices, longest);
    }
    for _ in 0..LAST_STEPS {
        field.step_onto_surface(sdf, &mut mesh.vertices, longest);
    }
    vertex_normals_into(&mesh.vertices, &mesh.triangles, &mut mesh.normals);
    field.improve_normals(sdf, mesh);
}

fn slide(vertices: &[Vec3], normals: &[Vec3], neighbors: &Neighbors) -> Vec<Vec3> {
    (0..vertices.len())
        .map(|vertex| {
            let around = neighbors.of(vertex);
            let here = vertices[vertex];
            if around.is_empty() {
                return here;
            }
            let sum: Vec3 = around.iter().map(|&other| vertices[other as usize]).sum();
            let towards = (sum / around.len() as f32 - here) * TOWARDS_MEAN;
            here + towards - normals[vertex] * towards.dot(normals[vertex])
        })
        .collect()
}

/// Buffers for the field's values and gradients at a mesh's vertices.
pub(crate) struct FieldAt {
    values: Vec<f32>,
    gradients: Vec<Vec3>,
}

impl FieldAt {
    pub(crate) fn new(count: usize) -> Self {
        Self { values: vec![0.0; count], gradients: vec![Vec3::ZERO; count] }
    }

    /// The values at no more points than there are vertices.
    pub(crate) fn values(&mut self, sdf: &dyn SignedDistanceField, points: &[Vec3]) -> &[f32] {
        let values = &mut self.values[..points.len()];
        sdf.values(points, values);
        values
    }

    pub(crate) fn gradients(&mut self, sdf: &dyn SignedDistanceField, points: &[Vec3]) -> &[Vec3] {
        sdf.values_and_gradients(points, &mut self.values, &mut self.gradients);
        &self.gradients
    }

    /// One Newton step `x -= f grad / |grad|^2`, no longer than `longest`.
    pub(crate) fn step_onto_surface(
        &mut self,
        sdf: &dyn SignedDistanceField,
        points: &mut [Vec3],
        longest: f32,
    ) {
        sdf.values_and_gradients(points, &mut self.values, &mut self.gradients);
        for ((point, &value), &gradient) in points.iter_mut().zip(&self.values).zip(&self.gradients)
        {
            let squared = gradient.length_squared();
            if squared > MIN_SQUARED_GRADIENT && value.is_finite() {
                *point -= (gradient * (value / squared)).clamp_length_max(longest);
            }
        }
    }

    /// The field's gradient where it agrees with the mesh; elsewhere the mesh's normal stays.
    fn improve_normals(&mut self, sdf: &dyn SignedDistanceField, mesh: &mut TriangleMesh) {
        let gradients = self.gradients(sdf, &mesh.vertices);
        for (normal, gradient) in mesh.normals.iter_mut().zip(gradients) {
            let from_field = gradient.normalize_or_zero();
            if from_field.dot(*normal) > 0.5 {
                *normal = from_field;
            }
        }
    }
}

/// Flatter than a tenth of a distance field, a step would go anywhere.
const MIN_SQUARED_GRADIENT: f32 = 0.01;
