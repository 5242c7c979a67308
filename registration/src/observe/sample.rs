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
    /// What the normal is worth beside the body's own, 0 to 1: little where noise is wider than a few pixels.
    pub(crate) normal_trust: f32,
}

/// Which pixels are taken, and how they are judged.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct SampleConfig {
    pub(crate) points: usize,
    /// Pixels this near to an edge in depth are left out.
    pub(crate) rim_px: usize,
    /// Metres between neighbouring pixels a metre away.
    pub(crate) pixel_pitch: f32,
    /// The normal's error in radians for noise as wide as a pixel.
    pub(crate) normal_error_rad: f32,
}

/// Takes about `config.points` of the person's pixels, on a lattice over the image.
pub(crate) fn sample(
    clean: &CleanFrame,
    world_from_camera: Rigid3,
    person_px: usize,
    config: &SampleConfig,
) -> Vec<DataPoint> {
    let every = (person_px / config.points.max(1)).max(1);
    // A lattice with `every` pixels a cell: each row shifts by half a cell, so that columns do not line up.
    let stride = (every as f32).sqrt();
    let (width, height) = (clean.vertices.width, clean.vertices.height);
    let mut points = Vec::with_capacity(config.points + config.points / 4);
    let mut row = 0;
    loop {
        let y = (row as f32 * stride) as usize;
        if y >= height {
            return points;
        }
        let mut x = if row % 2 == 0 { 0.0 } else { 0.5 * stride };
        while (x as usize) < width {
            let i = y * width + x as usize;
            if clean.person[i] && !is_rim(clean, [x as usize, y], config.rim_px) {
                points.extend(point_at(clean, world_from_camera, i, config));
            }
            x += stride;
        }
        row += 1;
    }
}

/// Whether the surface ends within so many pixels: what is measured there is a mixture, or a neighbour's.
fn is_rim(clean: &CleanFrame, [x, y]: [usize; 2], rim_px: usize) -> bool {
    if rim_px == 0 {
        return false;
    }
    /// A larger step, beside the noise, is another surface.
    const STEP_M: f32 = 0.06;
    let (width, height) = (clean.vertices.width, clean.vertices.height);
    let here = y * width + x;
    let depth_m = clean.vertices.points[here].z;
    let step_m = STEP_M + 3.0 * clean.sigma_m[here];
    let ends_at = |x: usize, y: usize| {
        let inside = x < width && y < height;
        let near = inside && (clean.vertices.points[y * width + x].z - depth_m).abs() < step_m;
        !near
    };
    ends_at(x.wrapping_sub(rim_px), y)
        || ends_at(x + rim_px, y)
        || ends_at(x, y.wrapping_sub(rim_px))
        || ends_at(x, y + rim_px)
}

fn point_at(
    clean: &CleanFrame,
    world_from_camera: Rigid3,
    i: usize,
    config: &SampleConfig,
) -> Option<DataPoint> {
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
        normal_trust: normal_trust(sigma_m / (config.pixel_pitch * position.z), config),
    })
}

/// The body's own normal is off by some 0.3 rad; the measured one by what noise makes of it.
fn normal_trust(noise_px: f32, config: &SampleConfig) -> f32 {
    const BODY_RAD: f32 = 0.3;
    let error_rad = config.normal_error_rad * noise_px;
    BODY_RAD * BODY_RAD / (BODY_RAD * BODY_RAD + error_rad * error_rad)
}
