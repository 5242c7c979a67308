//! What a sensor could see of a clothed person: skin, shoes, hair and every garment in one mesh, posed and in
//! star pose, with hidden triangles left out on request.

use effigy_capture::Intrinsics;
use effigy_fusion::mesh::{
    TriangleMesh,
    z_buffer::{Faces, Rasterizer},
};
use effigy_registration::smpl::{VertexWeights, star_transforms};
use glam::{Mat3, Vec3};

use super::{
    collider::Collider,
    sheet::NONE,
    wear::{Wear, bones_of},
};

/// Skin this close under or over a garment that faces the same way is under it.
const TUCK_REACH_M: f32 = 0.010;
/// So is a garment this close under or over one that is worn over it: where arms are raised, shirts come through jackets.
const LAYER_REACH_M: f32 = 0.030;
/// What is under a garment is drawn at least this far below it.
const TUCK_M: f32 = 0.003;
/// What is this close under a garment, or over it, cannot be seen: the gap is too narrow to look into.
const COVERED_M: f32 = 0.020;
/// Cameras around a person for finding what can be seen: azimuths, height in radians, all from this far.
const RINGS: [(usize, f32); 4] = [(10, 0.0), (8, 0.6), (6, -0.45), (1, 1.45)];
const CAMERA_M: f32 = 7.0;
const VIEW_PX: u32 = 320;

/// A clothed person in one frame. The vertices of both surfaces, weights and layers correspond, in every frame.
#[derive(Clone, Debug)]
pub struct ClothedSurface {
    /// In the space of the pose's `trans`, with normals.
    pub posed: TriangleMesh,
    /// The same surface in star pose, with the normals of that very surface.
    pub canonical: TriangleMesh,
    pub weights: Vec<VertexWeights>,
    /// 0 for the person, 1 for the innermost garment, and so on.
    pub layers: Vec<u8>,
}

impl Wear {
    /// Posed surface, skinning weights and layers of everything that is worn, hidden parts included.
    pub(crate) fn posed_surface(&self) -> (TriangleMesh, Vec<VertexWeights>, Vec<u8>) {
        let body = &self.person().body;
        let mut vertices = self.body_points().to_vec();
        let mut triangles = body.triangles.clone();
        let mut weights = body.skinning.clone();
        let mut layers = vec![0; vertices.len()];
        for ((number, garment), points) in self.garments().iter().enumerate().zip(self.points()) {
            let first = vertices.len() as u32;
            triangles.extend(garment.rest.triangles.iter().map(|t| t.map(|v| v + first)));
            vertices.extend(points);
            weights.extend(&garment.weights);
            layers.resize(vertices.len(), number as u8 + 1);
        }
        let mut posed = TriangleMesh::new(vertices, triangles);
        posed.compute_normals();
        tuck(&mut posed, &layers, self.layers());
        leave_out_covered(&mut posed, &layers, self.layers());
        posed.compute_normals();
        (posed, weights, layers)
    }

    /// Everything that is worn, hidden parts included.
    pub fn surface(&self) -> ClothedSurface {
        let (posed, weights, layers) = self.posed_surface();
        let mut canonical = TriangleMesh::new(
            self.in_star_pose(&posed.vertices, &weights),
            posed.triangles.clone(),
        );
        canonical.compute_normals();
        ClothedSurface { posed, canonical, weights, layers }
    }

    /// Posed points with these weights, moved to star pose.
    pub(super) fn in_star_pose(&self, points: &[Vec3], weights: &[VertexWeights]) -> Vec<Vec3> {
        let person = self.person();
        let bones = bones_of(person, &self.pose().theta);
        let star = star_transforms(&person.rest_joints);
        let trans = self.pose().trans;
        (points.iter().zip(weights))
            .map(|(&point, weights)| {
                let at_rest = bones
                    .blend(weights)
                    .inverse()
                    .transform_point3(point - trans);
                star.blend(weights).transform_point3(at_rest)
            })
            .collect()
    }
}

/// Draws what is under a garment below it, so that it does not show through between the cloth's points.
fn tuck(mesh: &mut TriangleMesh, layers: &[u8], garments: &[Collider]) {
    for (v, &layer) in layers.iter().enumerate() {
        let reach_m = if layer == 0 {
            TUCK_REACH_M
        } else {
            LAYER_REACH_M
        };
        for garment in garments.iter().skip(layer as usize) {
            let Some(touch) = garment.nearest(mesh.vertices[v], reach_m, NONE) else {
                continue;
            };
            if !touch.on_rim
                && touch.distance_m > -TUCK_M
                && touch.normal.dot(mesh.normals[v]) > 0.3
            {
                mesh.vertices[v] -= touch.normal * (touch.distance_m + TUCK_M);
            }
        }
    }
}

/// Drops the triangles of garments that lie close under another one: where that is folded, they would come out between
/// its points.
fn leave_out_covered(mesh: &mut TriangleMesh, layers: &[u8], garments: &[Collider]) {
    let is_covered = |v: usize| {
        let mut over = garments.iter().skip(layers[v] as usize);
        layers[v] > 0
            && over.any(|garment| {
                let touch = garment.nearest(mesh.vertices[v], COVERED_M, NONE);
                touch.is_some_and(|touch| !touch.on_rim)
            })
    };
    let covered: Vec<bool> = (0..layers.len()).map(is_covered).collect();
    mesh.triangles
        .retain(|corners| !corners.iter().all(|&v| covered[v as usize]));
}

impl ClothedSurface {
    /// The outer envelope: only triangles whose outside can be seen from somewhere around.
    pub fn envelope(mut self) -> Self {
        let seen = seen_from_around(&self.posed);
        let mut on_seen = vec![false; self.posed.vertices.len()];
        for (triangle, corners) in self.posed.triangles.iter().enumerate() {
            if seen[triangle] {
                for &v in corners {
                    on_seen[v as usize] = true;
                }
            }
        }
        // A triangle too narrow for a pixel is seen where all that is around it is.
        let kept = |triangle: usize, corners: &[u32; 3]| {
            seen[triangle] || corners.iter().all(|&v| on_seen[v as usize])
        };
        let triangles: Vec<[u32; 3]> = (self.posed.triangles.iter().enumerate())
            .filter(|(triangle, corners)| kept(*triangle, corners))
            .map(|(_, corners)| *corners)
            .collect();
        self.posed.triangles.clone_from(&triangles);
        self.canonical.triangles = triangles;
        self
    }
}

/// For each triangle, whether its outside is seen by one of many cameras around.
fn seen_from_around(mesh: &TriangleMesh) -> Vec<bool> {
    let mut seen = vec![false; mesh.triangles.len()];
    let (mut min, mut max) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    for &vertex in &mesh.vertices {
        min = min.min(vertex);
        max = max.max(vertex);
    }
    let middle = 0.5 * (min + max);
    let half_m = (0.5 * (max - min).length()).max(0.1);
    let focal_px = 0.5 * VIEW_PX as f32 * (CAMERA_M - half_m) / half_m;
    let center_px = 0.5 * (VIEW_PX - 1) as f32;
    let camera = Intrinsics {
        width: VIEW_PX,
        height: VIEW_PX,
        fx: focal_px,
        fy: focal_px,
        cx: center_px,
        cy: center_px,
    };
    let mut rasterizer = Rasterizer::with_faces(camera, Faces::Both);
    let mut in_camera = Vec::with_capacity(mesh.vertices.len());
    for (count, height_rad) in RINGS {
        for number in 0..count {
            let azimuth_rad =
                std::f32::consts::TAU * (number as f32 + 0.5 * height_rad) / count as f32;
            let camera_from_world = towards_camera(azimuth_rad, height_rad);
            in_camera.clear();
            in_camera.extend(
                mesh.vertices
                    .iter()
                    .map(|&v| camera_from_world * (v - middle) + Vec3::Z * CAMERA_M),
            );
            let raster = rasterizer.draw(&in_camera, &mesh.triangles);
            for &triangle in &raster.triangle {
                let Some(corners) = mesh.triangles.get(triangle as usize) else {
                    continue;
                };
                let [a, b, c] = corners.map(|v| in_camera[v as usize]);
                seen[triangle as usize] |= (b - a).cross(c - a).dot(a) < 0.0;
            }
        }
    }
    seen
}

/// The rotation into a camera (x right, y down, z forward) that looks at the person from there.
fn towards_camera(azimuth_rad: f32, height_rad: f32) -> Mat3 {
    let (sin, cos) = height_rad.sin_cos();
    let from = Vec3::new(azimuth_rad.sin() * cos, sin, azimuth_rad.cos() * cos);
    let forward = -from;
    let right = forward.cross(Vec3::Y).normalize_or(Vec3::X);
    let down = forward.cross(right);
    Mat3::from_cols(right, down, forward).transpose()
}
