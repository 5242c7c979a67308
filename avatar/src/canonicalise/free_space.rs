//! Points the camera saw to be empty: in front of the person's surface, and beside the person's outline.

use effigy_fusion::{CleanFrame, maps::Rays};
use effigy_registration::RegisteredFrame;
use glam::Vec3;
use rand::{RngExt as _, rngs::StdRng};

use super::CanonicaliseConfig;

/// Candidates drawn for each point wanted: most of those beside the outline lie too far from the body.
const CANDIDATES: usize = 3;
/// Empty points beside the outline lie within this of the depth of the person's nearest pixel.
const BESIDE_DEPTH_M: f32 = 0.12;
/// And at least this far in front of what the background pixel saw.
const BEFORE_BACKGROUND_M: f32 = 0.04;

/// Empty points in world space, in random order.
pub(super) fn points_in_world(
    frame: &RegisteredFrame,
    rays: Option<&Rays>,
    config: &CanonicaliseConfig,
    rng: &mut StdRng,
) -> Vec<Vec3> {
    let wanted = config.free_points.div_ceil(2) * CANDIDATES;
    let in_front = in_front(&frame.clean, config, wanted, rng);
    let beside = rays
        .filter(|rays| rays.on_unit_plane.len() == frame.clean.depth.metres.len())
        .map(|rays| beside(&frame.clean, rays, config, wanted, rng))
        .unwrap_or_default();
    // Taken in turn, so that cutting the list later keeps both kinds.
    let mut points: Vec<Vec3> = Vec::with_capacity(in_front.len() + beside.len());
    for index in 0..in_front.len().max(beside.len()) {
        points.extend(in_front.get(index));
        points.extend(beside.get(index));
    }
    points
        .iter()
        .map(|&point| frame.world_from_camera * point)
        .collect()
}

/// Points on the rays to the person's surface, between the camera and what was seen.
fn in_front(
    clean: &CleanFrame,
    config: &CanonicaliseConfig,
    wanted: usize,
    rng: &mut StdRng,
) -> Vec<Vec3> {
    let seen: Vec<usize> = (0..clean.person.len())
        .filter(|&pixel| clean.person[pixel] && clean.vertices.points[pixel].is_finite())
        .collect();
    let [nearest, farthest] = config.free_in_front_m;
    if seen.is_empty() || nearest >= farthest {
        return Vec::new();
    }
    (0..wanted)
        .map(|_| {
            let point = clean.vertices.points[seen[rng.random_range(0..seen.len())]];
            // Squared, so that most lie close to the surface, where they say most.
            let share: f32 = rng.random_range(0.0..1.0_f32).powi(2);
            let towards_camera = -point.normalize_or_zero();
            point + towards_camera * (nearest + share * (farthest - nearest))
        })
        .collect()
}

/// Points on the rays just beside the person's outline, at about the person's depth.
fn beside(
    clean: &CleanFrame,
    rays: &Rays,
    config: &CanonicaliseConfig,
    wanted: usize,
    rng: &mut StdRng,
) -> Vec<Vec3> {
    let outline = outline(clean, config.beside_outline_px);
    if outline.is_empty() {
        return Vec::new();
    }
    (0..wanted)
        .filter_map(|_| {
            let (pixel, person_depth_m) = outline[rng.random_range(0..outline.len())];
            let background_m = clean.depth.metres[pixel];
            let depth_m = person_depth_m + rng.random_range(-BESIDE_DEPTH_M..BESIDE_DEPTH_M);
            let empty = depth_m > 0.0 && depth_m < background_m - BEFORE_BACKGROUND_M;
            empty.then(|| rays.point(pixel, depth_m))
        })
        .collect()
}

/// Background pixels with a measurement near the person's outline, and the depth of the person there.
fn outline(clean: &CleanFrame, [nearest_px, farthest_px]: [u32; 2]) -> Vec<(usize, f32)> {
    let (width, height) = (clean.depth.width, clean.depth.height);
    // The person's depth spreads one pixel outwards a round.
    let mut depth_of_person: Vec<f32> = (0..width * height)
        .map(|pixel| {
            if clean.person[pixel] {
                clean.depth.metres[pixel]
            } else {
                f32::NAN
            }
        })
        .collect();
    let mut reached: Vec<bool> = clean.person.clone();
    let mut border: Vec<usize> = (0..width * height)
        .filter(|&pixel| reached[pixel])
        .collect();
    let mut found = Vec::new();
    for distance_px in 1..=farthest_px {
        let mut next = Vec::new();
        for &pixel in &border {
            for neighbor in neighbors(pixel, width, height) {
                if reached[neighbor] {
                    continue;
                }
                reached[neighbor] = true;
                depth_of_person[neighbor] = depth_of_person[pixel];
                next.push(neighbor);
                let measured = clean.depth.metres[neighbor].is_finite();
                if distance_px >= nearest_px && measured && depth_of_person[neighbor].is_finite() {
                    found.push((neighbor, depth_of_person[neighbor]));
                }
            }
        }
        border = next;
    }
    found
}

fn neighbors(pixel: usize, width: usize, height: usize) -> impl Iterator<Item = usize> {
    let (x, y) = (pixel % width, pixel / width);
    [
        (x > 0).then(|| pixel - 1),
        (x + 1 < width).then(|| pixel + 1),
        (y > 0).then(|| pixel - width),
        (y + 1 < height).then(|| pixel + width),
    ]
    .into_iter()
    .flatten()
}
