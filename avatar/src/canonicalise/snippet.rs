//! A keyframe's neighbours in time: about ten frames show the same skin and cloth ten times, with ten times the noise of
//! a sensor that has no memory. In canonical space they lie on each other, and each point of the keyframe moves along its
//! normal to where the points around it, of all frames, say the surface is.

use glam::{IVec3, Vec3, ivec3};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::samples::CanonicalSamples;

/// What counts as the same place of the surface.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SnippetConfig {
    /// Points within this have a say, by a bell of half this deviation: wide enough for a few points of every frame, not
    /// much wider than what a sensor resolves at two metres.
    pub radius_m: f32,
    /// ...if their normals are at least this alike: the other side of a sleeve is near too.
    pub min_cosine: f32,
}

impl Default for SnippetConfig {
    fn default() -> Self {
        Self { radius_m: 0.010, min_cosine: 0.7 }
    }
}

/// The keyframe's samples, its points and normals averaged with those of its neighbours; what has no normal stays.
pub(super) fn fused(
    keyframe: CanonicalSamples,
    neighbours: &[CanonicalSamples],
    metres_per_unit: f32,
    config: SnippetConfig,
) -> CanonicalSamples {
    let radius = config.radius_m / metres_per_unit;
    let seen = Seen::new(std::iter::once(&keyframe).chain(neighbours), radius);
    let own: Vec<(Vec3, Vec3)> = (0..keyframe.points_in_unit.len())
        .into_par_iter()
        .with_min_len(256)
        .map(|index| {
            let (point, normal) = (keyframe.points_in_unit[index], keyframe.normals[index]);
            seen.averaged(point, normal, config.min_cosine)
        })
        .collect();
    let (points_in_unit, normals) = own.into_iter().unzip();
    CanonicalSamples { points_in_unit, normals, ..keyframe }
}

/// All frames' points that have a normal, in the order of the cells they lie in.
struct Seen {
    cell_size: f32,
    cells: Vec<u64>,
    points: Vec<SeenPoint>,
}

#[derive(Clone, Copy)]
struct SeenPoint {
    place: Vec3,
    normal: Vec3,
    weight: f32,
}

impl Seen {
    fn new<'a>(frames: impl Iterator<Item = &'a CanonicalSamples>, cell_size: f32) -> Self {
        let mut filed = Vec::new();
        for frame in frames {
            let points = frame.points_in_unit.iter().zip(&frame.normals);
            for ((&place, &normal), &weight) in points.zip(&frame.weights) {
                if normal != Vec3::ZERO && weight > 0.0 {
                    let cell = key((place / cell_size).floor().as_ivec3());
                    filed.push((cell, SeenPoint { place, normal, weight }));
                }
            }
        }
        filed.sort_by_key(|(cell, _)| *cell);
        let (cells, points) = filed.into_iter().unzip();
        Self { cell_size, cells, points }
    }

    /// The points of the 27 cells around a place: all within a cell's size, and more.
    fn around(&self, place: Vec3) -> impl Iterator<Item = &SeenPoint> {
        let middle = (place / self.cell_size).floor().as_ivec3();
        let rows = (-1..=1).flat_map(move |z| (-1..=1).map(move |y| (y, z)));
        // Cells that differ in x alone follow each other.
        rows.flat_map(move |(y, z)| {
            let first = key(middle + ivec3(-1, y, z));
            let from = self.cells.partition_point(|&cell| cell < first);
            let count = self.cells[from..].partition_point(|&cell| cell <= first + 2);
            &self.points[from..from + count]
        })
    }

    /// Moves along the normal by the weighted mean height of the points around; the normal becomes their mean.
    ///
    /// The height of `q` with normal `m` over `p` with normal `n` is `(q - p) . (n + m) / 2`: zero between any two points
    /// of a sphere or a plane, so that averaging does not flatten a limb.
    fn averaged(&self, point: Vec3, normal: Vec3, min_cosine: f32) -> (Vec3, Vec3) {
        if normal == Vec3::ZERO {
            return (point, normal);
        }
        let (mut height, mut sum, mut direction) = (0.0, 0.0, Vec3::ZERO);
        for other in self.around(point) {
            let off = other.place - point;
            // A bell over the distance along the surface: noise across it must not choose.
            let across = off.dot(normal);
            let along_squared = (off.length_squared() - across * across).max(0.0);
            let is_near = along_squared <= self.cell_size * self.cell_size;
            if !is_near || other.normal.dot(normal) < min_cosine {
                continue;
            }
            let bell = (-2.0 * along_squared / (self.cell_size * self.cell_size)).exp();
            let weight = other.weight * bell;
            height += weight * 0.5 * off.dot(normal + other.normal);
            direction += other.normal * weight;
            sum += weight;
        }
        if sum <= 0.0 {
            return (point, normal);
        }
        (
            point + normal * (height / sum),
            direction.normalize_or(normal),
        )
    }
}

/// A number for each cell; x counts by one.
fn key(cell: IVec3) -> u64 {
    /// Cells of millimetres in a box of two units stay far below.
    const SIDE: i64 = 1 << 20;
    let place = |x: i32| i64::from(x) + SIDE / 2;
    let key = (place(cell.z) * SIDE + place(cell.y)) * SIDE + place(cell.x);
    key.cast_unsigned()
}

#[cfg(test)]
mod tests {
    use effigy_registration::smpl::JOINT_COUNT;
    use rand::{SeedableRng as _, rngs::StdRng};
    use rand_distr::{Distribution as _, StandardNormal};

    use super::*;
    use crate::{PoseInput, fine_tune::sampling::random_in_box};

    const RADIUS: f32 = 0.06;

    /// A limb-sized ball, its points off by this much along their normals, its normals by a tenth of a radian.
    fn frame(noise: f32, seed: u64) -> CanonicalSamples {
        let mut rng = StdRng::seed_from_u64(seed);
        let (mut points_in_unit, mut normals) = (Vec::new(), Vec::new());
        for _ in 0..3000 {
            let normal = random_in_box(&mut rng).normalize_or(Vec3::X);
            let off: f32 = StandardNormal.sample(&mut rng);
            points_in_unit.push(normal * (RADIUS + noise * off));
            let tilt = random_in_box(&mut rng) * 0.1 * if noise > 0.0 { 1.0 } else { 0.0 };
            normals.push((normal + tilt).normalize_or_zero());
        }
        CanonicalSamples {
            theta: [Vec3::ZERO; JOINT_COUNT],
            pose: PoseInput {
                rotations: [glam::Mat3::IDENTITY; JOINT_COUNT],
                joints_in_unit: [Vec3::ZERO; JOINT_COUNT],
            },
            weights: vec![1.0; normals.len()],
            points_in_unit,
            normals,
            free_in_unit: Vec::new(),
        }
    }

    fn fuse(noise: f32, neighbours: u64) -> (f32, f32) {
        let others: Vec<_> = (1..=neighbours).map(|seed| frame(noise, seed)).collect();
        let fused = fused(frame(noise, 0), &others, 1.0, SnippetConfig::default());
        let off: Vec<f32> = fused
            .points_in_unit
            .iter()
            .map(|p| p.length() - RADIUS)
            .collect();
        let count = off.len() as f32;
        let rms = (off.iter().map(|x| x * x).sum::<f32>() / count).sqrt();
        (off.iter().sum::<f32>() / count, rms)
    }

    #[test]
    fn ten_frames_have_a_quarter_of_the_noise_of_one() {
        let (bias, rms) = fuse(0.004, 10);
        // Some 25 points have a say; their tilted normals and the bell cost a little.
        assert!(rms < 0.001, "{rms}");
        // As measured: on so small a ball, with such noise, averaging pulls inwards by half a thousandth.
        assert!(bias.abs() < 0.0006, "{bias}");
    }

    #[test]
    fn a_ball_without_noise_stays_what_it_is() {
        let (_, rms) = fuse(0.0, 3);
        // Heights on a ball are zero but for rounding.
        assert!(rms < 1e-5, "{rms}");
    }

    #[test]
    fn the_other_side_of_a_sleeve_has_no_say() {
        let mut sleeve = frame(0.0, 0);
        let mut body = frame(0.0, 1);
        for (point, normal) in body.points_in_unit.iter_mut().zip(&mut body.normals) {
            *point *= 0.95;
            *normal = -*normal;
        }
        sleeve = fused(sleeve, &[body], 1.0, SnippetConfig::default());
        let moved = sleeve
            .points_in_unit
            .iter()
            .map(|p| (p.length() - RADIUS).abs());
        assert!(moved.fold(0.0, f32::max) < 1e-5);
    }
}
