//! Whether a sensor errs more where a surface is turned away, from a depth image alone.
//!
//! One over depth is linear in the image over any plane, and for a stereo camera it is disparity over `f B`: what is
//! left of it beside a plane fitted to the 7x7 pixels around is noise, whatever the plane's angle.

use effigy_capture::Intrinsics;
use glam::{Vec3, vec3};

/// Angles between ray and normal that bound the classes.
pub const SLANTS_DEG: [f32; 5] = [0.0, 20.0, 40.0, 55.0, 70.0];

/// Noise of the pixels of one class.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Slanted {
    /// Robust deviation of one over depth from the plane around, in 1/m; times `f B` it is pixels of disparity.
    pub sigma_per_m: f64,
    pub pixels: usize,
}

const RADIUS: i64 = 3;
/// Pixels of one surface are no further apart in depth than this, each from the next.
const SURFACE_M: f32 = 0.012;

/// Measures a depth image in metres, row-major, 0 for no answer; one result for each class of angles.
pub fn noise_by_slant(depth_m: &[f32], camera: &Intrinsics, mask: &[bool]) -> [Slanted; 4] {
    let (width, height) = (i64::from(camera.width), i64::from(camera.height));
    let mut sizes: [Vec<f64>; 4] = Default::default();
    for y in RADIUS..height - RADIUS {
        for x in RADIUS..width - RADIUS {
            let Some((incidence_rad, off_per_m)) = beside_plane(depth_m, camera, mask, [x, y])
            else {
                continue;
            };
            let class = SLANTS_DEG[1..]
                .iter()
                .position(|&end| incidence_rad < end.to_radians());
            if let Some(class) = class {
                sizes[class].push(off_per_m.abs());
            }
        }
    }
    sizes.map(|mut sizes| {
        sizes.sort_by(f64::total_cmp);
        let median = sizes.get(sizes.len() / 2).copied().unwrap_or(0.0);
        Slanted { sigma_per_m: 1.4826 * median, pixels: sizes.len() }
    })
}

/// The angle of the plane around a pixel, and the pixel's one over depth less the plane's.
fn beside_plane(
    depth_m: &[f32],
    camera: &Intrinsics,
    mask: &[bool],
    [x, y]: [i64; 2],
) -> Option<(f32, f64)> {
    let width = i64::from(camera.width);
    let (mut sum, mut along_x, mut along_y) = (0.0, 0.0, 0.0);
    // The pixel before in this row, and the first of the row above.
    let (mut last_m, mut above_m) = (f32::NAN, f32::NAN);
    for down in -RADIUS..=RADIUS {
        for right in -RADIUS..=RADIUS {
            let pixel = ((y + down) * width + x + right) as usize;
            let z = depth_m[pixel];
            let beside_m = if right > -RADIUS { last_m } else { above_m };
            if !mask[pixel] || z <= 0.0 || (beside_m - z).abs() > SURFACE_M {
                return None;
            }
            if right == -RADIUS {
                above_m = z;
            }
            last_m = z;
            let inverse = f64::from(1.0 / z);
            sum += inverse;
            along_x += right as f64 * inverse;
            along_y += down as f64 * inverse;
        }
    }
    let side = (2 * RADIUS + 1) as f64;
    let squares = side * (1..=RADIUS).map(|d| 2 * d * d).sum::<i64>() as f64;
    let (mean, per_x, per_y) = (sum / (side * side), along_x / squares, along_y / squares);
    let ray = vec3(
        (x as f32 - camera.cx) / camera.fx,
        (y as f32 - camera.cy) / camera.fy,
        1.0,
    );
    // 1/z = normal . ray / offset, so that its slopes are the normal's parts.
    let aside = [per_x as f32 * camera.fx, per_y as f32 * camera.fy];
    let ahead = mean as f32 - aside[0] * ray.x - aside[1] * ray.y;
    let normal = Vec3::new(aside[0], aside[1], ahead).normalize_or_zero();
    let incidence_rad = (normal.dot(ray.normalize_or_zero())).abs().min(1.0).acos();
    let here = f64::from(1.0 / depth_m[(y * width + x) as usize]);
    Some((incidence_rad, here - mean))
}
