//! The avatar's surface as offsets of the body's vertices: what a tracker can follow.

use effigy_fusion::mesh::normals::vertex_normals;
use effigy_registration::BodyModel;
use glam::Vec3;

use super::{oriented_bvh::OrientedBvh, star_body};
use crate::Avatar;

/// A surface that faces the other way counts as this much farther.
const OPPOSED_M: f32 = 0.2;
/// Whatever is farther off than this belongs to something else: a hem beside a bare leg.
const FARTHEST_M: f32 = 0.15;

/// For each of the body's vertices how far the avatar's surface, in the pose its mesh was made in, is from it in canonical
/// space, in metres: to the nearest point that faces the same way, zero where none is near.
pub fn offsets_from_body(avatar: &Avatar, body: &BodyModel) -> Vec<Vec3> {
    let topology = &avatar.topology;
    let surface: Vec<Vec3> = topology
        .vertices_in_unit
        .iter()
        .map(|&vertex| avatar.subject.unit_box.canonical_from_unit(vertex))
        .collect();
    let bvh = OrientedBvh::new(&surface, &topology.normals, &topology.triangles);
    let skin = star_body(body, &avatar.subject.betas);
    let normals = vertex_normals(&skin, &body.triangles);
    skin.iter()
        .zip(&normals)
        .map(|(&vertex, &normal)| {
            let hit = bvh.closest(vertex, normal, OPPOSED_M);
            // From the surface to the vertex, turned round. Nowhere is not near.
            if hit.distance_m < FARTHEST_M {
                -hit.offset
            } else {
                Vec3::ZERO
            }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use effigy_registration::smpl::{JOINT_COUNT, VertexWeights, builtin};

    use super::*;
    use crate::{PoseField, PoseInput, SignedDistanceField, Subject, model::Topology};

    /// Nobody asks it anything.
    struct NoField;

    impl PoseField for NoField {
        fn field(&self, _pose: &PoseInput) -> Box<dyn SignedDistanceField> {
            unreachable!("offsets come from the mesh")
        }

        fn kind(&self) -> &'static str {
            "none"
        }

        fn to_bytes(&self) -> Vec<u8> {
            Vec::new()
        }
    }

    #[test]
    fn a_body_one_centimetre_thicker_is_one_centimetre_off() {
        let body = builtin::body();
        let subject = Subject::new(&body, &[0.0; 10]).unwrap();
        let skin = star_body(&body, &subject.betas);
        let normals = vertex_normals(&skin, &body.triangles);
        let thicker = skin
            .iter()
            .zip(&normals)
            .map(|(vertex, normal)| *vertex + 0.01 * *normal);
        let topology = Topology {
            vertices_in_unit: thicker
                .map(|v| subject.unit_box.unit_from_canonical(v))
                .collect(),
            normals: normals.clone(),
            triangles: Arc::new(body.triangles.clone()),
            skinning: vec![VertexWeights::default(); skin.len()],
        };
        let avatar = Avatar {
            subject,
            field: Arc::new(NoField),
            topology_theta: [Vec3::ZERO; JOINT_COUNT],
            topology,
        };
        let offsets = offsets_from_body(&avatar, &body);
        // Between fingers and toes another part may be nearer.
        let right = offsets
            .iter()
            .filter(|offset| (offset.length() - 0.01).abs() < 2e-3)
            .count();
        let share = right as f32 / offsets.len() as f32;
        assert!(share > 0.9, "{share}");
    }
}
