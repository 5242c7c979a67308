//! Vertex normals from the triangles around them.

use glam::Vec3;

use super::TriangleMesh;

impl TriangleMesh {
    /// Fills `normals`: each is the mean of the adjacent triangles' normals, weighted by their area.
    pub fn compute_normals(&mut self) {
        vertex_normals_into(&self.vertices, &self.triangles, &mut self.normals);
    }
}

/// Area-weighted unit normals; zero for a vertex without a triangle.
pub fn vertex_normals(vertices: &[Vec3], triangles: &[[u32; 3]]) -> Vec<Vec3> {
    let mut normals = Vec::new();
    vertex_normals_into(vertices, triangles, &mut normals);
    normals
}

/// As [`vertex_normals`], into a buffer that is kept from frame to frame.
pub fn vertex_normals_into(vertices: &[Vec3], triangles: &[[u32; 3]], normals: &mut Vec<Vec3>) {
    normals.clear();
    normals.resize(vertices.len(), Vec3::ZERO);
    for &[a, b, c] in triangles {
        // The cross product's length is twice the area, which is the weight wanted.
        let doubled = doubled_area_normal(
            vertices[a as usize],
            vertices[b as usize],
            vertices[c as usize],
        );
        for vertex in [a, b, c] {
            normals[vertex as usize] += doubled;
        }
    }
    for normal in normals {
        *normal = normal.normalize_or_zero();
    }
}

/// Perpendicular to the triangle, twice its area long.
pub fn doubled_area_normal(a: Vec3, b: Vec3, c: Vec3) -> Vec3 {
    (b - a).cross(c - a)
}

#[cfg(test)]
mod tests {
    use glam::vec3;

    use super::super::primitives::sphere;

    #[test]
    fn normals_of_a_sphere_point_away_from_its_centre() {
        let center = vec3(0.3, -0.2, 1.0);
        let mut mesh = sphere(center, 0.5, 4);
        mesh.compute_normals();
        for (vertex, normal) in mesh.vertices.iter().zip(&mesh.normals) {
            // The facets of this sphere span 4 degrees; their mean is far closer to the radius.
            assert!(normal.dot((vertex - center) / 0.5) > 0.999);
        }
    }

    #[test]
    fn a_vertex_without_triangles_has_a_zero_normal() {
        let mut mesh = sphere(glam::Vec3::ZERO, 1.0, 0);
        mesh.vertices.push(glam::Vec3::ONE);
        mesh.compute_normals();
        assert_eq!(mesh.normals.last(), Some(&glam::Vec3::ZERO));
    }
}
