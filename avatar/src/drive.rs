//! The live avatar: a mesh of fixed topology that follows the field and the body from pose to pose.

use std::sync::Arc;

use effigy_capture::FrameId;
use effigy_fusion::{TriangleMesh, mesh::normals::vertex_normals_into};
use effigy_registration::{BodyParams, smpl::JOINT_COUNT};
use glam::{Affine3A, Vec3};
use serde::{Deserialize, Serialize};

use crate::{
    bake::ShapeMap,
    mesher::{self, FieldAt},
    model::Avatar,
    pose_input::PoseInput,
    skinning::{Skinning, Warp},
};

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct DriveConfig {
    /// How often a vertex looks for the zero level of a new pose, along its own canonical normal; each time costs one field
    /// value for each vertex that the time before moved far.
    pub steps: usize,
    /// A vertex that a step along its normal moved by less takes no further one: what is left is a tenth.
    pub settled_m: f32,
    /// No vertex leaves its place in the topology by more: clothes on a body move by centimetres.
    pub max_offset_m: f32,
}

impl Default for DriveConfig {
    fn default() -> Self {
        Self { steps: 3, settled_m: 0.003, max_offset_m: 0.05 }
    }
}

/// The avatar in one pose.
#[derive(Clone, Debug)]
pub struct AvatarMesh {
    /// The frame whose pose this is.
    pub frame: FrameId,
    pub theta: [Vec3; JOINT_COUNT],
    /// Vertices in canonical space (star pose, metres).
    pub canonical: Vec<Vec3>,
    /// Vertices in the space of the pose's `trans`: world.
    pub vertices: Vec<Vec3>,
    /// Outward unit normals of the posed mesh.
    pub normals: Vec<Vec3>,
    pub triangles: Arc<Vec<[u32; 3]>>,
}

impl AvatarMesh {
    /// The posed mesh on its own.
    pub fn to_mesh(&self) -> TriangleMesh {
        TriangleMesh {
            vertices: self.vertices.clone(),
            normals: self.normals.clone(),
            triangles: self.triangles.to_vec(),
            colors: Vec::new(),
        }
    }
}

/// The avatar in one pose as a mesh of its own, extracted with `resolution` points a side: for export and for
/// measuring (MetaAvatar: 256). Slow; the [`Driver`] is for live use.
pub fn extract_posed(
    avatar: &Avatar,
    skinning: &dyn Skinning,
    params: &BodyParams,
    resolution: usize,
) -> TriangleMesh {
    let subject = &avatar.subject;
    let sdf = avatar.field.field(&subject.pose_input(&params.theta));
    let mut mesh = mesher::extract(&*sdf, resolution);
    for vertex in &mut mesh.vertices {
        *vertex = subject.unit_box.canonical_from_unit(*vertex);
    }
    let warp = Warp::new(params, &subject.rest_joints);
    let skinned = skinning.forward(&mesh.vertices, &mesh.normals);
    for (vertex, point) in mesh.vertices.iter_mut().zip(&skinned) {
        *vertex = warp
            .posed_from_canonical(&point.weights)
            .transform_point3(*vertex);
    }
    mesh.compute_normals();
    mesh
}

/// Poses one avatar, frame by frame; no frame depends on the one before.
pub struct Driver {
    avatar: Arc<Avatar>,
    config: DriveConfig,
    /// For each vertex, rest (zero pose) from canonical space.
    rest_from_canonical: Vec<Affine3A>,
    /// How fast the field grows along each topology normal.
    slopes: Vec<f32>,
    offsets: Vec<f32>,
    /// The vertices in unit space, on the way to the zero level.
    points: Vec<Vec3>,
    /// Vertices that another step would move, and their places.
    open: Vec<u32>,
    queries: Vec<Vec3>,
    field_at: FieldAt,
    /// What gives the offsets without the field, where it knows the pose.
    map: Option<ShapeMap>,
}

/// A field flatter than this along a normal is no distance field there; steps stay bounded.
const MIN_SLOPE: f32 = 0.3;

impl Driver {
    pub fn new(avatar: Arc<Avatar>, config: DriveConfig) -> Self {
        let count = avatar.topology.vertices_in_unit.len();
        let mut field_at = FieldAt::new(count);
        let sdf = avatar
            .field
            .field(&avatar.subject.pose_input(&avatar.topology_theta));
        let slopes = field_at
            .gradients(&*sdf, &avatar.topology.vertices_in_unit)
            .iter()
            .zip(&avatar.topology.normals)
            .map(|(gradient, normal)| gradient.dot(*normal).max(MIN_SLOPE))
            .collect();
        Self {
            rest_from_canonical: avatar.rest_from_canonical(),
            slopes,
            offsets: vec![0.0; count],
            points: Vec::with_capacity(count),
            open: Vec::with_capacity(count),
            queries: Vec::with_capacity(count),
            field_at,
            map: None,
            avatar,
            config,
        }
    }

    /// Drives without the field where this map of the same avatar knows the pose.
    pub fn with_map(self, map: ShapeMap) -> Self {
        Self { map: Some(map), ..self }
    }

    pub fn avatar(&self) -> &Arc<Avatar> {
        &self.avatar
    }

    pub(crate) fn has_map(&self) -> bool {
        self.map.is_some()
    }

    /// The avatar in the pose of `params`; the shape is the avatar's own, whatever `params.betas` say.
    pub fn pose(&mut self, params: &BodyParams, frame: FrameId) -> AvatarMesh {
        let pose = self.avatar.subject.pose_input(&params.theta);
        if !self.place_by_map(&pose) {
            self.place_by_field(&pose);
        }
        self.posed(params, frame)
    }

    fn posed(&self, params: &BodyParams, frame: FrameId) -> AvatarMesh {
        let unit_box = self.avatar.subject.unit_box;
        let canonical: Vec<Vec3> = self
            .points
            .iter()
            .map(|&point| unit_box.canonical_from_unit(point))
            .collect();
        let vertices = self.skin(params, &canonical);
        let triangles = Arc::clone(&self.avatar.topology.triangles);
        let mut normals = Vec::new();
        vertex_normals_into(&vertices, &triangles, &mut normals);
        AvatarMesh { frame, theta: params.theta, canonical, vertices, normals, triangles }
    }

    /// Leaves the vertices in `self.points`, if there is a map and it knows the pose.
    fn place_by_map(&mut self, pose: &PoseInput) -> bool {
        let Some(map) = &self.map else {
            return false;
        };
        let coefficients = self.avatar.field.coefficients(pose);
        if !coefficients.is_some_and(|known| map.offsets_m(&known, &mut self.offsets)) {
            return false;
        }
        let topology = &self.avatar.topology;
        let units_per_metre = self.avatar.subject.unit_box.metres_per_unit().recip();
        let longest_m = self.config.max_offset_m;
        let places = topology.vertices_in_unit.iter().zip(&topology.normals);
        let offset = |((&vertex, &normal), offset_m): ((&Vec3, &Vec3), &f32)| {
            vertex + normal * (offset_m.clamp(-longest_m, longest_m) * units_per_metre)
        };
        self.points.clear();
        self.points.extend(places.zip(&self.offsets).map(offset));
        true
    }

    /// How far each vertex lies along its topology normal from its topology place in a pose, metres; found in the full
    /// field.
    pub fn offsets_m(&mut self, pose: &PoseInput) -> &[f32] {
        self.place_by_field(pose);
        let metres_per_unit = self.avatar.subject.unit_box.metres_per_unit();
        for offset in &mut self.offsets {
            *offset *= metres_per_unit;
        }
        &self.offsets
    }

    /// Moves the topology's vertices onto the zero level of a pose's field; the result is in `self.points`, how far each
    /// went in `self.offsets`, both in unit lengths.
    fn place_by_field(&mut self, pose: &PoseInput) {
        let sdf = self.avatar.field.field(pose);
        let topology = &self.avatar.topology;
        let metres_per_unit = self.avatar.subject.unit_box.metres_per_unit();
        let settled = self.config.settled_m / metres_per_unit;
        let longest = self.config.max_offset_m / metres_per_unit;
        self.points.clone_from(&topology.vertices_in_unit);
        self.offsets.fill(0.0);
        self.open.clear();
        self.open.extend(0..self.points.len() as u32);
        for _ in 0..self.config.steps {
            self.queries.clear();
            self.queries
                .extend(self.open.iter().map(|&vertex| self.points[vertex as usize]));
            let mut values = self.field_at.values(&*sdf, &self.queries).iter();
            self.open.retain(|&vertex| {
                let vertex = vertex as usize;
                let value = *values.next().expect("one value a query");
                if !value.is_finite() {
                    return false;
                }
                let step = value / self.slopes[vertex];
                self.offsets[vertex] = (self.offsets[vertex] - step).clamp(-longest, longest);
                self.points[vertex] = topology.vertices_in_unit[vertex]
                    + topology.normals[vertex] * self.offsets[vertex];
                step.abs() > settled
            });
        }
    }

    fn skin(&self, params: &BodyParams, canonical: &[Vec3]) -> Vec<Vec3> {
        let warp = Warp::new(params, &self.avatar.subject.rest_joints);
        canonical
            .iter()
            .zip(&self.rest_from_canonical)
            .zip(&self.avatar.topology.skinning)
            .map(|((&point, rest_from_canonical), weights)| {
                let at_rest = rest_from_canonical.transform_point3(point);
                warp.posed_from_rest_by_four(weights)
                    .transform_point3(at_rest)
            })
            .collect()
    }
}

/// What the twin on a graphics card starts from, and is compared with.
#[cfg(feature = "gpu")]
impl Driver {
    /// As [`Self::pose`], without the map.
    pub(crate) fn pose_in_full_field(&mut self, params: &BodyParams, frame: FrameId) -> AvatarMesh {
        self.place_by_field(&self.avatar.subject.pose_input(&params.theta));
        self.posed(params, frame)
    }

    pub(crate) fn config(&self) -> &DriveConfig {
        &self.config
    }

    pub(crate) fn slopes(&self) -> &[f32] {
        &self.slopes
    }

    pub(crate) fn rest_from_canonical(&self) -> &[Affine3A] {
        &self.rest_from_canonical
    }
}

#[cfg(test)]
mod tests {
    use effigy_fusion::mesh::closest_point::ClosestPoint;

    use super::*;
    use crate::{
        export::write_ply,
        skinning::{ClosestBodyPoint, ClosestBodyPointConfig},
        testing::{Suit, everyday_poses, suit_avatar},
    };

    fn distances_mm(points: &[Vec3], truth: &TriangleMesh) -> Vec<f32> {
        let closest = ClosestPoint::from_mesh(truth).unwrap();
        let mut distances: Vec<f32> = closest
            .query_all(points)
            .iter()
            .map(|hit| hit.distance * 1e3)
            .collect();
        distances.sort_by(f32::total_cmp);
        distances
    }

    #[test]
    fn a_driven_suit_is_the_skinned_suit_within_millimetres() {
        let suit = Suit::new(0.01);
        let mut driver = Driver::new(Arc::new(suit_avatar(0.0)), DriveConfig::default());
        let count = driver.avatar().topology.vertices_in_unit.len();
        assert!((6000..9000).contains(&count), "{count} vertices");
        for (number, params) in everyday_poses().iter().enumerate() {
            let driven = driver.pose(params, FrameId(number as u64));
            // `EFFIGY_PLY=folder` keeps the meshes, to look at.
            if let Ok(folder) = std::env::var("EFFIGY_PLY") {
                let path = std::path::Path::new(&folder).join(format!("driven{number}.ply"));
                write_ply(&path, &driven, effigy_capture::Rigid3::IDENTITY).unwrap();
            }
            let distances = distances_mm(&driven.vertices, &suit.without_correctives(params));
            let mean = distances.iter().sum::<f32>() / distances.len() as f32;
            let p95 = distances[distances.len() * 95 / 100];
            println!("pose {number}: mean {mean:.2} mm, p95 {p95:.2} mm");
            // A vertex takes four bones from a closest body point, and the suit's folds are blunted.
            assert!(mean < 1.0 && p95 < 4.0);
        }
    }

    #[test]
    fn vertices_follow_a_field_that_changes_with_the_pose() {
        let growth_m = 0.012;
        let config = DriveConfig { steps: 2, ..DriveConfig::default() };
        let mut driver = Driver::new(Arc::new(suit_avatar(growth_m)), config);
        let params = everyday_poses()[2];
        let driven = driver.pose(&params, FrameId(0));
        let subject = driver.avatar().subject;
        let sdf = driver
            .avatar()
            .field
            .field(&subject.pose_input(&params.theta));
        let in_unit: Vec<Vec3> = driven
            .canonical
            .iter()
            .map(|&vertex| subject.unit_box.unit_from_canonical(vertex))
            .collect();
        let mut values = vec![0.0; in_unit.len()];
        sdf.values(&in_unit, &mut values);
        let off_mm = |value: f32| value.abs() * subject.unit_box.metres_per_unit() * 1e3;
        let mean = values.iter().map(|&value| off_mm(value)).sum::<f32>() / values.len() as f32;
        println!("mean {mean:.3} mm off the surface");
        // 1.6 rad of bent knee and elbow grow the suit by 19 mm; folds, where the nearest body point
        // jumps, keep a little of it.
        assert!(mean < 0.8);
    }

    #[test]
    fn a_full_extraction_and_the_driven_mesh_are_one_surface() {
        let avatar = Arc::new(suit_avatar(0.01));
        let suit = Suit::new(0.01);
        let skinning = ClosestBodyPoint::new(
            Arc::clone(&suit.model),
            &suit.subject.betas,
            ClosestBodyPointConfig::default(),
        );
        let params = everyday_poses()[1];
        let full = extract_posed(&avatar, &skinning, &params, 160);
        assert!(full.is_watertight());
        let driven = Driver::new(avatar, DriveConfig::default()).pose(&params, FrameId(0));
        let distances = distances_mm(&driven.vertices, &full);
        let mean = distances.iter().sum::<f32>() / distances.len() as f32;
        println!("mean {mean:.2} mm");
        assert!(mean < 0.6);
    }

    #[test]
    fn a_pose_does_not_depend_on_the_one_before() {
        let avatar = Arc::new(suit_avatar(0.01));
        let poses = everyday_poses();
        let mut driver = Driver::new(Arc::clone(&avatar), DriveConfig::default());
        driver.pose(&poses[2], FrameId(0));
        let after = driver.pose(&poses[1], FrameId(1));
        let alone = Driver::new(avatar, DriveConfig::default()).pose(&poses[1], FrameId(1));
        assert_eq!(after.vertices, alone.vertices);
    }
}
