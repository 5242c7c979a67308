//! The body's surface as tracking sees it: a few thousand of the model's vertices, evenly spread.
//!
//! A [`Surface`] is chosen once for a model, [`ShapedSurface`] once for each set of betas, and
//! [`PosedSurface`] anew for each pose the solver tries.

mod decimate;
mod legs;
mod posed;
mod shaped;

pub(crate) use legs::LegStation;
pub(crate) use posed::PosedSurface;
pub(crate) use shaped::ShapedSurface;

use std::sync::Arc;

use glam::Vec3;

use self::legs::leg_stations;
use crate::smpl::{BodyModel, JOINT_COUNT, PARENTS, PoseDirection, VertexWeights};

/// A coarse stand-in for a body model's surface that keeps its vertices' own shape, pose and skinning data.
#[derive(Clone, Debug)]
pub(crate) struct Surface {
    pub(crate) model: Arc<BodyModel>,
    /// The model's vertex behind each of ours.
    pub(crate) vertices: Vec<u32>,
    pub(crate) triangles: Vec<[u32; 3]>,
    pub(crate) skinning: Vec<VertexWeights>,
    /// For each vertex the joints that move it.
    pub(crate) influences: Vec<Influences>,
    pub(crate) pose_dirs: Vec<PoseDirection>,
    /// For each vertex the share of it that clothes cover on most people: all but head, hands and feet.
    pub(crate) clothed: Vec<f32>,
    /// For each vertex the part of the body it is on: clothes are not equally thick everywhere.
    pub(crate) region: Vec<Region>,
    /// For each vertex 1 where most people have hair, else 0.
    pub(crate) hairy: Vec<f32>,
    /// For each vertex whether clothes span a hollow there instead of following the skin.
    pub(crate) spanned: Vec<bool>,
    /// Places down the legs, to keep one out of the other.
    pub(crate) legs: Vec<LegStation>,
}

/// Neck, head, wrists, hands, ankles and feet.
const BARE_BONES: [u8; 10] = [7, 8, 10, 11, 12, 15, 20, 21, 22, 23];

fn clothed_share(weights: &VertexWeights) -> f32 {
    let bones = weights.bones.iter().zip(&weights.weights);
    bones
        .filter(|(bone, _)| !BARE_BONES.contains(bone))
        .map(|(_, weight)| weight)
        .sum()
}

/// A part of the body with clothes of its own; hands and feet go with the limb, the head with the trunk.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Region {
    Trunk,
    UpperArms,
    Forearms,
    Thighs,
    Shins,
}

pub(crate) const REGION_COUNT: usize = Region::Shins as usize + 1;

impl Region {
    fn of(weights: &VertexWeights) -> Self {
        match weights.main_bone() {
            16 | 17 => Self::UpperArms,
            18..=23 => Self::Forearms,
            1 | 2 => Self::Thighs,
            4 | 5 | 7 | 8 | 10 | 11 => Self::Shins,
            _ => Self::Trunk,
        }
    }
}

/// 1 on the crown and the back of the head, else 0.
fn hairy(model: &BodyModel, vertices: &[u32], skinning: &[VertexWeights]) -> Vec<f32> {
    const HEAD: u8 = 15;
    /// Of the way from the head's joint to the crown: where the forehead ends, and where the neck does.
    const FOREHEAD: f32 = 0.7;
    const NAPE: f32 = 0.2;
    let joint = model.joints(&model.template)[HEAD as usize];
    let crown_y = model.template.iter().map(|v| v.y).fold(f32::MIN, f32::max);
    let has_hair = |(&vertex, weights): (&u32, &VertexWeights)| {
        let bones = weights.bones.iter().zip(&weights.weights);
        let on_head: f32 = bones
            .filter(|(bone, _)| **bone == HEAD)
            .map(|(_, weight)| weight)
            .sum();
        let place = model.template[vertex as usize];
        let up = (place.y - joint.y) / (crown_y - joint.y);
        on_head > 0.8 && (up > FOREHEAD || (up > NAPE && place.z < joint.z))
    };
    vertices
        .iter()
        .zip(skinning)
        .map(|v| f32::from(u8::from(has_hair(v))))
        .collect()
}

/// At the crotch and on the inner sides of the thighs: trousers hang there, and without this pulled hips down by 2 cm.
fn spanned(model: &BodyModel, vertices: &[u32], skinning: &[VertexWeights]) -> Vec<bool> {
    const HIPS: [u8; 3] = [0, 1, 2];
    /// Of the way from hip to knee.
    const DOWN: f32 = 0.6;
    /// How far a normal has to point down or to the other leg.
    const TURNED: f32 = 0.15;
    let joints = model.joints(&model.template);
    let normals = vertex_normals(&model.template, &model.triangles);
    let (top_y, bottom_y) = (joints[1].y, joints[1].lerp(joints[4], DOWN).y);
    let is_spanned = |(&vertex, weights): (&u32, &VertexWeights)| {
        let (place, normal) = (model.template[vertex as usize], normals[vertex as usize]);
        let inwards = -normal.x * place.x.signum();
        HIPS.contains(&weights.main_bone())
            && (bottom_y..top_y).contains(&place.y)
            && (inwards > TURNED || normal.y < -TURNED)
    };
    vertices.iter().zip(skinning).map(is_spanned).collect()
}

/// The joints that move a vertex, in ascending order, each with a mask of the vertex's bones it carries.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Influences {
    pub(crate) count: u8,
    pub(crate) joints: [u8; MAX_INFLUENCES],
    pub(crate) bone_masks: [u8; MAX_INFLUENCES],
}

/// Four bones with all their ancestors share the trunk, so they never come to more.
pub(crate) const MAX_INFLUENCES: usize = JOINT_COUNT;

impl Surface {
    /// Spreads `vertex_count` vertices evenly over the model's template.
    pub(crate) fn new(model: Arc<BodyModel>, vertex_count: usize) -> Self {
        let coarse = decimate::decimate(&model.template, &model.triangles, vertex_count);
        let skinning: Vec<VertexWeights> = coarse
            .vertices
            .iter()
            .map(|&v| model.skinning[v as usize])
            .collect();
        let clothed = skinning.iter().map(clothed_share).collect();
        let region = skinning.iter().map(Region::of).collect();
        let hairy = hairy(&model, &coarse.vertices, &skinning);
        let influences = skinning.iter().map(Influences::new).collect();
        let pose_dirs = restrict(&model.pose_dirs, &coarse.vertices, model.vertex_count());
        let spanned = spanned(&model, &coarse.vertices, &skinning);
        let legs = leg_stations(&model, &coarse.vertices, &skinning);
        Self {
            vertices: coarse.vertices,
            clothed,
            region,
            hairy,
            spanned,
            legs,
            triangles: coarse.triangles,
            skinning,
            influences,
            pose_dirs,
            model,
        }
    }

    /// The bone that carries most of a vertex.
    pub(crate) fn main_bone(&self, vertex: usize) -> usize {
        usize::from(self.skinning[vertex].main_bone())
    }
}

impl Influences {
    fn new(weights: &VertexWeights) -> Self {
        let mut masks = [0_u8; JOINT_COUNT];
        for slot in 0..4 {
            if weights.weights[slot] <= 0.0 {
                continue;
            }
            let mut joint = weights.bones[slot] as usize;
            loop {
                masks[joint] |= 1 << slot;
                if joint == 0 {
                    break;
                }
                joint = PARENTS[joint];
            }
        }
        let mut influences = Self::default();
        for (joint, &mask) in masks.iter().enumerate().filter(|(_, mask)| **mask != 0) {
            let next = influences.count as usize;
            influences.joints[next] = joint as u8;
            influences.bone_masks[next] = mask;
            influences.count += 1;
        }
        influences
    }
}

/// The pose directions of the chosen vertices only.
fn restrict(
    directions: &[PoseDirection],
    chosen: &[u32],
    vertex_count: usize,
) -> Vec<PoseDirection> {
    let mut ours = vec![u32::MAX; vertex_count];
    for (i, &vertex) in chosen.iter().enumerate() {
        ours[vertex as usize] = i as u32;
    }
    /// Offsets below this move nothing visibly: a hundredth of a millimetre a unit.
    const NEGLIGIBLE_M: f32 = 1e-5;
    directions
        .iter()
        .map(|direction| {
            let mut kept = PoseDirection::default();
            for (&vertex, &offset) in direction.vertices.iter().zip(&direction.offsets) {
                let index = ours[vertex as usize];
                if index != u32::MAX && offset.length_squared() > NEGLIGIBLE_M * NEGLIGIBLE_M {
                    kept.vertices.push(index);
                    kept.offsets.push(offset);
                }
            }
            kept
        })
        .collect()
}

/// Area-weighted vertex normals; zero where a vertex has no triangles.
pub(crate) fn vertex_normals(vertices: &[Vec3], triangles: &[[u32; 3]]) -> Vec<Vec3> {
    let mut normals = vec![Vec3::ZERO; vertices.len()];
    for triangle in triangles {
        let [a, b, c] = triangle.map(|i| vertices[i as usize]);
        let area_normal = (b - a).cross(c - a);
        for &i in triangle {
            normals[i as usize] += area_normal;
        }
    }
    normals.iter().map(|n| n.normalize_or_zero()).collect()
}
