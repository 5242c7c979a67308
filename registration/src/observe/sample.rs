//! A regular sample of the person's pixels.

use effigy_capture::Rigid3;
use effigy_fusion::CleanFrame;
use glam::Vec3;

/// One measured point of the person, in the world.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct DataPoint {
    pub(crate) position: Vec3,
    /// Towards the camera's side.
    pub(crate) normal: Vec3,
    pub(crate) sigma_m: f32,
}

/// Takes about `count` of the person's pixels, of which there are `person_px`, on a lattice over the image.
pub(crate) fn sample(
    clean: &CleanFrame,
    world_from_camera: Rigid3,
    person_px: usize,
    count: usize,
) -> Vec<DataPoint> {
    let every = (person_px / count.max(1)).max(1);
    // A lattice with `every` pixels a cell: each row shifts by half a cell, so that columns do not line up.
    let stride = (every as f32).sqrt();
    let (width, height) = (clean.vertices.width, clean.vertices.height);
    let mut points = Vec::with_capacity(count + count / 4);
    let mut row = 0;
    loop {
        let y = (row as f32 * stride) as usize;
        if y >= height {
            return points;
        }
        let mut x = if row % 2 == 0 { 0.0 } else { 0.5 * stride };
        while (x as usize) < width {
            let i = y * width + x as usize;
            if clean.person[i] {
                points.extend(point_at(clean, world_from_camera, i));
            }
            x += stride;
        }
        row += 1;
    }
}

fn point_at(clean: &CleanFrame, world_from_camera: Rigid3, i: usize) -> Option<DataPoint> {
    let (position, normal) = (clean.vertices.points[i], clean.normals.normals[i]);
    if !position.is_finite() || !normal.is_finite() {
        return None;
    }
    let sigma_m = clean.sigma_m[i];
    let sigma_m = if sigma_m.is_finite() {
        sigma_m.clamp(5e-4, 0.05)
    } else {
        0.01
    };
    Some(DataPoint {
        position: world_from_camera * position,
        normal: world_from_camera.rotate(normal),
        sigma_m,
    })
}
