//! A skinned glTF character, made to stand where people of ours stand: metres, y up, facing +z, joints under SMPL's
//! names.

use std::path::Path;

use effigy_fusion::mesh::TriangleMesh;
use effigy_registration::{
    motion::{JointMap, RestBody, limb_alignments},
    smpl::{BoneTransforms, JOINT_COUNT, JOINT_NAMES, PARENTS, VertexWeights, builtin},
};
use glam::{Affine3A, Quat, Vec3};

use super::{
    LIMB_JOINTS,
    document::Document,
    skeleton::{Clip, Skeleton},
    skin::{Skin, skin},
};
use crate::error::SimError;

/// A file in metres holds people of these heights; another unit is scaled to an ordinary one.
const HUMAN_M: [f32; 2] = [1.2, 2.3];
const ORDINARY_M: f32 = 1.7;

/// Somebody else's character.
#[derive(Clone, Debug)]
pub struct Character {
    pub name: String,
    /// Triangles of all its parts; vertices that coincide are one.
    pub triangles: Vec<[u32; 3]>,
    /// Skinning weights on SMPL's bones: those of the file, each at the nearest bone that has a part to play.
    pub weights: Vec<VertexWeights>,
    /// The surface in SMPL's zero pose.
    pub zero_pose: Vec<Vec3>,
    /// Joints in the zero pose.
    pub joints: [Vec3; JOINT_COUNT],
    pub(super) clips: Vec<Clip>,
    skeleton: Skeleton,
    skin: Skin,
    roles: JointMap,
    ours_from_file: Affine3A,
    /// From the zero pose's bones to those at rest in the file.
    alignments: [Quat; JOINT_COUNT],
    rest_globals: Vec<Affine3A>,
}

impl Character {
    /// Reads a `.glb` or `.gltf` file; `height_m` scales it, otherwise files that are not in metres are guessed.
    pub fn read(path: &Path, height_m: Option<f32>) -> Result<Self, SimError> {
        let document = Document::read(path)?;
        let skeleton = Skeleton::of(&document)?;
        let (skin, triangles) = skin(&document)?;
        let roles = roles(&document, &skeleton)?;
        let clips = Clip::all(&document)?;
        let rest_globals = skeleton.globals(&skeleton.rest);
        let at_rest = skin.posed(&rest_globals);
        let ours_from_file = ours_from_file(&document, &at_rest, &rest_globals, &roles, height_m)?;
        let mut character = Self {
            name: path
                .file_stem()
                .map_or_else(String::new, |s| s.to_string_lossy().into_owned()),
            triangles,
            weights: weights(&skin, &skeleton, &roles),
            zero_pose: Vec::new(),
            joints: [Vec3::ZERO; JOINT_COUNT],
            clips,
            skeleton,
            skin,
            roles,
            ours_from_file,
            alignments: [Quat::IDENTITY; JOINT_COUNT],
            rest_globals,
        };
        character.straighten(&at_rest);
        Ok(character)
    }

    /// What a motion needs to know to put these feet on the floor.
    pub fn rest_body(&self) -> RestBody {
        RestBody::skinned(&self.joints, &self.zero_pose, &self.weights)
    }

    /// The surface in a pose of SMPL's, in the space of `trans`.
    pub fn posed(&self, theta: &[Vec3; JOINT_COUNT], trans: Vec3) -> TriangleMesh {
        let (bones, _) = BoneTransforms::from_pose(theta, &self.joints);
        let mut vertices = vec![Vec3::ZERO; self.zero_pose.len()];
        bones.skin_into(&self.weights, &self.zero_pose, trans, &mut vertices);
        self.mesh(vertices)
    }

    /// Which vertices are hair, for all we know: the head above its brow.
    pub(super) fn hair(&self) -> Vec<bool> {
        const BROW: f32 = 0.62;
        let of_head = |weights: &VertexWeights| {
            let shares = weights.bones.iter().zip(&weights.weights);
            shares
                .filter(|(bone, _)| **bone == 15)
                .map(|(_, share)| share)
                .sum::<f32>()
                > 0.5
        };
        let neck_m = self.joints[15].y;
        let head = self
            .zero_pose
            .iter()
            .zip(&self.weights)
            .filter(|(_, weights)| of_head(weights));
        let top_m = head.map(|(vertex, _)| vertex.y).fold(neck_m, f32::max);
        let brow_m = neck_m + BROW * (top_m - neck_m);
        let is_hair =
            |(vertex, weights): (&Vec3, &VertexWeights)| of_head(weights) && vertex.y > brow_m;
        self.zero_pose
            .iter()
            .zip(&self.weights)
            .map(is_hair)
            .collect()
    }

    /// The surface at a time of one of its own clips, in our space, and its nodes.
    pub(super) fn at(&self, clip: &Clip, secs: f32) -> (TriangleMesh, Vec<Affine3A>) {
        let globals = self.skeleton.globals(&self.skeleton.at(clip, secs));
        let vertices = self.skin.posed(&globals);
        let to_ours = |v: Vec3| self.ours_from_file.transform_point3(v);
        (
            self.mesh(vertices.into_iter().map(to_ours).collect()),
            globals,
        )
    }

    /// Where the joint that plays an SMPL joint's part is, and how it is turned from the zero pose.
    pub(super) fn joint(&self, smpl: usize, globals: &[Affine3A]) -> Option<(Vec3, Quat)> {
        let node = self.roles.0[smpl]?;
        let position = self
            .ours_from_file
            .transform_point3a(globals[node].translation);
        let rotation = |global: &Affine3A| global.to_scale_rotation_translation().1;
        let turn = rotation(&(self.ours_from_file * globals[node]))
            * rotation(&(self.ours_from_file * self.rest_globals[node])).inverse();
        Some((position.into(), (turn * self.alignments[smpl]).normalize()))
    }

    fn mesh(&self, vertices: Vec<Vec3>) -> TriangleMesh {
        let mut mesh = TriangleMesh::new(vertices, self.triangles.clone());
        mesh.compute_normals();
        mesh
    }

    /// From the file's rest pose to SMPL's zero pose: limbs are turned as ours lie, trunk, head and feet stay.
    fn straighten(&mut self, at_rest_in_file: &[Vec3]) {
        let template = builtin::body();
        let ours = template.joints(&template.template);
        let to_ours = |v: Vec3| self.ours_from_file.transform_point3(v);
        let theirs = self
            .roles
            .0
            .map(|node| node.map(|node| to_ours(Vec3::from(self.rest_globals[node].translation))));
        let alignments = limb_alignments(&theirs, &ours);
        let leg = |joints: &[Vec3; JOINT_COUNT]| joints[1].y - joints[7].y;
        let mut rest = [Vec3::ZERO; JOINT_COUNT];
        for joint in 0..JOINT_COUNT {
            let known = theirs[1]
                .zip(theirs[7])
                .map_or(1.0, |(hip, ankle)| (hip.y - ankle.y) / leg(&ours));
            let guessed = rest[PARENTS[joint]] + (ours[joint] - ours[PARENTS[joint]]) * known;
            rest[joint] = theirs[joint].unwrap_or(guessed);
        }
        let mut joints = rest;
        let mut bones = [Affine3A::IDENTITY; JOINT_COUNT];
        for joint in 0..JOINT_COUNT {
            let parent = PARENTS[joint];
            if joint > 0 {
                joints[joint] = bones[parent].transform_point3(rest[joint]);
            }
            let turn = alignments[joint].inverse();
            bones[joint] =
                Affine3A::from_rotation_translation(turn, joints[joint] - turn * rest[joint]);
        }
        let bones = BoneTransforms(bones);
        let at_rest: Vec<Vec3> = at_rest_in_file.iter().map(|&v| to_ours(v)).collect();
        let mut zero_pose = vec![Vec3::ZERO; at_rest.len()];
        bones.skin_into(&self.weights, &at_rest, Vec3::ZERO, &mut zero_pose);
        self.zero_pose = zero_pose;
        self.joints = joints;
        self.alignments = alignments;
    }
}

fn roles(document: &Document, skeleton: &Skeleton) -> Result<JointMap, SimError> {
    let names: Vec<&str> = skeleton.names.iter().map(String::as_str).collect();
    let missing = |smpl: usize| {
        let expected = format!(
            "a bone for SMPL's `{}`, under one of the names {} (on its side)",
            JOINT_NAMES[smpl],
            JointMap::known_names(smpl)
        );
        let found = names
            .iter()
            .take(40)
            .copied()
            .collect::<Vec<_>>()
            .join(", ");
        document.wrong(&expected, &found)
    };
    let roles = JointMap::find(&names, &skeleton.parents).map_err(missing)?;
    match LIMB_JOINTS
        .into_iter()
        .find(|&smpl| roles.0[smpl].is_none())
    {
        Some(smpl) => Err(missing(smpl)),
        None => Ok(roles),
    }
}

/// Each bone's share goes to the nearest of its ancestors, itself included, that plays a part.
fn weights(skin: &Skin, skeleton: &Skeleton, roles: &JointMap) -> Vec<VertexWeights> {
    let mut part_of_node = vec![None; skeleton.names.len()];
    for (smpl, node) in roles.0.iter().enumerate() {
        if let Some(node) = node {
            // A node that plays several parts of the spine is the highest of them.
            part_of_node[*node] = Some(smpl);
        }
    }
    let part = |bone: usize| {
        let mut node = Some(skin.bones[bone].0);
        while let Some(at) = node {
            if let Some(smpl) = part_of_node[at] {
                return smpl;
            }
            node = skeleton.parents[at];
        }
        0
    };
    let parts: Vec<usize> = (0..skin.bones.len()).map(part).collect();
    skin.shares
        .iter()
        .map(|shares| {
            let mut weights = VertexWeights::default();
            let mut filled = 0;
            for &(bone, share) in shares.iter().filter(|(_, share)| *share > 0.0) {
                let smpl = parts[bone as usize] as u8;
                let slot = (0..filled)
                    .find(|&k| weights.bones[k] == smpl)
                    .unwrap_or(filled);
                weights.bones[slot] = smpl;
                weights.weights[slot] += share;
                filled = filled.max(slot + 1);
            }
            weights
        })
        .collect()
}

/// Metres, upright, facing +z, feet on the floor, pelvis above the origin.
fn ours_from_file(
    document: &Document,
    at_rest: &[Vec3],
    globals: &[Affine3A],
    roles: &JointMap,
    height_m: Option<f32>,
) -> Result<Affine3A, SimError> {
    let joint = |smpl: usize| {
        roles.0[smpl].map_or(Vec3::ZERO, |node| Vec3::from(globals[node].translation))
    };
    let left = joint(1) - joint(2) + joint(16) - joint(17);
    let turn = Quat::from_rotation_y(left.z.atan2(left.x));
    let lowest = at_rest.iter().map(|v| v.y).fold(f32::MAX, f32::min);
    let highest = at_rest.iter().map(|v| v.y).fold(f32::MIN, f32::max);
    let height = highest - lowest;
    let upright = joint(16).y > joint(1).y && joint(1).y > joint(7).y;
    if !(height > 1e-3 && height.is_finite() && upright) {
        let found = format!(
            "{height} units from lowest to highest, hips at {}",
            joint(1).y - lowest
        );
        return Err(document.wrong("a character that stands upright at rest, y up", &found));
    }
    let natural_m = if (HUMAN_M[0]..=HUMAN_M[1]).contains(&height) {
        height
    } else {
        ORDINARY_M
    };
    let scale = height_m.unwrap_or(natural_m) / height;
    let pelvis = joint(0);
    let origin = Vec3::new(pelvis.x, lowest, pelvis.z);
    Ok(Affine3A::from_scale_rotation_translation(
        Vec3::splat(scale),
        turn,
        -(turn * origin) * scale,
    ))
}
