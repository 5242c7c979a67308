//! How much of a part is one flat face: furniture and walls are mostly flat, bodies are round.

use glam::Vec3;

use crate::mesh::sample::SplitMix;

/// Points looked at; more would not change the answer by more than a few percent.
const SAMPLES: usize = 300;
/// Planes tried: with half the points on one, a triple of them is missed once in 10^4 times.
const HYPOTHESES: usize = 64;

/// The largest share of the points that lie within a distance of one plane.
pub(super) fn flat_share(points: &[Vec3], within_m: f32) -> f32 {
    if points.len() < 3 {
        return 1.0;
    }
    let stride = points.len().div_ceil(SAMPLES);
    let samples: Vec<Vec3> = points.iter().copied().step_by(stride).collect();
    let mut random = SplitMix::new(points.len() as u64);
    let mut most = 0;
    for _ in 0..HYPOTHESES {
        let [a, b, c] = [0; 3].map(|_| samples[random.below(samples.len())]);
        let Some(normal) = (b - a).cross(c - a).try_normalize() else {
            continue;
        };
        let near = samples
            .iter()
            .filter(|&&point| normal.dot(point - a).abs() < within_m)
            .count();
        most = most.max(near);
    }
    most as f32 / samples.len() as f32
}

#[cfg(test)]
mod tests {
    use super::super::super::super::mesh::{
        primitives::{cuboid, sphere},
        sample::sample_surface,
    };
    use super::*;

    #[test]
    fn a_box_is_flat_and_a_ball_is_not() {
        let points = |mesh| {
            sample_surface(&mesh, 2000, 0)
                .iter()
                .map(|sample| sample.point)
                .collect::<Vec<_>>()
        };
        let slab = points(cuboid(Vec3::ZERO, Vec3::new(1.0, 1.0, 0.1)));
        assert!(flat_share(&slab, 0.01) > 0.4);
        let ball = points(sphere(Vec3::ZERO, 0.3, 4));
        assert!(flat_share(&ball, 0.01) < 0.1);
    }
}
