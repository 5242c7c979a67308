//! From posed to canonical space and back, until both ways agree.

use effigy_registration::PosedBody;
use glam::Vec3;
use rayon::prelude::*;

use crate::skinning::{BoneWeights, SkinnedPoint, Skinning, Warp, transform_normal};

/// A point that both ways agree on to this is not moved any more: far below the sensor's noise.
const AGREED_M: f32 = 1e-4;

/// Where posed points lie in canonical space: by inverse skinning, then by rounds of correction with forward skinning.
pub fn canonical_places(
    skinning: &dyn Skinning,
    (posed, warp): (&PosedBody, &Warp),
    points: &[Vec3],
    normals: &[Vec3],
    refine_steps: usize,
) -> Vec<Vec3> {
    if refine_steps == 0 {
        let skinned = skinning.inverse(posed, points, normals);
        let place = |(skinned, &point): (&SkinnedPoint, &Vec3)| {
            warp.canonical_from_posed(&skinned.weights)
                .transform_point3(point)
        };
        return skinned.iter().zip(points).map(place).collect();
    }
    let unposer = Unposer { skinning, posed, warp, refine_steps };
    let unposed = unposer.unpose(points, normals, f32::INFINITY);
    unposed.iter().map(|point| point.canonical).collect()
}

/// One frame's body, and how points around it lose its pose.
pub(super) struct Unposer<'a> {
    pub(super) skinning: &'a dyn Skinning,
    pub(super) posed: &'a PosedBody,
    pub(super) warp: &'a Warp,
    /// Corrections by forward skinning.
    pub(super) refine_steps: usize,
}

/// A posed point's canonical place.
#[derive(Clone, Copy)]
pub(super) struct Unposed {
    pub(super) canonical: Vec3,
    /// Unit, or zero where none was given.
    pub(super) normal: Vec3,
    /// The larger of the distances to the posed and to the canonical body.
    pub(super) distance_to_body_m: f32,
    /// How far the canonical point lands from the posed one when posed again.
    pub(super) miss_m: f32,
}

impl Unposer<'_> {
    /// Inverse skinning, then rounds of `x_star = W(w(x_star))^-1 x_posed` with forward skinning's `w`.
    ///
    /// Points farther than `max_distance_m` from the posed body stay where inverse skinning put them, with
    /// an endless miss.
    pub(super) fn unpose(
        &self,
        points: &[Vec3],
        normals: &[Vec3],
        max_distance_m: f32,
    ) -> Vec<Unposed> {
        let skinned = self.skinning.inverse(self.posed, points, normals);
        let mut unposed: Vec<Unposed> = skinned
            .par_iter()
            .enumerate()
            .with_min_len(256)
            .map(|(index, skinned)| Unposed {
                distance_to_body_m: skinned.distance_to_body_m,
                ..self.place(points[index], normal_at(normals, index), &skinned.weights)
            })
            .collect();
        let mut open: Vec<usize> = (0..points.len())
            .filter(|&index| unposed[index].distance_to_body_m <= max_distance_m)
            .collect();
        let asked_again = self.skinning.looks_around().then(|| open.clone());
        let mut is_open = vec![true; points.len()];
        for round in 0..=self.refine_steps {
            let forward = self.forward(&unposed, &open, normals.is_empty());
            let mut still_open = Vec::new();
            for (&index, skinned) in open.iter().zip(&forward) {
                if !is_open[index] {
                    continue;
                }
                let point = &mut unposed[index];
                let back = self.warp.posed_from_canonical(&skinned.weights);
                point.miss_m = back
                    .transform_point3(point.canonical)
                    .distance(points[index]);
                point.distance_to_body_m = point.distance_to_body_m.max(skinned.distance_to_body_m);
                if point.miss_m > AGREED_M && round < self.refine_steps {
                    let normal = normal_at(normals, index);
                    *point = Unposed {
                        distance_to_body_m: point.distance_to_body_m,
                        ..self.place(points[index], normal, &skinned.weights)
                    };
                    still_open.push(index);
                } else {
                    is_open[index] = false;
                }
            }
            if still_open.is_empty() {
                break;
            }
            open = asked_again.clone().unwrap_or(still_open);
        }
        unposed
    }

    fn forward(&self, unposed: &[Unposed], open: &[usize], bare: bool) -> Vec<SkinnedPoint> {
        let points: Vec<Vec3> = open.iter().map(|&index| unposed[index].canonical).collect();
        let normals: Vec<Vec3> = if bare {
            Vec::new()
        } else {
            open.iter().map(|&index| unposed[index].normal).collect()
        };
        self.skinning.forward(&points, &normals)
    }

    fn place(&self, point: Vec3, normal: Vec3, weights: &BoneWeights) -> Unposed {
        let posed_from_canonical = self.warp.posed_from_canonical(weights);
        Unposed {
            canonical: posed_from_canonical.inverse().transform_point3(point),
            normal: transform_normal(&posed_from_canonical.matrix3, normal),
            distance_to_body_m: 0.0,
            miss_m: f32::INFINITY,
        }
    }
}

fn normal_at(normals: &[Vec3], index: usize) -> Vec3 {
    normals.get(index).copied().unwrap_or(Vec3::ZERO)
}
