//! Wrinkles that a garment has in every pose: cloth falls in folds below the chest, winds around sleeves, and
//! piles up where trousers meet the shoes.

use glam::Vec3;

use super::{chart::Chart, tailor::smoothstep};
use crate::random::Randomness;

/// The shapes of one person's wrinkles.
#[derive(Clone, Debug)]
pub(super) struct Wrinkles {
    lumps: [(Vec3, f32); 5],
    random: Randomness,
}

impl Wrinkles {
    pub(super) fn new(random: Randomness) -> Self {
        let lumps = std::array::from_fn(|i| {
            let at = 8 * i as u64;
            let axis = Vec3::new(
                random.gaussian(at),
                random.gaussian(at + 1),
                random.gaussian(at + 2),
            );
            let wavelength_m = random.between(at + 3, 0.10, 0.22);
            let wave = axis.normalize_or(Vec3::Y) * (std::f32::consts::TAU / wavelength_m);
            (wave, random.between(at + 4, 0.0, std::f32::consts::TAU))
        });
        Self { lumps, random }
    }

    /// Slow irregularities in space, about -0.5 to 0.5.
    pub(super) fn lump(&self, point: Vec3) -> f32 {
        let waves = self
            .lumps
            .iter()
            .map(|(wave, phase)| (wave.dot(point) + phase).sin());
        waves.sum::<f32>() * 0.25
    }

    /// In units of the garment's fold height, about -0.8 to 0.8.
    pub(super) fn shirt(&self, chart: &Chart, v: usize) -> f32 {
        let place = &chart.places[v];
        let from_axis = chart.vertices[v] - chart.joints[6];
        let around = from_axis.x.atan2(from_axis.z);
        let falling = smoothstep(0.85, 0.05, place.trunk) * (1.0 - place.arm_share);
        let vertical = 0.45 * (7.0 * around + self.phase(64) + 1.5 * place.trunk).sin()
            + 0.30 * (11.0 * around + self.phase(65) - 4.0 * place.trunk).sin();
        let on_sleeve = smoothstep(0.1, 0.9, place.arm_share);
        let (along_m, around_arm) = limb(chart, v, [16, 18]);
        let winding =
            0.38 * (along_m * wave_number(0.105) + 2.0 * around_arm + self.phase(66)).sin();
        falling * vertical + on_sleeve * winding
    }

    /// In units of the garment's fold height, about -0.8 to 0.8.
    pub(super) fn trousers(&self, chart: &Chart, v: usize) -> f32 {
        let place = &chart.places[v];
        let on_leg = smoothstep(0.3, 0.9, place.leg_share);
        let (along_m, around) = limb(chart, v, [1, 4]);
        let creases = 0.25 * (3.0 * around + self.phase(67) + 2.0 * place.leg).sin();
        let piled = smoothstep(1.45, 1.9, place.leg);
        let rings = 0.55 * (along_m * wave_number(0.065) + (around + self.phase(68)).sin()).sin();
        let behind_knee = 0.35 * (-((place.leg - 1.0) / 0.25).powi(2)).exp();
        let knee = behind_knee * (along_m * wave_number(0.07) + 1.2 * around.sin()).sin();
        on_leg * (creases + piled * rings + knee)
    }

    fn phase(&self, at: u64) -> f32 {
        self.random.between(at, 0.0, std::f32::consts::TAU)
    }
}

fn wave_number(wavelength_m: f32) -> f32 {
    std::f32::consts::TAU / wavelength_m
}

/// How far along a limb's first bone, and at which angle around it (0 is the front), a vertex lies.
fn limb(chart: &Chart, v: usize, [from, to]: [usize; 2]) -> (f32, f32) {
    let side = chart.places[v].side;
    let start = chart.joints[from + side];
    let axis = (chart.joints[to + side] - start).normalize_or(Vec3::NEG_Y);
    let offset = chart.vertices[v] - start;
    let front = Vec3::Z.reject_from(axis).normalize_or(Vec3::Z);
    let beside = axis.cross(front);
    (
        offset.dot(axis),
        offset.dot(beside).atan2(offset.dot(front)),
    )
}
