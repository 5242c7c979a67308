//! Sleeves stay on: a ring of cloth around an arm may slide and sag, but not leave it.
//!
//! Where a bent forearm is pressed into the upper arm or the trunk, bodies made of skinning weights run into
//! themselves, and cloth between the two surfaces has no place to be. Contacts alone then push it out on either side.

use std::collections::BTreeMap;

use glam::Vec3;

use super::{collider::Arm, form::Form, pattern::Pattern, sheet::Sheet};

/// Rings are this far apart, as a share of the upper arm's or forearm's length, and begin below the armpit.
const SPACING: f32 = 0.1;
const FIRST_STATION: f32 = 0.35;
/// A ring of fewer points is none.
const LEAST_POINTS: usize = 6;
/// How far a ring's middle may be from the arm's, beyond its ease.
const SAG_M: f32 = 0.02;

/// Shoulder, elbow, wrist and hand of both arms.
pub(super) type ArmAxes = [[Vec3; 4]; 2];

/// Points of a sleeve at one station of an arm.
#[derive(Clone, Debug)]
pub(super) struct Ring {
    arm: Arm,
    points: Vec<u32>,
    most_m: f32,
}

/// The rings of a garment's sleeves, each in the order of its points' numbers.
pub(super) fn rings(
    form: &Form,
    pattern: &Pattern,
    sheet: &Sheet,
    arms: &[Option<Arm>],
) -> Vec<Ring> {
    let mut rings: BTreeMap<(usize, u32), Vec<u32>> = BTreeMap::new();
    for (v, (&point, arm)) in sheet.points.iter().zip(arms).enumerate() {
        let Some(arm) = arm else { continue };
        let station = form.place(&form.tree.query(point)).arm;
        if station >= FIRST_STATION {
            let ring = (*arm as usize, (station / SPACING) as u32);
            rings.entry(ring).or_default().push(v as u32);
        }
    }
    let most_m = SAG_M + pattern.ease.limb_m.max(pattern.ease.end_m);
    rings
        .into_iter()
        .filter(|(_, points)| points.len() >= LEAST_POINTS)
        .map(|((arm, _), points)| Ring { arm: Arm::BOTH[arm], points, most_m })
        .collect()
}

impl Ring {
    /// Moves the ring as a whole back around its arm if it has left it.
    pub(super) fn hold(&self, points: &mut [Vec3], axes: &ArmAxes) {
        let aside = self.aside(points, axes);
        let excess_m = aside.length() - self.most_m;
        if excess_m > 0.0 {
            let back = -aside.normalize_or_zero() * excess_m;
            for &v in &self.points {
                points[v as usize] += back;
            }
        }
    }

    /// How far the ring is off its arm beyond what it may be, in metres; negative around it.
    #[cfg(test)]
    pub(super) fn excess_m(&self, points: &[Vec3], axes: &ArmAxes) -> f32 {
        self.aside(points, axes).length() - self.most_m
    }

    /// From the arm's middle to the ring's.
    fn aside(&self, points: &[Vec3], axes: &ArmAxes) -> Vec3 {
        let sum: Vec3 = self.points.iter().map(|&v| points[v as usize]).sum();
        let middle = sum / self.points.len() as f32;
        let axis = &axes[self.arm as usize];
        let nearest = axis
            .windows(2)
            .map(|bone| on_segment(middle, bone[0], bone[1]))
            .min_by(|a, b| {
                a.distance_squared(middle)
                    .total_cmp(&b.distance_squared(middle))
            })
            .unwrap_or(middle);
        middle - nearest
    }
}

fn on_segment(point: Vec3, from: Vec3, to: Vec3) -> Vec3 {
    let along = to - from;
    let share = (point - from).dot(along) / along.length_squared().max(1e-12);
    from + along * share.clamp(0.0, 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ring_that_left_its_arm_is_brought_back_whole() {
        let axes = [
            [Vec3::ZERO, Vec3::X, Vec3::X * 2.0, Vec3::X * 2.2],
            [Vec3::Y; 4],
        ];
        let ring = Ring { arm: Arm::Left, points: vec![0, 1, 2, 3], most_m: 0.03 };
        let around = [Vec3::Y, Vec3::Z, -Vec3::Y, -Vec3::Z].map(|out| Vec3::X * 1.5 + out * 0.06);
        let mut points = around;
        ring.hold(&mut points, &axes);
        assert_eq!(
            points, around,
            "a ring that is around its arm is left alone"
        );
        let mut points = around.map(|point| point + Vec3::Y * 0.2);
        ring.hold(&mut points, &axes);
        for (point, before) in points.iter().zip(around) {
            let moved = *point - before;
            assert!((moved - Vec3::Y * 0.03).length() < 1e-6, "{moved}");
        }
    }
}
