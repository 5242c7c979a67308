//! What a beholder would see of a difference: normals rendered from several sides.
//!
//! MetaAvatar asked people which of two animations looks better. In place of people: how far rendered normals are off,
//! and whether there is as much fine structure in them (folds, seams) as there is in the truth.

use effigy_capture::Intrinsics;
use effigy_fusion::{
    TriangleMesh,
    mesh::{normals::vertex_normals, z_buffer::Rasterizer},
};
use glam::{Quat, Vec3};
use serde::{Deserialize, Serialize};

/// Means over the views.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct RenderedNormals {
    /// Mean angle between the normals where both surfaces are seen.
    pub off_deg: f32,
    /// Fine structure of the prediction over that of the truth, as root mean squares: below one it is too smooth, above
    /// one too rough.
    pub fine_ratio: f32,
    /// Correlation of the two fine structures: whether folds are where they should be.
    pub fine_correlation: f32,
}

/// Front, left, back, right.
const VIEWS: usize = 4;
/// A pixel is 6 mm of an adult.
const CAMERA: Intrinsics =
    Intrinsics { width: 360, height: 360, fx: 500.0, fy: 500.0, cx: 179.5, cy: 179.5 };
const DISTANCE_M: f32 = 3.0;
/// What is left when a bell of this deviation is taken off is fine: wavelengths below some 10 cm.
const BLUR_PX: f32 = 3.0;

/// Compares two surfaces in one space, y up; `None` if there is nothing to see of either.
pub fn rendered_normals(truth: &TriangleMesh, predicted: &TriangleMesh) -> Option<RenderedNormals> {
    let middle = middle(truth)?;
    let mut sums = Sums::default();
    for view in 0..VIEWS {
        let yaw_rad = view as f32 * std::f32::consts::TAU / VIEWS as f32;
        let (seen, found) = (
            normals(truth, middle, yaw_rad),
            normals(predicted, middle, yaw_rad),
        );
        let both: Vec<bool> = seen
            .iter()
            .zip(&found)
            .map(|(a, b)| *a != Vec3::ZERO && *b != Vec3::ZERO)
            .collect();
        let (fine_seen, fine_found) = (fine(&seen, &both), fine(&found, &both));
        for pixel in (0..both.len()).filter(|&pixel| both[pixel]) {
            sums.add(
                seen[pixel],
                found[pixel],
                fine_seen[pixel],
                fine_found[pixel],
            );
        }
    }
    sums.means()
}

#[derive(Default)]
struct Sums {
    pixels: f64,
    angle_rad: f64,
    seen: f64,
    found: f64,
    product: f64,
}

impl Sums {
    fn add(&mut self, seen: Vec3, found: Vec3, fine_seen: Vec3, fine_found: Vec3) {
        self.pixels += 1.0;
        self.angle_rad += f64::from(seen.dot(found).clamp(-1.0, 1.0).acos());
        self.seen += f64::from(fine_seen.length_squared());
        self.found += f64::from(fine_found.length_squared());
        self.product += f64::from(fine_seen.dot(fine_found));
    }

    fn means(&self) -> Option<RenderedNormals> {
        (self.pixels > 0.0 && self.seen > 0.0 && self.found > 0.0).then(|| RenderedNormals {
            off_deg: (self.angle_rad / self.pixels).to_degrees() as f32,
            fine_ratio: (self.found / self.seen).sqrt() as f32,
            fine_correlation: (self.product / (self.seen * self.found).sqrt()) as f32,
        })
    }
}

/// Of the bounding box of what triangles use.
fn middle(mesh: &TriangleMesh) -> Option<Vec3> {
    let used = || {
        mesh.triangles
            .iter()
            .flatten()
            .map(|&v| mesh.vertices[v as usize])
    };
    let low = used().reduce(Vec3::min)?;
    let high = used().reduce(Vec3::max)?;
    Some((low + high) * 0.5)
}

/// Unit normals of the pixels, in the mesh's space; zero where there is nothing.
fn normals(mesh: &TriangleMesh, middle: Vec3, yaw_rad: f32) -> Vec<Vec3> {
    let camera_from_mesh =
        Quat::from_rotation_x(std::f32::consts::PI) * Quat::from_rotation_y(-yaw_rad);
    let in_camera: Vec<Vec3> = mesh
        .vertices
        .iter()
        .map(|&vertex| camera_from_mesh * (vertex - middle) + Vec3::Z * DISTANCE_M)
        .collect();
    let of_vertices = vertex_normals(&mesh.vertices, &mesh.triangles);
    let mut rasterizer = Rasterizer::new(CAMERA);
    let raster = rasterizer.draw(&in_camera, &mesh.triangles);
    (0..raster.depth.len())
        .map(|pixel| {
            let Some((triangle, weights)) = raster.hit(pixel) else {
                return Vec3::ZERO;
            };
            let corners = mesh.triangles[triangle as usize];
            let normal: Vec3 = (0..3)
                .map(|k| of_vertices[corners[k] as usize] * weights[k])
                .sum();
            normal.normalize_or_zero()
        })
        .collect()
}

/// Normals less their blurred selves, both over the masked pixels alone.
fn fine(normals: &[Vec3], mask: &[bool]) -> Vec<Vec3> {
    let (width, height) = (CAMERA.width as usize, CAMERA.height as usize);
    let masked: Vec<(Vec3, f32)> = normals
        .iter()
        .zip(mask)
        .map(|(&normal, &on)| if on { (normal, 1.0) } else { (Vec3::ZERO, 0.0) })
        .collect();
    let along_x = blurred(&masked, width, 1, |pixel| pixel % width);
    let blurred = blurred(&along_x, height, width, |pixel| pixel / width);
    normals
        .iter()
        .zip(&blurred)
        .map(|(&normal, &(sum, weight))| normal - sum / weight.max(1e-6))
        .collect()
}

/// One pass of a bell: `stride` from pixel to pixel, `place` along the way of `length`.
fn blurred(
    image: &[(Vec3, f32)],
    length: usize,
    stride: usize,
    place: impl Fn(usize) -> usize,
) -> Vec<(Vec3, f32)> {
    let reach = (2.5 * BLUR_PX) as isize;
    let bell: Vec<f32> = (-reach..=reach)
        .map(|step| (-0.5 * (step as f32 / BLUR_PX).powi(2)).exp())
        .collect();
    (0..image.len())
        .map(|pixel| {
            let here = place(pixel) as isize;
            let (mut sum, mut weight) = (Vec3::ZERO, 0.0);
            for (step, &share) in (-reach..=reach).zip(&bell) {
                if (0..length as isize).contains(&(here + step)) {
                    let at = (pixel as isize + step * stride as isize) as usize;
                    sum += image[at].0 * share;
                    weight += image[at].1 * share;
                }
            }
            (sum, weight)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use effigy_fusion::mesh::primitives::sphere;

    use super::*;

    /// A ball with ripples of this depth around its axis.
    fn rippled(depth_m: f32) -> TriangleMesh {
        let mut mesh = sphere(Vec3::Y, 0.5, 6);
        for vertex in &mut mesh.vertices {
            let radial = *vertex - Vec3::Y;
            let ripple = (radial.y * 120.0).sin() * depth_m;
            *vertex += radial.normalize_or_zero() * ripple;
        }
        mesh
    }

    #[test]
    fn a_surface_is_as_fine_as_itself_and_not_off() {
        let mesh = rippled(0.003);
        let scores = rendered_normals(&mesh, &mesh).unwrap();
        assert!(scores.off_deg < 0.1, "{scores:?}");
        assert!((scores.fine_ratio - 1.0).abs() < 1e-3 && scores.fine_correlation > 0.999);
    }

    #[test]
    fn a_smooth_surface_lacks_the_fine_structure_of_a_rippled_one() {
        let scores = rendered_normals(&rippled(0.003), &rippled(0.0)).unwrap();
        assert!(scores.fine_ratio < 0.5, "{scores:?}");
        assert!(scores.off_deg > 5.0, "{scores:?}");
        let shallow = rendered_normals(&rippled(0.003), &rippled(0.002)).unwrap();
        assert!(shallow.fine_correlation > 0.9, "{shallow:?}");
        assert!(shallow.off_deg < scores.off_deg);
    }
}
