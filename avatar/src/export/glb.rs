//! An avatar as binary glTF 2.0: skeleton, skin, zero-pose mesh, and a motion.
//!
//! A viewer blends bones once, `x = (sum w B) x_zero`. The avatar lives in star pose, where the product of
//! two blends would be needed; so the inverse star blend is applied here, and the viewer's pose is exact.

use std::{fs, path::Path};

use effigy_fusion::mesh::normals::vertex_normals;
use effigy_registration::{motion::Motion, smpl::VertexWeights};
use glam::Vec3;
use gltf_json::{
    Accessor, Asset, Extras, Index, Material, Mesh, Node, Root, Scene,
    accessor::{ComponentType, Type},
    buffer::Target,
    material::{PbrBaseColorFactor, PbrMetallicRoughness, StrengthFactor},
    mesh::{Mode, Primitive, Semantic},
    validation::Checked::Valid,
};

use super::{
    buffer::{Bounds, BufferBuilder, Format},
    morph::{push_targets, push_weights},
    skeleton::{push_joints, push_motion, push_skin},
};
use crate::{bake::Bake, error::AvatarError, model::Avatar};

/// What goes into the file beside skeleton, skin and mesh.
#[derive(Clone, Copy, Debug, Default)]
pub struct GlbOptions<'a> {
    pub motion: Option<&'a Motion>,
    /// Clothes that change with the pose, as morph targets with a weight curve each; baked from this motion.
    pub bake: Option<&'a Bake>,
    /// One sRGB colour for each topology vertex.
    pub colors: Option<&'a [[u8; 3]]>,
}

/// Writes the avatar as a GLB file.
pub fn write_glb(
    path: &Path,
    avatar: &Avatar,
    options: &GlbOptions<'_>,
) -> Result<(), AvatarError> {
    let bytes = glb_bytes(avatar, options)?;
    fs::write(path, bytes).map_err(|source| AvatarError::Io { path: path.to_path_buf(), source })
}

/// The avatar as the bytes of a GLB file.
pub fn glb_bytes(avatar: &Avatar, options: &GlbOptions<'_>) -> Result<Vec<u8>, AvatarError> {
    check_mesh(avatar, options.colors)?;
    if let Some(bake) = options.bake {
        check_bake(avatar, bake)?;
    }
    if let Some(motion) = options.motion {
        check_motion(motion)?;
    }
    let mut root = Root { asset: asset(), ..Root::default() };
    let mut buffer = BufferBuilder::new(&mut root);
    let rest_joints = &avatar.subject.rest_joints;
    let joints = push_joints(&mut root, rest_joints);
    let skin = push_skin(&mut root, &mut buffer, &joints, rest_joints);
    let mesh = push_mesh(&mut root, &mut buffer, avatar, options);
    let body = root.push(Node {
        name: Some("avatar".to_owned()),
        mesh: Some(mesh),
        skin: Some(skin),
        ..Node::default()
    });
    if let Some(motion) = options.motion.filter(|motion| !motion.poses.is_empty()) {
        push_motion(&mut root, &mut buffer, &joints, rest_joints, motion);
        if let Some(bake) = options.bake {
            push_weights(&mut root, &mut buffer, body, bake);
        }
    }
    let scene = root.push(Scene {
        name: None,
        nodes: vec![joints[0], body],
        extensions: None,
        extras: Extras::default(),
    });
    root.scene = Some(scene);
    let binary = buffer.finish(&mut root);
    let json = root
        .to_vec()
        .map_err(|error| AvatarError::Export(format!("JSON part: {error}")))?;
    container(json, &binary)
}

fn asset() -> Asset {
    Asset {
        copyright: None,
        generator: Some(concat!("Effigy ", env!("CARGO_PKG_VERSION")).to_owned()),
        min_version: None,
        version: "2.0".to_owned(),
        extensions: None,
        extras: Extras::default(),
    }
}

fn check_mesh(avatar: &Avatar, colors: Option<&[[u8; 3]]>) -> Result<(), AvatarError> {
    let vertices = avatar.topology.vertices_in_unit.len();
    if let Some(colors) = colors.filter(|colors| colors.len() != vertices) {
        let got = colors.len();
        return Err(AvatarError::Export(format!(
            "{got} colours for {vertices} vertices"
        )));
    }
    if avatar.topology.triangles.is_empty() {
        return Err(AvatarError::Export(
            "the avatar has no triangles".to_owned(),
        ));
    }
    Ok(())
}

fn check_motion(motion: &Motion) -> Result<(), AvatarError> {
    let Motion { name, rate_hz, poses } = motion;
    let broken = poses.iter().position(|pose| {
        !pose.trans.is_finite() || pose.theta.iter().any(|angle| !angle.is_finite())
    });
    if let Some(pose) = broken {
        let count = poses.len();
        return Err(AvatarError::Export(format!(
            "motion \"{name}\": pose {pose} of {count} has a number that is not finite"
        )));
    }
    if !(*rate_hz > 0.0 && rate_hz.is_finite()) {
        return Err(AvatarError::Export(format!(
            "motion \"{name}\" has a rate of {rate_hz} Hz; it must be above zero"
        )));
    }
    Ok(())
}

fn check_bake(avatar: &Avatar, bake: &Bake) -> Result<(), AvatarError> {
    let vertices = avatar.topology.vertices_in_unit.len();
    let lengths = std::iter::once(&bake.mean_m)
        .chain(&bake.modes_m)
        .map(Vec::len);
    if let Some(length) = lengths.into_iter().find(|&length| length != vertices) {
        return Err(AvatarError::Export(format!(
            "baked for {length} vertices, the avatar has {vertices}"
        )));
    }
    Ok(())
}

/// Vertices in SMPL's zero pose, where one blend of bones is exact; moved along the topology's normals by so much.
fn zero_pose_vertices(avatar: &Avatar, offsets_m: Option<&[f32]>) -> Vec<Vec3> {
    let unit_box = avatar.subject.unit_box;
    let topology = &avatar.topology;
    let places = topology.vertices_in_unit.iter().zip(&topology.normals);
    places
        .zip(avatar.rest_from_canonical())
        .enumerate()
        .map(|(vertex, ((&place, &normal), rest_from_canonical))| {
            let offset_m = offsets_m.map_or(0.0, |offsets| offsets[vertex]);
            let canonical = unit_box.canonical_from_unit(place) + normal * offset_m;
            rest_from_canonical.transform_point3(canonical)
        })
        .collect()
}

/// A vertex of nothing but degenerate triangles still needs a unit vector.
fn unit_normals(avatar: &Avatar, vertices: &[Vec3]) -> Vec<Vec3> {
    vertex_normals(vertices, &avatar.topology.triangles)
        .iter()
        .map(|normal| normal.try_normalize().unwrap_or(Vec3::Y))
        .collect()
}

fn push_mesh(
    root: &mut Root,
    buffer: &mut BufferBuilder,
    avatar: &Avatar,
    options: &GlbOptions<'_>,
) -> Index<Mesh> {
    let mean_m = options.bake.map(|bake| &bake.mean_m[..]);
    let vertices = zero_pose_vertices(avatar, mean_m);
    let normals = unit_normals(avatar, &vertices);
    let surface = (&vertices[..], &normals[..]);
    let attributes = push_attributes(root, buffer, avatar, surface, options.colors);
    let shapes: Vec<(Vec<Vec3>, Vec<Vec3>)> = options
        .bake
        .map_or(&[][..], |bake| &bake.modes_m[..])
        .iter()
        .map(|mode| {
            let sums = mean_m.into_iter().flatten().zip(mode);
            let offsets_m: Vec<f32> = sums.map(|(mean, shape)| mean + shape).collect();
            let moved = zero_pose_vertices(avatar, Some(&offsets_m));
            let turned = unit_normals(avatar, &moved);
            (moved, turned)
        })
        .collect();
    let targets = push_targets(root, buffer, surface, &shapes);
    let weights = (!targets.is_empty()).then(|| vec![0.0; targets.len()]);
    let triangles = &avatar.topology.triangles;
    let format = Format {
        component: ComponentType::U32,
        shape: Type::Scalar,
        normalized: false,
        target: Some(Target::ElementArrayBuffer),
    };
    let bytes = bytemuck::cast_slice(triangles.as_flattened());
    let indices = buffer.push(root, bytes, 3 * triangles.len(), format);
    let material = push_material(root, options.colors.is_some());
    let primitive = Primitive {
        attributes: attributes
            .into_iter()
            .map(|(semantic, accessor)| (Valid(semantic), accessor))
            .collect(),
        indices: Some(indices),
        material: Some(material),
        mode: Valid(Mode::Triangles),
        targets: (!targets.is_empty()).then_some(targets),
        extensions: None,
        extras: Extras::default(),
    };
    root.push(Mesh {
        name: Some("avatar".to_owned()),
        primitives: vec![primitive],
        weights,
        extensions: None,
        extras: Extras::default(),
    })
}

fn push_attributes(
    root: &mut Root,
    buffer: &mut BufferBuilder,
    avatar: &Avatar,
    (vertices, normals): (&[Vec3], &[Vec3]),
    colors: Option<&[[u8; 3]]>,
) -> Vec<(Semantic, Index<Accessor>)> {
    let normals: Vec<[f32; 3]> = normals.iter().map(Vec3::to_array).collect();
    let positions: Vec<[f32; 3]> = vertices.iter().map(Vec3::to_array).collect();
    let (bones, weights) = influences(&avatar.topology.skinning);
    let vector = Format::floats(Type::Vec3).of_vertices();
    let four = Format::floats(Type::Vec4).of_vertices();
    let bytes = Format { component: ComponentType::U8, ..four };
    let mut attributes = vec![
        (
            Semantic::Positions,
            buffer.push_floats(root, &positions, vector, Bounds::Written),
        ),
        (
            Semantic::Normals,
            buffer.push_floats(root, &normals, vector, Bounds::Left),
        ),
        (
            Semantic::Joints(0),
            buffer.push(root, bones.as_flattened(), bones.len(), bytes),
        ),
        (
            Semantic::Weights(0),
            buffer.push_floats(root, &weights, four, Bounds::Left),
        ),
    ];
    if let Some(colors) = colors {
        let linear: Vec<[u8; 4]> = colors
            .iter()
            .map(|&color| linear_from_srgb(color))
            .collect();
        let format = Format { normalized: true, ..bytes };
        let accessor = buffer.push(root, linear.as_flattened(), linear.len(), format);
        attributes.push((Semantic::Colors(0), accessor));
    }
    attributes
}

/// Matt clay, or white below vertex colours.
fn push_material(root: &mut Root, colored: bool) -> Index<Material> {
    const CLAY: [f32; 4] = [0.62, 0.55, 0.5, 1.0];
    let base = if colored { [1.0; 4] } else { CLAY };
    root.push(Material {
        name: Some("surface".to_owned()),
        pbr_metallic_roughness: PbrMetallicRoughness {
            base_color_factor: PbrBaseColorFactor(base),
            metallic_factor: StrengthFactor(0.0),
            roughness_factor: StrengthFactor(0.85),
            ..PbrMetallicRoughness::default()
        },
        ..Material::default()
    })
}

/// Bones and weights a vertex. The weights sum to one to the last bit that matters to a validator, and
/// unused slots name bone 0.
fn influences(skinning: &[VertexWeights]) -> (Vec<[u8; 4]>, Vec<[f32; 4]>) {
    skinning
        .iter()
        .map(|vertex| {
            let mut weights = vertex.weights;
            weights[0] = 1.0 - (weights[1] + weights[2] + weights[3]);
            let bones = std::array::from_fn(|slot| {
                if weights[slot] == 0.0 {
                    0
                } else {
                    vertex.bones[slot]
                }
            });
            (bones, weights)
        })
        .unzip()
}

/// glTF's vertex colours are linear.
fn linear_from_srgb(color: [u8; 3]) -> [u8; 4] {
    let [r, g, b] = color.map(|channel| {
        let value = f32::from(channel) / 255.0;
        let linear = if value <= 0.04045 {
            value / 12.92
        } else {
            ((value + 0.055) / 1.055).powf(2.4)
        };
        (linear * 255.0).round() as u8
    });
    [r, g, b, 255]
}

/// Header, JSON chunk padded with spaces, binary chunk padded with zeros.
fn container(mut json: Vec<u8>, binary: &[u8]) -> Result<Vec<u8>, AvatarError> {
    json.resize(json.len().next_multiple_of(4), b' ');
    let total = 12 + 8 + json.len() + 8 + binary.len();
    if u32::try_from(total).is_err() {
        return Err(AvatarError::Export(format!(
            "{total} bytes do not fit into a GLB"
        )));
    }
    let length = |bytes: usize| (bytes as u32).to_le_bytes();
    let mut glb = Vec::with_capacity(total);
    glb.extend(b"glTF");
    glb.extend(2_u32.to_le_bytes());
    glb.extend(length(total));
    for (kind, chunk) in [(b"JSON", &json[..]), (b"BIN\0", binary)] {
        glb.extend(length(chunk.len()));
        glb.extend(kind);
        glb.extend(chunk);
    }
    Ok(glb)
}

#[cfg(test)]
mod tests;
