//! Folds: what bending a joint does to the cloth around it.
//!
//! Where a limb bends towards a side, the cloth of that side is pushed together and stands up in folds across
//! the limb; on the other side it is pulled tight; twisting winds folds around it. All of it is a smooth
//! function of the joint's own rotation `R - I`, so that it can be learnt from pose.

use effigy_registration::smpl::JOINT_COUNT;
use glam::{Mat3, Vec3};

use super::{chart::Chart, outfit::Garment};
use crate::random::Randomness;

/// Joints whose bending folds a shirt, and how far along the body that reaches, in metres.
pub(super) const SHIRT_JOINTS: &[(usize, f32)] = &[
    (16, 0.12),
    (17, 0.12),
    (18, 0.11),
    (19, 0.11),
    (3, 0.10),
    (6, 0.11),
    (9, 0.10),
];
pub(super) const TROUSER_JOINTS: &[(usize, f32)] = &[(1, 0.14), (2, 0.14), (4, 0.13), (5, 0.13)];

/// Trunk rotations are shared by three joints, so each of them folds more for its angle.
const TRUNK_GAIN: f32 = 2.2;
/// How far folds wander along the limb for a unit of bending, in wavelengths.
const WANDER: f32 = 0.45;
/// Turns around the limb that a twisted fold makes.
const SPIRALS: f32 = 2.0;

/// The effect of one joint on one vertex.
#[derive(Clone, Copy, Debug)]
pub(super) struct Fold {
    joint: u8,
    /// From the joint towards the limb's end, in the zero pose.
    axis: Vec3,
    /// The vertex's outward normal.
    normal: Vec3,
    /// 1 at the joint, 0 far from it.
    share: f32,
    /// Phases of folds across and around the limb, in radians.
    across: f32,
    around: f32,
}

/// Folds of one garment, for each vertex.
#[derive(Clone, Debug, Default)]
pub(super) struct Folds {
    starts: Vec<u32>,
    folds: Vec<Fold>,
}

impl Folds {
    pub(super) fn new(
        chart: &Chart,
        garment: &Garment,
        joints: &[(usize, f32)],
        random: Randomness,
    ) -> Self {
        let mut folds = Vec::new();
        let mut starts = vec![0];
        for v in 0..chart.vertices.len() {
            for &(joint, reach_m) in joints {
                folds.extend(fold(
                    chart,
                    v,
                    joint,
                    reach_m,
                    garment.fold_wavelength_m,
                    random,
                ));
            }
            starts.push(folds.len() as u32);
        }
        Self { starts, folds }
    }

    /// Height in units of the garment's `fold_m`, and how tight the cloth is pulled (0 to 1).
    pub(super) fn at(&self, vertex: usize, bends: &[Mat3; JOINT_COUNT]) -> (f32, f32) {
        let range = self.starts[vertex] as usize..self.starts[vertex + 1] as usize;
        let mut height = 0.0;
        let mut tight = 0.0;
        for fold in &self.folds[range] {
            let (h, t) = fold.height(&bends[fold.joint as usize]);
            height += h;
            tight += t;
        }
        (soft_limit(height, 1.4), tight.min(1.0))
    }
}

impl Fold {
    fn height(&self, bend: &Mat3) -> (f32, f32) {
        let gain = if matches!(self.joint, 3 | 6 | 9) {
            TRUNK_GAIN
        } else {
            1.0
        };
        // Positive where the limb comes towards this side.
        let pushed = gain * (*bend * self.axis).dot(self.normal);
        let twist = gain * 0.5 * axial(bend).dot(self.axis);
        let gathered = soft_limit(pushed.max(0.0) * 1.5, 1.0);
        let ring = ridge(self.across + std::f32::consts::TAU * WANDER * pushed);
        let wound = soft_limit(1.2 * twist.abs(), 0.8);
        let spiral = ridge(self.across + SPIRALS * self.around * twist.signum() + 2.0 * twist);
        // Cloth that is pushed together also stands away from the limb as a whole.
        let height = self.share * (gathered * (ring + 0.45) + 0.8 * wound * spiral);
        (
            height,
            self.share * soft_limit((-pushed).max(0.0) * 1.2, 0.8),
        )
    }
}

/// Twice the sine of the angle times the axis, from `R - I`.
fn axial(bend: &Mat3) -> Vec3 {
    Vec3::new(
        bend.y_axis.z - bend.z_axis.y,
        bend.z_axis.x - bend.x_axis.z,
        bend.x_axis.y - bend.y_axis.x,
    )
}

/// A wave with narrow crests and wide valleys; mean near 0, from -0.7 to 1.3.
fn ridge(phase: f32) -> f32 {
    phase.sin() - 0.3 * (2.0 * phase).cos()
}

/// `x` for small, never beyond the limit.
fn soft_limit(x: f32, limit: f32) -> f32 {
    limit * (x / limit).tanh()
}

fn fold(
    chart: &Chart,
    v: usize,
    joint: usize,
    reach_m: f32,
    wavelength_m: f32,
    random: Randomness,
) -> Option<Fold> {
    let end = [
        (1, 4),
        (2, 5),
        (4, 7),
        (5, 8),
        (3, 6),
        (6, 9),
        (9, 12),
        (16, 18),
        (17, 19),
        (18, 20),
        (19, 21),
    ]
    .iter()
    .find(|(from, _)| *from == joint)?
    .1;
    let axis = (chart.joints[end] - chart.joints[joint]).try_normalize()?;
    let from_joint = chart.vertices[v] - chart.joints[joint];
    let along = from_joint.dot(axis);
    let aside = from_joint.reject_from(axis);
    // Each limb folds by itself; the trunk as a whole.
    let on_trunk = matches!(joint, 3 | 6 | 9);
    let place = &chart.places[v];
    let limb_is_left = chart.joints[joint].x > chart.joints[0].x;
    if !on_trunk && limb_is_left != (place.side == 0) {
        return None;
    }
    if on_trunk && place.arm > 0.3 {
        return None;
    }
    if aside.length() > if on_trunk { 0.5 } else { 0.28 } {
        return None;
    }
    let share = (-(along / reach_m).powi(2)).exp();
    if share < 0.02 {
        return None;
    }
    // Angle around the limb, from its front.
    let front = Vec3::Z.reject_from(axis).normalize_or(Vec3::Y);
    let around = aside.dot(axis.cross(front)).atan2(aside.dot(front));
    let at = joint as u64 * 8;
    let slant = random.between(at, -0.9, 0.9) * around.sin()
        + random.between(at + 1, -0.6, 0.6) * (2.0 * around).cos();
    let start = random.between(at + 2, 0.0, std::f32::consts::TAU);
    let across = std::f32::consts::TAU * along / wavelength_m + slant * 1.6 + start;
    Some(Fold { joint: joint as u8, axis, normal: chart.smooth_normals[v], share, across, around })
}
