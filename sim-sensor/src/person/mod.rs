//! Simulated people: a shape, an outfit on the body's own topology, and how both look in a pose.
//!
//! Clothes are displacements of the zero-pose surface: outwards by an ease, more where gravity pulls the cloth
//! away from the limb, in folds where joints bend. Clothes that are simulated are worn over a person with shoes
//! and hair only: see [`crate::cloth`].

use std::sync::Arc;

use effigy_fusion::mesh::TriangleMesh;
use effigy_registration::{
    BodyModel, BodyParams, PosedBody,
    motion::RestBody,
    smpl::{BoneTransforms, JOINT_COUNT, star_transforms},
};
use glam::{Mat3, Vec3};

mod anthropometry;
pub(crate) mod chart;
mod flesh;
mod folds;
mod identity;
mod individual;
mod outfit;
mod paint;
mod tailor;
mod wrinkles;

pub use anthropometry::{Adult, Sex};
pub use identity::sample_betas;
pub use individual::Individual;
pub(crate) use individual::best_betas;
pub use outfit::{Garment, Outfit, OutfitKind, Shoes};
pub use paint::{Material, Paint};

use chart::Chart;
use tailor::Tailoring;
pub(crate) use tailor::smoothstep;

/// One person in one outfit.
#[derive(Clone, Debug)]
pub struct Person {
    pub body: Arc<BodyModel>,
    /// Of an individual: those whose body lies nearest to theirs.
    pub betas: [f32; 10],
    /// Joints of the minimal body in the zero pose.
    pub rest_joints: [Vec3; JOINT_COUNT],
    pub outfit: Outfit,
    /// Colours and infrared reflectance, for each vertex.
    pub paint: Paint,
    /// What betas do not say, of people who are more than a body model.
    pub individual: Option<Arc<Individual>>,
    minimal: Vec<Vec3>,
    /// The pelvis of the body that `betas` make.
    pelvis_of_betas: Vec3,
    tailoring: Tailoring,
}

impl Person {
    /// Somebody with these betas in this outfit; the seed decides on folds, hair and colours.
    pub fn new(body: Arc<BodyModel>, betas: [f32; 10], outfit: Outfit, seed: u64) -> Self {
        let minimal = body.shaped_vertices(&betas);
        Self::with_surface(body, (betas, minimal), None, outfit, seed)
    }

    /// An adult by number whose body is their own: no betas make it exactly, and flesh moves with the pose.
    pub fn individual(body: Arc<BodyModel>, outfit: Outfit, seed: u64) -> Self {
        let adult = Adult::sample(&body, seed);
        let mut minimal = body.shaped_vertices(&adult.betas);
        let chart = Chart::new(&body, minimal.clone(), &body.joints(&minimal));
        let individual = Individual::new(&body, adult, &chart, seed);
        for (vertex, offset) in minimal.iter_mut().zip(&individual.offsets) {
            *vertex += *offset;
        }
        let betas = best_betas(&body, &minimal);
        let individual = Some(Arc::new(individual));
        Self::with_surface(body, (betas, minimal), individual, outfit, seed)
    }

    fn with_surface(
        body: Arc<BodyModel>,
        (betas, minimal): ([f32; 10], Vec<Vec3>),
        individual: Option<Arc<Individual>>,
        outfit: Outfit,
        seed: u64,
    ) -> Self {
        let rest_joints = body.joints(&minimal);
        // Betas alone make a person of the model.
        let pelvis_of_betas = match &individual {
            Some(_) => body.joints(&body.shaped_vertices(&betas))[0],
            None => rest_joints[0],
        };
        let chart = Chart::new(&body, minimal.clone(), &rest_joints);
        let tailoring = Tailoring::new(&chart, &outfit, seed);
        let paint = Paint::new(&tailoring, seed);
        Self {
            body,
            betas,
            rest_joints,
            outfit,
            paint,
            individual,
            minimal,
            pelvis_of_betas,
            tailoring,
        }
    }

    /// Somebody from the population, 1.50 to 1.95 m tall.
    pub fn sample(body: Arc<BodyModel>, kind: OutfitKind, seed: u64) -> Self {
        let betas = sample_betas(&body, seed);
        Self::new(body, betas, Outfit::new(kind, seed), seed)
    }

    /// The minimal body in the zero pose with the pose's correctives.
    pub fn minimal_zero_pose(&self, theta: &[Vec3; JOINT_COUNT]) -> Vec<Vec3> {
        let mut vertices = self.minimal.clone();
        self.body.add_pose_correctives(&mut vertices, theta);
        if let Some(individual) = &self.individual {
            individual
                .flesh
                .move_with(&mut vertices, theta, &self.rest_joints);
        }
        vertices
    }

    /// The minimal body in the space of `trans`.
    pub fn minimal_posed(&self, theta: &[Vec3; JOINT_COUNT], trans: Vec3) -> PosedBody {
        let (bones, joints) = BoneTransforms::from_pose(theta, &self.rest_joints);
        let vertices = self.skinned(self.minimal_zero_pose(theta), &bones, trans);
        PosedBody { vertices, joints: joints.map(|joint| joint + trans), bones }
    }

    /// The outer surface in the zero pose, with correctives, folds and sag of the pose.
    pub fn clothed_zero_pose(&self, theta: &[Vec3; JOINT_COUNT]) -> Vec<Vec3> {
        let mut vertices = self.minimal_zero_pose(theta);
        self.tailoring
            .dress(&mut vertices, theta, &self.body.skinning);
        vertices
    }

    /// The outer surface of a pose, moved to star pose.
    pub fn clothed_canonical(&self, theta: &[Vec3; JOINT_COUNT]) -> Vec<Vec3> {
        self.skinned(
            self.clothed_zero_pose(theta),
            &star_transforms(&self.rest_joints),
            Vec3::ZERO,
        )
    }

    /// The minimal body of a pose (correctives included), moved to star pose.
    pub fn minimal_canonical(&self, theta: &[Vec3; JOINT_COUNT]) -> Vec<Vec3> {
        self.skinned(
            self.minimal_zero_pose(theta),
            &star_transforms(&self.rest_joints),
            Vec3::ZERO,
        )
    }

    /// The outer surface in the space of `trans`, with normals and colours.
    pub fn clothed_posed(&self, theta: &[Vec3; JOINT_COUNT], trans: Vec3) -> TriangleMesh {
        self.mesh(self.clothed_posed_vertices(theta, trans))
    }

    /// As [`Self::clothed_posed`], vertices only.
    pub fn clothed_posed_vertices(&self, theta: &[Vec3; JOINT_COUNT], trans: Vec3) -> Vec<Vec3> {
        let (bones, _) = BoneTransforms::from_pose(theta, &self.rest_joints);
        self.skinned(self.clothed_zero_pose(theta), &bones, trans)
    }

    /// Where each vertex lies, in a tailor's words.
    pub(crate) fn chart(&self) -> Chart {
        Chart::new(&self.body, self.minimal.clone(), &self.rest_joints)
    }

    /// A surface on the body's topology, with normals from its own geometry and this person's colours.
    pub fn mesh(&self, vertices: Vec<Vec3>) -> TriangleMesh {
        let mut mesh = TriangleMesh::new(vertices, self.body.triangles.clone());
        mesh.compute_normals();
        mesh.colors = self.paint.vertex_colors();
        mesh
    }

    /// What a motion needs to know to put these feet (with their shoes) on the floor.
    pub fn rest_body(&self) -> RestBody {
        let standing = self.clothed_zero_pose(&[Vec3::ZERO; JOINT_COUNT]);
        RestBody::with_surface(&self.body, &self.rest_joints, &standing)
    }

    /// The parameters of the body model that come nearest: the pelvises lie on each other.
    pub fn params(&self, theta: &[Vec3; JOINT_COUNT], trans: Vec3) -> BodyParams {
        let trans = trans + (self.rest_joints[0] - self.pelvis_of_betas);
        BodyParams { betas: self.betas, theta: *theta, trans }
    }

    /// The minimal body's height, standing in the zero pose.
    pub fn height_m(&self) -> f32 {
        identity::height_m(&self.minimal)
    }

    fn skinned(&self, mut vertices: Vec<Vec3>, bones: &BoneTransforms, trans: Vec3) -> Vec<Vec3> {
        for (vertex, weights) in vertices.iter_mut().zip(&self.body.skinning) {
            *vertex = bones.blend(weights).transform_point3(*vertex) + trans;
        }
        vertices
    }
}

/// `R_j - I` for each joint.
fn bends(theta: &[Vec3; JOINT_COUNT]) -> [Mat3; JOINT_COUNT] {
    theta.map(|t| effigy_registration::smpl::rotation_from_axis_angle(t) - Mat3::IDENTITY)
}

#[cfg(test)]
mod individual_tests;
#[cfg(test)]
mod tests;
