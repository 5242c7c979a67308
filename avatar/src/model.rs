//! One person's avatar: the minimal body, the pose-conditioned field, and a mesh of fixed topology.

use std::{any::Any, path::Path, sync::Arc};

use effigy_fusion::TriangleMesh;
use effigy_registration::{
    BodyModel,
    smpl::{BodyIdentity, JOINT_COUNT, UnitBox, VertexWeights, star_transforms},
};
use glam::{Affine3A, Vec3};
use serde::{Deserialize, Serialize};

use crate::{
    checkpoint,
    error::AvatarError,
    hyper::decode_field,
    mesher,
    neighbors::Neighbors,
    pose_input::PoseInput,
    sdf::{SignedDistanceField, SirenField},
    skinning::{BoneWeights, Skinning, average, four_largest, rest_from_canonical, star_body},
};

/// A field that changes with the pose: the hypernetwork, or a formula in tests.
pub trait PoseField: Send + Sync + Any {
    /// The field of one pose.
    fn field(&self, pose: &PoseInput) -> Box<dyn SignedDistanceField>;

    /// The few numbers through which alone the pose enters the field's parameters, if there are such.
    fn coefficients(&self, _pose: &PoseInput) -> Option<Vec<f32>> {
        None
    }

    /// The field of one pose with its parameters, if it is a SIREN.
    fn siren(&self, _pose: &PoseInput) -> Option<SirenField> {
        None
    }

    /// What the parameters are of; a reader refuses kinds it does not know.
    fn kind(&self) -> &str;

    /// Everything [`Self::field`] depends on.
    fn to_bytes(&self) -> Vec<u8>;
}

/// The person without clothes, in numbers that stay the same from frame to frame.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Subject {
    pub body: BodyIdentity,
    pub betas: [f32; 10],
    /// Joints of the minimal body in the zero pose.
    pub rest_joints: [Vec3; JOINT_COUNT],
    pub unit_box: UnitBox,
}

impl Subject {
    pub fn new(model: &BodyModel, betas: &[f32; 10]) -> Result<Self, AvatarError> {
        let rest_joints = model.joints(&model.shaped_vertices(betas));
        let unit_box =
            UnitBox::from_canonical_body(&star_body(model, betas)).ok_or(AvatarError::EmptyBody)?;
        Ok(Self { body: model.identity, betas: *betas, rest_joints, unit_box })
    }

    pub fn pose_input(&self, theta: &[Vec3; JOINT_COUNT]) -> PoseInput {
        PoseInput::new(theta, &self.rest_joints, &self.unit_box)
    }
}

/// A canonical mesh whose triangles stay, and how its vertices are skinned.
#[derive(Clone, Debug, PartialEq)]
pub struct Topology {
    /// On the zero level of the pose it was extracted at, in unit space.
    pub vertices_in_unit: Vec<Vec3>,
    /// Outward unit normals there.
    pub normals: Vec<Vec3>,
    pub triangles: Arc<Vec<[u32; 3]>>,
    /// Forward skinning weights.
    pub skinning: Vec<VertexWeights>,
}

/// How the mesh of fixed topology is made.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct TopologyConfig {
    /// Vertices aimed at; what the field gives lies within a few percent.
    pub vertices: usize,
    /// Rounds of evening out the triangles; each is followed by a step back onto the zero level.
    pub relax_rounds: usize,
    /// Rounds of averaging skinning weights over neighbours: in the folds of the star pose the closest body
    /// point jumps, and a posed mesh would crumple there.
    pub smooth_rounds: usize,
}

impl Default for TopologyConfig {
    fn default() -> Self {
        Self { vertices: 7500, relax_rounds: 4, smooth_rounds: 12 }
    }
}

/// Everything needed to animate one person.
#[derive(Clone)]
pub struct Avatar {
    pub subject: Subject,
    pub field: Arc<dyn PoseField>,
    /// The pose the topology was extracted at.
    pub topology_theta: [Vec3; JOINT_COUNT],
    pub topology: Topology,
}

impl Avatar {
    /// Extracts the mesh at one pose (the keyframes' mean, say) and skins it.
    pub fn new(
        subject: &Subject,
        field: Arc<dyn PoseField>,
        skinning: &dyn Skinning,
        theta: &[Vec3; JOINT_COUNT],
        config: &TopologyConfig,
    ) -> Result<Self, AvatarError> {
        let sdf = field.field(&subject.pose_input(theta));
        let topology = Topology::extract(&*sdf, subject, skinning, config)?;
        Ok(Self { subject: *subject, field, topology_theta: *theta, topology })
    }

    /// Writes the avatar file.
    pub fn save(&self, path: &Path) -> Result<(), AvatarError> {
        checkpoint::write(path, self)
    }

    /// Reads an avatar whose field is a hypernetwork and which was made with this body.
    pub fn load(path: &Path, body: BodyIdentity) -> Result<Self, AvatarError> {
        checkpoint::read(path, body, &decode_field)
    }

    /// For each topology vertex, rest (zero pose) from canonical space.
    pub fn rest_from_canonical(&self) -> Vec<Affine3A> {
        let star = star_transforms(&self.subject.rest_joints);
        self.topology
            .skinning
            .iter()
            .map(|weights| rest_from_canonical(&star, weights))
            .collect()
    }
}

/// The resolution whose mesh of a body has about 7,500 vertices.
const FIRST_RESOLUTION: usize = 96;

impl Topology {
    fn extract(
        sdf: &dyn SignedDistanceField,
        subject: &Subject,
        skinning: &dyn Skinning,
        config: &TopologyConfig,
    ) -> Result<Self, AvatarError> {
        let mut mesh = mesher::extract(sdf, FIRST_RESOLUTION);
        if mesh.triangles.is_empty() {
            return Err(AvatarError::NoSurface { resolution: FIRST_RESOLUTION });
        }
        // Vertices grow with the square of the resolution.
        let scale = (config.vertices as f32 / mesh.vertices.len() as f32).sqrt();
        let resolution = ((FIRST_RESOLUTION as f32 * scale).round() as usize).clamp(16, 256);
        if resolution.abs_diff(FIRST_RESOLUTION) > 1 {
            mesh = mesher::extract(sdf, resolution);
        }
        mesher::relax(&mut mesh, sdf, config.relax_rounds);
        let weights = Self::forward_weights(&mesh, subject, skinning, config.smooth_rounds);
        Ok(Self {
            vertices_in_unit: mesh.vertices,
            normals: mesh.normals,
            triangles: Arc::new(mesh.triangles),
            skinning: weights.iter().map(four_largest).collect(),
        })
    }

    fn forward_weights(
        mesh: &TriangleMesh,
        subject: &Subject,
        skinning: &dyn Skinning,
        smooth_rounds: usize,
    ) -> Vec<BoneWeights> {
        let in_canonical: Vec<Vec3> = mesh
            .vertices
            .iter()
            .map(|&vertex| subject.unit_box.canonical_from_unit(vertex))
            .collect();
        let mut weights: Vec<BoneWeights> = skinning
            .forward(&in_canonical, &mesh.normals)
            .iter()
            .map(|point| point.weights)
            .collect();
        let neighbors = Neighbors::new(mesh.vertices.len(), &mesh.triangles);
        for _ in 0..smooth_rounds {
            let averaged = average(&neighbors, &weights);
            weights = (0..weights.len())
                .map(|vertex| {
                    let share = jump_share(&neighbors, &weights, vertex);
                    let (old, new) = (&weights[vertex], &averaged[vertex]);
                    std::array::from_fn(|bone| old[bone] + share * (new[bone] - old[bone]))
                })
                .collect();
        }
        weights
    }
}

/// How much a vertex needs smoothing: not at all where weights differ from its neighbours' as much as they
/// do across a joint, fully where they jump from one bone to another.
fn jump_share(neighbors: &Neighbors, weights: &[BoneWeights], vertex: usize) -> f32 {
    /// Differences summed over the bones: 2 is from one bone entirely to another.
    const JOINT: f32 = 0.3;
    const JUMP: f32 = 0.6;
    let difference = |other: u32| -> f32 {
        let pairs = weights[vertex].iter().zip(&weights[other as usize]);
        pairs.map(|(a, b)| (a - b).abs()).sum()
    };
    let largest = neighbors
        .of(vertex)
        .iter()
        .map(|&other| difference(other))
        .fold(0.0, f32::max);
    ((largest - JOINT) / (JUMP - JOINT)).clamp(0.0, 1.0)
}
