//! The skin of a glTF character as its file binds it: vertices, bones and shares.

use std::collections::BTreeMap;

use glam::{Affine3A, Mat4, Vec3};
use gltf_json::{
    mesh::{Mode, Semantic},
    validation::Checked,
};

use super::document::Document;
use crate::error::SimError;

/// More than any character has.
const MAX_VERTICES: usize = 1 << 20;
/// Closed surfaces have two triangles a vertex.
const MAX_TRIANGLES: usize = 4 * MAX_VERTICES;

/// Vertices as the file binds them.
#[derive(Clone, Debug, Default)]
pub(super) struct Skin {
    pub(super) vertices: Vec<Vec3>,
    /// Numbers of bones in `bones`, and their shares.
    pub(super) shares: Vec<[(u16, f32); 4]>,
    /// Node and inverse bind matrix.
    pub(super) bones: Vec<(usize, Mat4)>,
}

impl Skin {
    pub(super) fn posed(&self, globals: &[Affine3A]) -> Vec<Vec3> {
        let bones: Vec<Affine3A> = self
            .bones
            .iter()
            .map(|&(node, inverse_bind)| globals[node] * Affine3A::from_mat4(inverse_bind))
            .collect();
        let posed = |(vertex, shares): (&Vec3, &[(u16, f32); 4])| {
            let moved = |&(bone, share): &(u16, f32)| {
                bones[bone as usize].transform_point3(*vertex) * share
            };
            shares.iter().map(moved).sum()
        };
        self.vertices.iter().zip(&self.shares).map(posed).collect()
    }
}

/// All skinned meshes of a file as one, vertices that coincide merged.
pub(super) fn skin(document: &Document) -> Result<(Skin, Vec<[u32; 3]>), SimError> {
    let mut skin = Skin::default();
    let mut triangles = Vec::new();
    let mut known: BTreeMap<[u32; 3], u32> = BTreeMap::new();
    for node in &document.root.nodes {
        let (Some(mesh), Some(number)) = (node.mesh, node.skin) else {
            continue;
        };
        let mesh = document.root.meshes.get(mesh.value());
        let mesh = mesh.ok_or_else(|| document.wrong("a mesh for each node", "none such"))?;
        let first_bone = skin.bones.len();
        read_bones(document, number.value(), &mut skin)?;
        for primitive in &mesh.primitives {
            if primitive.mode == Checked::Valid(Mode::Triangles) {
                let merged =
                    read_primitive(document, primitive, first_bone, (&mut skin, &mut known))?;
                add_triangles(document, primitive, &merged, &mut triangles)?;
            }
        }
    }
    if triangles.is_empty() {
        let found = format!(
            "{} meshes and {} skins, none of them on one node",
            document.root.meshes.len(),
            document.root.skins.len()
        );
        return Err(document.wrong(
            "a mesh with a skin, a character whose bones move it; export it together with its armature",
            &found,
        ));
    }
    Ok((skin, triangles))
}

fn read_bones(document: &Document, number: usize, skin: &mut Skin) -> Result<(), SimError> {
    let found = document.root.skins.get(number);
    let found = found.ok_or_else(|| document.wrong("a skin for each skinned mesh", "none such"))?;
    let inverse_binds = match found.inverse_bind_matrices {
        Some(accessor) => document.numbers::<16>(accessor.value())?,
        None => vec![Mat4::IDENTITY.to_cols_array(); found.joints.len()],
    };
    let nodes = document.root.nodes.len();
    let whole = !found.joints.is_empty()
        && inverse_binds.len() >= found.joints.len()
        && found.joints.iter().all(|joint| joint.value() < nodes)
        && u16::try_from(skin.bones.len() + found.joints.len()).is_ok();
    if !whole {
        let counts = format!(
            "{} joints, {} matrices",
            found.joints.len(),
            inverse_binds.len()
        );
        return Err(document.wrong("a skin with joints, and a bind matrix for each", &counts));
    }
    for (joint, matrix) in found.joints.iter().zip(&inverse_binds) {
        skin.bones
            .push((joint.value(), Mat4::from_cols_array(matrix)));
    }
    Ok(())
}

/// Adds a primitive's vertices; returns the number each of them has now.
fn read_primitive(
    document: &Document,
    primitive: &gltf_json::mesh::Primitive,
    first_bone: usize,
    (skin, known): (&mut Skin, &mut BTreeMap<[u32; 3], u32>),
) -> Result<Vec<u32>, SimError> {
    let attribute = |semantic: Semantic, what: &str| {
        let found = primitive.attributes.get(&Checked::Valid(semantic));
        found.map(gltf_json::Index::value).ok_or_else(|| {
            document.wrong(&format!("{what} in each part of the skinned mesh"), "none")
        })
    };
    let positions = document.numbers::<3>(attribute(Semantic::Positions, "POSITION")?)?;
    let joints = document.numbers::<4>(attribute(Semantic::Joints(0), "JOINTS_0")?)?;
    let weights = document.numbers::<4>(attribute(Semantic::Weights(0), "WEIGHTS_0")?)?;
    if joints.len() != positions.len() || weights.len() != positions.len() {
        let found = format!("{}, {}, {}", positions.len(), joints.len(), weights.len());
        return Err(document.wrong("as many joints and weights as positions", &found));
    }
    if skin.vertices.len() + positions.len() > MAX_VERTICES {
        return Err(document.wrong(&format!("at most {MAX_VERTICES} vertices"), "more"));
    }
    let bones = skin.bones.len() - first_bone;
    let mut merged = Vec::with_capacity(positions.len());
    for ((position, joints), weights) in positions.iter().zip(&joints).zip(&weights) {
        if joints
            .iter()
            .zip(weights)
            .any(|(&j, &w)| w > 0.0 && j as usize >= bones)
        {
            return Err(document.wrong(&format!("joints below {bones}"), &format!("{joints:?}")));
        }
        let key = position.map(|x| (x + 0.0).to_bits());
        let vertex = *known.entry(key).or_insert_with(|| {
            let sum: f32 = weights.iter().sum();
            let share = |k: usize| {
                let bone = (joints[k] as usize).min(bones.saturating_sub(1)) + first_bone;
                (
                    bone as u16,
                    if sum > 0.0 {
                        weights[k] / sum
                    } else {
                        f32::from(u8::from(k == 0))
                    },
                )
            };
            skin.vertices.push(Vec3::from(*position));
            skin.shares.push(std::array::from_fn(share));
            skin.vertices.len() as u32 - 1
        });
        merged.push(vertex);
    }
    Ok(merged)
}

fn add_triangles(
    document: &Document,
    primitive: &gltf_json::mesh::Primitive,
    merged: &[u32],
    triangles: &mut Vec<[u32; 3]>,
) -> Result<(), SimError> {
    let indices: Vec<usize> = match primitive.indices {
        Some(accessor) => document
            .numbers::<1>(accessor.value())?
            .into_iter()
            .map(|[i]| i as usize)
            .collect(),
        None => (0..merged.len()).collect(),
    };
    if triangles.len() + indices.len() / 3 > MAX_TRIANGLES {
        let expected = format!("at most {MAX_TRIANGLES} triangles");
        return Err(document.wrong(&expected, "more"));
    }
    for corners in indices.chunks_exact(3) {
        let corner = |k: usize| merged.get(corners[k]).copied();
        let (Some(a), Some(b), Some(c)) = (corner(0), corner(1), corner(2)) else {
            let found = format!("{corners:?} of {} vertices", merged.len());
            return Err(document.wrong("triangles between vertices that exist", &found));
        };
        if a != b && b != c && c != a {
            triangles.push([a, b, c]);
        }
    }
    Ok(())
}
