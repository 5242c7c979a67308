//! Baked shapes as morph targets, and the curves of their weights.

use glam::Vec3;
use gltf_json::{Index, Node, Root, accessor::Type, animation::Property, mesh::MorphTarget};

use super::{
    buffer::{Bounds, BufferBuilder, Format},
    skeleton::push_channel,
};
use crate::bake::Bake;

/// Adds what each shape (vertices and normals at weight one) differs by from the mesh's surface.
pub(super) fn push_targets(
    root: &mut Root,
    buffer: &mut BufferBuilder,
    (vertices, normals): (&[Vec3], &[Vec3]),
    shapes: &[(Vec<Vec3>, Vec<Vec3>)],
) -> Vec<MorphTarget> {
    let vector = Format::floats(Type::Vec3).of_vertices();
    let mut push = |to: &[Vec3], from: &[Vec3], bounds: Bounds| {
        let pairs = to.iter().zip(from);
        let rows: Vec<[f32; 3]> = pairs.map(|(to, from)| (to - from).to_array()).collect();
        Some(buffer.push_floats(root, &rows, vector, bounds))
    };
    shapes
        .iter()
        .map(|(moved, turned)| MorphTarget {
            positions: push(moved, vertices, Bounds::Written),
            normals: push(turned, normals, Bounds::Left),
            tangents: None,
        })
        .collect()
}

/// Adds the curves of the weights to the file's animation.
pub(super) fn push_weights(
    root: &mut Root,
    buffer: &mut BufferBuilder,
    body: Index<Node>,
    bake: &Bake,
) {
    if bake.modes_m.is_empty() {
        return;
    }
    let scalar = Format::floats(Type::Scalar);
    let times: Vec<[f32; 1]> = bake.key_secs.iter().map(|&secs| [secs]).collect();
    let weights: Vec<[f32; 1]> = bake
        .weights
        .iter()
        .flatten()
        .map(|&weight| [weight])
        .collect();
    let input = buffer.push_floats(root, &times, scalar, Bounds::Written);
    let output = buffer.push_floats(root, &weights, scalar, Bounds::Left);
    if let Some(animation) = root.animations.last_mut() {
        push_channel(animation, input, output, body, Property::MorphTargetWeights);
    }
}
