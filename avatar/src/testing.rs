//! Fields whose surface is known, for tests.

use std::sync::Arc;

use effigy_capture::{FrameId, Intrinsics, Rigid3, Timestamp};
use effigy_fusion::{
    CleanFrame, DepthMap, NormalMap, TriangleMesh, VertexMap,
    clean::PersonVisibility,
    mesh::{closest_point::ClosestPoint, normals::vertex_normals, z_buffer::Rasterizer},
};
use effigy_registration::{
    BodyModel, BodyParams, RegisteredFrame, Tracking,
    smpl::{BoneTransforms, JOINT_COUNT, star_transforms},
};
use glam::{Quat, Vec3, vec2};

use crate::{
    model::{Avatar, PoseField, Subject, TopologyConfig},
    pose_input::PoseInput,
    sdf::SignedDistanceField,
    skinning::{ClosestBodyPoint, ClosestBodyPointConfig, star_body},
};

/// A formula as a field; gradients by central differences.
pub(crate) struct Analytic<F>(pub(crate) F);

impl<F: Fn(Vec3) -> f32 + Sync> SignedDistanceField for Analytic<F> {
    fn values(&self, points: &[Vec3], out: &mut [f32]) {
        for (value, &point) in out.iter_mut().zip(points) {
            *value = self.0(point);
        }
    }

    fn values_and_gradients(&self, points: &[Vec3], values: &mut [f32], gradients: &mut [Vec3]) {
        const STEP: f32 = 1e-3;
        self.values(points, values);
        for (gradient, &point) in gradients.iter_mut().zip(points) {
            *gradient = Vec3::from_array(std::array::from_fn(|axis| {
                let step = Vec3::AXES[axis] * STEP;
                (self.0(point + step) - self.0(point - step)) / (2.0 * STEP)
            }));
        }
    }
}

/// The minimal body in star pose, blown up evenly: a person in a diving suit.
#[derive(Clone)]
pub(crate) struct InflatedBody {
    pub(crate) body: Arc<ClosestPoint>,
    pub(crate) thickness: f32,
    /// How much thicker each radian of knee and elbow makes the suit: a field that depends on the pose.
    pub(crate) growth: f32,
}

impl InflatedBody {
    /// `thickness_m` is in metres; the field is in unit space.
    pub(crate) fn new(model: &BodyModel, subject: &Subject, thickness_m: f32) -> Self {
        let vertices: Vec<Vec3> = star_body(model, &subject.betas)
            .iter()
            .map(|&vertex| subject.unit_box.unit_from_canonical(vertex))
            .collect();
        let body = ClosestPoint::new(&vertices, &model.triangles).unwrap();
        let thickness = thickness_m / subject.unit_box.metres_per_unit();
        Self { body: Arc::new(body), thickness, growth: 0.0 }
    }
}

impl SignedDistanceField for InflatedBody {
    fn values(&self, points: &[Vec3], out: &mut [f32]) {
        for (value, distance) in out.iter_mut().zip(self.body.signed_distance_all(points)) {
            *value = distance - self.thickness;
        }
    }

    fn values_and_gradients(&self, points: &[Vec3], values: &mut [f32], gradients: &mut [Vec3]) {
        let hits = self.body.query_all(points);
        for (index, (point, hit)) in points.iter().zip(&hits).enumerate() {
            let signed = self.body.sign(*point, hit);
            values[index] = signed - self.thickness;
            gradients[index] = (signed * (*point - hit.point)).normalize_or_zero();
        }
    }
}

impl PoseField for InflatedBody {
    fn field(&self, pose: &PoseInput) -> Box<dyn SignedDistanceField> {
        let bend: f32 = [4, 5, 18, 19]
            .iter()
            .map(|&joint| {
                ((pose.rotations[joint].col(0)[0]
                    + pose.rotations[joint].col(1)[1]
                    + pose.rotations[joint].col(2)[2]
                    - 1.0)
                    * 0.5)
                    .clamp(-1.0, 1.0)
                    .acos()
            })
            .sum();
        Box::new(Self { thickness: self.thickness + self.growth * bend, ..self.clone() })
    }

    fn kind(&self) -> &'static str {
        "inflated-body"
    }

    fn to_bytes(&self) -> Vec<u8> {
        [self.thickness, self.growth]
            .iter()
            .flat_map(|x| x.to_le_bytes())
            .collect()
    }
}

/// A person in a diving suit of even thickness over the minimal body, in truth and as a camera sees it.
pub(crate) struct Suit {
    pub(crate) model: Arc<BodyModel>,
    pub(crate) subject: Subject,
    pub(crate) thickness_m: f32,
}

impl Suit {
    pub(crate) fn new(thickness_m: f32) -> Self {
        let model = effigy_registration::smpl::builtin::body();
        let subject = Subject::new(&model, &[0.0; 10]).unwrap();
        Self { model, subject, thickness_m }
    }

    /// The suit as a stiff field of the minimal body would move: without pose correctives.
    pub(crate) fn without_correctives(&self, params: &BodyParams) -> TriangleMesh {
        let (bones, _) = BoneTransforms::from_pose(&params.theta, &self.subject.rest_joints);
        self.skinned(&bones, &self.at_rest(&BodyParams::ZERO.theta), params.trans)
    }

    /// The suit in the zero pose, pose correctives of `theta` included.
    fn at_rest(&self, theta: &[Vec3; JOINT_COUNT]) -> Vec<Vec3> {
        let mut vertices = self.model.shaped_vertices(&self.subject.betas);
        self.model.add_pose_correctives(&mut vertices, theta);
        let normals = vertex_normals(&vertices, &self.model.triangles);
        for (vertex, normal) in vertices.iter_mut().zip(normals) {
            *vertex += normal * self.thickness_m;
        }
        vertices
    }

    fn skinned(&self, bones: &BoneTransforms, at_rest: &[Vec3], trans: Vec3) -> TriangleMesh {
        let vertices = at_rest
            .iter()
            .zip(&self.model.skinning)
            .map(|(&vertex, weights)| bones.blend(weights).transform_point3(vertex) + trans)
            .collect();
        TriangleMesh::new(vertices, self.model.triangles.clone())
    }

    pub(crate) fn in_world(&self, params: &BodyParams) -> TriangleMesh {
        let (bones, _) = BoneTransforms::from_pose(&params.theta, &self.subject.rest_joints);
        self.skinned(&bones, &self.at_rest(&params.theta), params.trans)
    }

    pub(crate) fn in_canonical(&self, theta: &[Vec3; JOINT_COUNT]) -> TriangleMesh {
        let star = star_transforms(&self.subject.rest_joints);
        self.skinned(&star, &self.at_rest(theta), Vec3::ZERO)
    }

    /// What a camera in front of the person sees, without noise, before a wall.
    pub(crate) fn frame(&self, params: &BodyParams, id: u64) -> RegisteredFrame {
        let world_from_camera = Rigid3 {
            rotation: Quat::from_rotation_x(std::f32::consts::PI),
            translation: Vec3::new(0.0, 1.0, 2.5),
        };
        let camera_from_world = world_from_camera.inverse();
        let mesh = self.in_world(params);
        let in_camera: Vec<Vec3> = mesh
            .vertices
            .iter()
            .map(|&vertex| camera_from_world * vertex)
            .collect();
        RegisteredFrame {
            clean: Arc::new(clean_frame(&in_camera, &mesh.triangles, id)),
            world_from_camera,
            tracking: Tracking::Tracked {
                params: *params,
                residual_rms_m: 0.01,
                joint_confidence: [1.0; JOINT_COUNT],
            },
        }
    }
}

/// The pelvis a metre up, the given joints turned.
pub(crate) fn standing(joints: &[(usize, Vec3)]) -> BodyParams {
    let mut params = BodyParams::ZERO;
    params.trans = Vec3::new(0.1, 1.2, 0.0);
    for &(joint, angle) in joints {
        params.theta[joint] = angle;
    }
    params
}

/// Arms lowered, elbows and knees bent, torso turned: what people do in front of a camera.
pub(crate) fn everyday_poses() -> Vec<BodyParams> {
    let v = Vec3::new;
    vec![
        standing(&[(16, v(0.0, 0.0, -1.0)), (17, v(0.0, 0.0, 1.0))]),
        standing(&[
            (0, v(0.0, 0.8, 0.0)),
            (16, v(0.0, 0.0, -1.2)),
            (17, v(0.0, 0.0, 0.4)),
        ]),
        standing(&[
            (0, v(0.0, -2.2, 0.0)),
            (4, v(0.7, 0.0, 0.0)),
            (1, v(-0.6, 0.0, 0.1)),
            (16, v(0.0, 0.0, -0.6)),
            (18, v(0.0, -0.9, 0.0)),
            (17, v(0.0, 0.0, 1.1)),
            (6, v(0.0, 0.3, 0.0)),
        ]),
    ]
}

/// The camera of [`Suit::frame`].
pub(crate) const CAMERA: Intrinsics =
    Intrinsics { width: 320, height: 288, fx: 252.0, fy: 252.0, cx: 159.5, cy: 143.5 };

fn clean_frame(in_camera: &[Vec3], triangles: &[[u32; 3]], id: u64) -> CleanFrame {
    const WALL_M: f32 = 4.0;
    let normals_in_camera = vertex_normals(in_camera, triangles);
    let mut rasterizer = Rasterizer::new(CAMERA);
    let raster = rasterizer.draw(in_camera, triangles);
    let (width, height) = (raster.width, raster.height);
    let count = width * height;
    let mut clean = CleanFrame {
        id: FrameId(id),
        timestamp: Timestamp(0),
        depth: DepthMap { width, height, metres: vec![WALL_M; count] },
        vertices: VertexMap { width, height, points: vec![Vec3::NAN; count] },
        normals: NormalMap { width, height, normals: vec![Vec3::NAN; count] },
        person: vec![false; count],
        sigma_m: vec![f32::NAN; count],
        floor: None,
        visibility: PersonVisibility::Whole,
    };
    for pixel in 0..count {
        if let Some((triangle, barycentric)) = raster.hit(pixel) {
            clean.depth.metres[pixel] = raster.depth[pixel];
            clean.person[pixel] = true;
            clean.sigma_m[pixel] = 0.002;
            let place = vec2((pixel % width) as f32, (pixel / width) as f32);
            clean.vertices.points[pixel] = CAMERA.unproject(place, raster.depth[pixel]);
            let corners = triangles[triangle as usize];
            clean.normals.normals[pixel] = (0..3)
                .map(|corner| normals_in_camera[corners[corner] as usize] * barycentric[corner])
                .sum::<Vec3>()
                .normalize_or_zero();
        }
    }
    clean
}

/// An avatar of a 10 mm suit that grows by `growth_m` for each radian of bent knees and elbows.
pub(crate) fn suit_avatar(growth_m: f32) -> Avatar {
    let suit = Suit::new(0.01);
    let skinning = ClosestBodyPoint::new(
        Arc::clone(&suit.model),
        &suit.subject.betas,
        ClosestBodyPointConfig::default(),
    );
    let mut field = InflatedBody::new(&suit.model, &suit.subject, suit.thickness_m);
    field.growth = growth_m / suit.subject.unit_box.metres_per_unit();
    let theta = BodyParams::ZERO.theta;
    Avatar::new(
        &suit.subject,
        Arc::new(field),
        &skinning,
        &theta,
        &TopologyConfig::default(),
    )
    .unwrap()
}
