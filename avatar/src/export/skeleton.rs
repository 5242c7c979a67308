//! The 24 joints as nodes, the skin that binds a mesh to them, and a motion that moves them.

use effigy_registration::{
    motion::Motion,
    smpl::{JOINT_COUNT, JOINT_NAMES, PARENTS},
};
use glam::{Quat, Vec3};
use gltf_json::{
    Accessor, Animation, Extras, Index, Node, Root, Skin,
    accessor::Type,
    animation::{Channel, Interpolation, Property, Sampler, Target},
    validation::Checked::Valid,
};

use super::buffer::{Bounds, BufferBuilder, Format};

/// Adds a node for each joint, in the zero pose.
pub(super) fn push_joints(root: &mut Root, rest_joints: &[Vec3; JOINT_COUNT]) -> Vec<Index<Node>> {
    // All joints are pushed in a row, so a joint's index is the first one's plus its number.
    let first = root.nodes.len();
    let index = |joint: usize| Index::new((first + joint) as u32);
    (0..JOINT_COUNT)
        .map(|joint| {
            let children: Vec<Index<Node>> = (1..JOINT_COUNT)
                .filter(|&child| PARENTS[child] == joint)
                .map(index)
                .collect();
            root.push(Node {
                name: Some(JOINT_NAMES[joint].to_owned()),
                children: (!children.is_empty()).then_some(children),
                translation: Some(offset(joint, rest_joints).to_array()),
                ..Node::default()
            })
        })
        .collect()
}

/// Adds the skin: each inverse bind matrix undoes the joint's zero-pose translation.
pub(super) fn push_skin(
    root: &mut Root,
    buffer: &mut BufferBuilder,
    joints: &[Index<Node>],
    rest_joints: &[Vec3; JOINT_COUNT],
) -> Index<Skin> {
    let matrices = rest_joints.map(|joint| glam::Mat4::from_translation(-joint).to_cols_array());
    let inverse_bind =
        buffer.push_floats(root, &matrices, Format::floats(Type::Mat4), Bounds::Left);
    root.push(Skin {
        inverse_bind_matrices: Some(inverse_bind),
        joints: joints.to_vec(),
        name: Some("body".to_owned()),
        skeleton: Some(joints[0]),
        extensions: None,
        extras: Extras::default(),
    })
}

/// Adds a motion: a rotation channel for each joint, and a translation for the root.
pub(super) fn push_motion(
    root: &mut Root,
    buffer: &mut BufferBuilder,
    joints: &[Index<Node>],
    rest_joints: &[Vec3; JOINT_COUNT],
    motion: &Motion,
) {
    let times: Vec<[f32; 1]> = (0..motion.poses.len())
        .map(|pose| [pose as f32 / motion.rate_hz])
        .collect();
    let input = buffer.push_floats(root, &times, Format::floats(Type::Scalar), Bounds::Written);
    let mut animation = Animation {
        name: Some(motion.name.clone()),
        channels: Vec::new(),
        samplers: Vec::new(),
        extensions: None,
        extras: Extras::default(),
    };
    for (joint, &node) in joints.iter().enumerate() {
        let format = Format::floats(Type::Vec4);
        let rotations = rotations(motion, joint);
        let output = buffer.push_floats(root, &rotations, format, Bounds::Left);
        push_channel(&mut animation, input, output, node, Property::Rotation);
    }
    let translations: Vec<[f32; 3]> = motion
        .poses
        .iter()
        .map(|pose| (rest_joints[0] + pose.trans).to_array())
        .collect();
    let output = buffer.push_floats(
        root,
        &translations,
        Format::floats(Type::Vec3),
        Bounds::Left,
    );
    push_channel(
        &mut animation,
        input,
        output,
        joints[0],
        Property::Translation,
    );
    root.push(animation);
}

pub(super) fn push_channel(
    animation: &mut Animation,
    input: Index<Accessor>,
    output: Index<Accessor>,
    node: Index<Node>,
    path: Property,
) {
    let sampler = Index::push(
        &mut animation.samplers,
        Sampler {
            input,
            interpolation: Valid(Interpolation::Linear),
            output,
            extensions: None,
            extras: Extras::default(),
        },
    );
    let target = Target { node, path: Valid(path), extensions: None, extras: Extras::default() };
    animation.channels.push(Channel {
        sampler,
        target,
        extensions: None,
        extras: Extras::default(),
    });
}

/// Unit quaternions of one joint; of the two for each rotation, the one nearer to the pose before.
fn rotations(motion: &Motion, joint: usize) -> Vec<[f32; 4]> {
    let mut before = Quat::IDENTITY;
    motion
        .poses
        .iter()
        .map(|pose| {
            let rotation = Quat::from_scaled_axis(pose.theta[joint]).normalize();
            before = if rotation.dot(before) < 0.0 {
                -rotation
            } else {
                rotation
            };
            before.to_array()
        })
        .collect()
}

/// From the parent to the joint, in the zero pose.
fn offset(joint: usize, rest_joints: &[Vec3; JOINT_COUNT]) -> Vec3 {
    if joint == 0 {
        rest_joints[0]
    } else {
        rest_joints[joint] - rest_joints[PARENTS[joint]]
    }
}
