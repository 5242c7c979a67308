//! Connected parts of a mesh.

use super::TriangleMesh;
use crate::disjoint_sets::DisjointSets;

/// The connected part with the most triangles, with its vertices renumbered; ties go to the first.
pub fn largest_component(mesh: &TriangleMesh) -> TriangleMesh {
    let labels = component_of_triangles(mesh.vertices.len(), &mesh.triangles);
    let mut sizes = vec![0_usize; labels.iter().max().map_or(0, |&label| label as usize + 1)];
    for &label in &labels {
        sizes[label as usize] += 1;
    }
    let Some(largest) = (0..sizes.len()).rev().max_by_key(|&label| sizes[label]) else {
        return TriangleMesh::default();
    };
    let keep = |triangle: usize| labels[triangle] as usize == largest;
    submesh(mesh, keep)
}

/// The number of the connected part each triangle belongs to; parts are numbered as they first appear.
pub fn component_of_triangles(vertex_count: usize, triangles: &[[u32; 3]]) -> Vec<u32> {
    let mut sets = DisjointSets::new(vertex_count);
    for &[a, b, c] in triangles {
        sets.join(a, b);
        sets.join(b, c);
    }
    let mut number_of_root = vec![u32::MAX; vertex_count];
    let mut next = 0;
    triangles
        .iter()
        .map(|&[a, ..]| {
            let number = &mut number_of_root[sets.root(a) as usize];
            if *number == u32::MAX {
                *number = next;
                next += 1;
            }
            *number
        })
        .collect()
}

/// The triangles that `keep` accepts by number, with the vertices they use, in their old order.
pub fn submesh(mesh: &TriangleMesh, keep: impl Fn(usize) -> bool) -> TriangleMesh {
    let mut new_of_old = vec![u32::MAX; mesh.vertices.len()];
    let kept: Vec<[u32; 3]> = (0..mesh.triangles.len())
        .filter(|&triangle| keep(triangle))
        .map(|triangle| mesh.triangles[triangle])
        .collect();
    for &vertex in kept.iter().flatten() {
        new_of_old[vertex as usize] = 0;
    }
    let mut part = TriangleMesh::default();
    for (old, new) in new_of_old
        .iter_mut()
        .enumerate()
        .filter(|(_, new)| **new == 0)
    {
        *new = part.vertices.len() as u32;
        part.vertices.push(mesh.vertices[old]);
        part.normals.extend(mesh.normals.get(old));
        part.colors.extend(mesh.colors.get(old));
    }
    part.triangles = kept
        .iter()
        .map(|corners| corners.map(|vertex| new_of_old[vertex as usize]))
        .collect();
    part
}

#[cfg(test)]
mod tests {
    use glam::{Vec3, vec3};

    use super::super::primitives::sphere;
    use super::*;

    fn two_spheres() -> TriangleMesh {
        let mut small = sphere(Vec3::ZERO, 0.1, 1);
        let big = sphere(vec3(1.0, 0.0, 0.0), 0.2, 2);
        let offset = small.vertices.len() as u32;
        small.vertices.extend(&big.vertices);
        small
            .triangles
            .extend(big.triangles.iter().map(|t| t.map(|v| v + offset)));
        small.compute_normals();
        small
    }

    #[test]
    fn the_larger_of_two_spheres_is_kept_with_its_normals() {
        let kept = largest_component(&two_spheres());
        assert_eq!(kept.triangles.len(), 320);
        assert!(kept.is_watertight());
        assert_eq!(kept.normals.len(), kept.vertices.len());
        assert!(kept.vertices.iter().all(|vertex| vertex.x > 0.7));
    }

    #[test]
    fn nothing_has_no_largest_part() {
        assert_eq!(
            largest_component(&TriangleMesh::default()),
            TriangleMesh::default()
        );
    }
}
