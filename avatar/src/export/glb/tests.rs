//! A GLB seen by a reader of our own: the viewer's single blend gives the driver's pose.

use std::sync::Arc;

use effigy_capture::FrameId;
use effigy_registration::{BodyParams, motion::MotionPose, smpl::BoneTransforms};
use gltf_json::animation::Property;

use super::*;
use crate::{
    bake::BakeConfig,
    drive::{DriveConfig, Driver},
    testing::{everyday_poses, suit_avatar},
};

fn motion() -> Motion {
    let poses = everyday_poses();
    let poses = (0..30)
        .map(|index| {
            let (a, b) = (&poses[index / 15], &poses[index / 15 + 1]);
            let share = (index % 15) as f32 / 15.0;
            MotionPose {
                theta: std::array::from_fn(|joint| a.theta[joint].lerp(b.theta[joint], share)),
                trans: a.trans.lerp(b.trans, share),
            }
        })
        .collect();
    Motion { name: "everyday".to_owned(), rate_hz: 30.0, poses }
}

#[test]
fn one_blend_of_the_zero_pose_mesh_is_the_drivers_pose() {
    let avatar = Arc::new(suit_avatar(0.0));
    let params = everyday_poses()[2];
    let still = DriveConfig { steps: 0, ..DriveConfig::default() };
    let driven = Driver::new(Arc::clone(&avatar), still).pose(&params, FrameId(0));
    let (bones, _) = BoneTransforms::from_pose(&params.theta, &avatar.subject.rest_joints);
    let zero_pose = zero_pose_vertices(&avatar, None);
    for ((vertex, weights), driven) in zero_pose
        .iter()
        .zip(&avatar.topology.skinning)
        .zip(&driven.vertices)
    {
        let viewed = bones.blend(weights).transform_point3(*vertex) + params.trans;
        assert!(viewed.distance(*driven) < 1e-5);
    }
}

#[test]
fn a_glb_has_a_named_skeleton_a_skin_and_the_motion() {
    let avatar = suit_avatar(0.0);
    let motion = motion();
    let colors = vec![[200, 40, 10]; avatar.topology.vertices_in_unit.len()];
    let options = GlbOptions { motion: Some(&motion), colors: Some(&colors), bake: None };
    let bytes = glb_bytes(&avatar, &options).unwrap();
    // `EFFIGY_GLB=file` keeps the file, for a validator or a viewer.
    if let Ok(path) = std::env::var("EFFIGY_GLB") {
        fs::write(path, &bytes).unwrap();
    }
    assert_eq!(&bytes[..4], b"glTF");
    let json_bytes = u32::from_le_bytes(bytes[12..16].try_into().unwrap()) as usize;
    let root = Root::from_slice(&bytes[20..20 + json_bytes]).unwrap();
    assert_eq!(root.skins[0].joints.len(), 24);
    assert_eq!(root.nodes[4].name.as_deref(), Some("left_knee"));
    assert_eq!(root.animations[0].channels.len(), 25);
    assert_eq!(root.meshes[0].primitives[0].attributes.len(), 5);
    assert_eq!(
        bytes.len(),
        u32::from_le_bytes(bytes[8..12].try_into().unwrap()) as usize
    );
}

#[test]
fn morph_targets_mixed_by_their_curves_give_the_driven_mesh() {
    let avatar = Arc::new(suit_avatar(0.012));
    let motion = motion();
    let mut driver = Driver::new(Arc::clone(&avatar), DriveConfig::default());
    let config = BakeConfig { modes: 6, keys_per_sec: 10.0, ..BakeConfig::default() };
    let bake = Bake::of_motion(&mut driver, &motion, &config, &mut |_, _| true)
        .unwrap()
        .unwrap();
    let options = GlbOptions { motion: Some(&motion), bake: Some(&bake), colors: None };
    let bytes = glb_bytes(&avatar, &options).unwrap();
    if let Ok(path) = std::env::var("EFFIGY_GLB") {
        fs::write(path, &bytes).unwrap();
    }
    let json_bytes = u32::from_le_bytes(bytes[12..16].try_into().unwrap()) as usize;
    let root = Root::from_slice(&bytes[20..20 + json_bytes]).unwrap();
    let binary = &bytes[20 + json_bytes + 8..];
    let floats = |accessor: Index<Accessor>| -> Vec<f32> {
        let accessor = &root.accessors[accessor.value()];
        let view = &root.buffer_views[accessor.buffer_view.unwrap().value()];
        let start = view.byte_offset.unwrap().0 as usize;
        let bytes = &binary[start..start + view.byte_length.0 as usize];
        bytes
            .chunks_exact(4)
            .map(|word| f32::from_le_bytes(word.try_into().unwrap()))
            .collect()
    };
    let primitive = &root.meshes[0].primitives[0];
    let targets = primitive.targets.as_ref().unwrap();
    let animation = &root.animations[0];
    let channel = animation.channels.last().unwrap();
    assert_eq!(channel.target.path, Valid(Property::MorphTargetWeights));
    let curves = floats(animation.samplers[channel.sampler.value()].output);
    assert_eq!(curves.len(), targets.len() * bake.key_secs.len());

    // A viewer's own arithmetic, at the last key: base, plus weighted targets, then one blend of bones.
    let weights = &curves[curves.len() - targets.len()..];
    let mut vertices = floats(primitive.attributes[&Valid(Semantic::Positions)]);
    for (target, weight) in targets.iter().zip(weights) {
        let shape = floats(target.positions.unwrap());
        vertices
            .iter_mut()
            .zip(shape)
            .for_each(|(vertex, shape)| *vertex += weight * shape);
    }
    let last = motion.poses.last().unwrap();
    let params = BodyParams { betas: [0.0; 10], theta: last.theta, trans: last.trans };
    let (bones, _) = BoneTransforms::from_pose(&params.theta, &avatar.subject.rest_joints);
    let driven = driver.pose(&params, FrameId(0));
    let still = zero_pose_vertices(&avatar, None);
    let (mut baked_mm, mut still_mm) = (0.0, 0.0);
    for (vertex, place) in vertices.chunks_exact(3).enumerate() {
        let weights = &avatar.topology.skinning[vertex];
        let seen = |place: Vec3| bones.blend(weights).transform_point3(place) + params.trans;
        let off_mm = |place: Vec3| seen(place).distance(driven.vertices[vertex]) * 1e3;
        baked_mm += off_mm(Vec3::from_slice(place));
        still_mm += off_mm(still[vertex]);
    }
    let count = still.len() as f32;
    println!(
        "baked {} mm, still {} mm",
        baked_mm / count,
        still_mm / count
    );
    assert!(still_mm / count > 3.0 && baked_mm / count < 0.2);
}

#[test]
fn a_motion_with_broken_numbers_is_refused_with_its_place() {
    let avatar = suit_avatar(0.0);
    let mut motion = motion();
    motion.poses[7].theta[3].x = f32::NAN;
    let options = GlbOptions { motion: Some(&motion), colors: None, bake: None };
    let error = glb_bytes(&avatar, &options).unwrap_err().to_string();
    assert!(error.contains("\"everyday\": pose 7 of 30"), "{error}");
    let wrong = [[0; 3]; 5];
    let options = GlbOptions { motion: None, colors: Some(&wrong), bake: None };
    assert!(glb_bytes(&avatar, &options).is_err());
}

#[test]
fn weights_are_whole_and_unused_slots_name_bone_zero() {
    let uneven = VertexWeights { bones: [4, 9, 7, 3], weights: [0.3, 0.3, 0.39999, 0.0] };
    let (bones, weights) = influences(&[uneven]);
    assert_eq!(bones[0][3], 0);
    assert!((weights[0].iter().map(|&w| f64::from(w)).sum::<f64>() - 1.0).abs() < 1e-7);
}
