//! What a sensor gets wrong, measured: the same figures from simulated walls, simulated people and real frames.
//!
//! In: presets, or depth images in metres (0 for no answer). Out: noise, correlation, edges, holes.

use effigy_capture::{FrameId, Intrinsics};
use glam::{Vec3, vec3};

use crate::{
    noise::Exposure,
    preset::{Defects, SensorPreset},
    render::{Label, View},
};

mod interior;
mod slant;

pub use interior::{Interior, closed_mask, interior};
pub use slant::{SLANTS_DEG, Slanted, noise_by_slant};

/// Half the width of the columns in which a turned wall is measured: there its depth hardly changes.
const HALF_WIDTH_PX: usize = 16;
/// Raw units of measured exposures, fine enough not to add to the noise.
const UNIT_M: f32 = 0.0001;
const REFLECTANCE: f32 = 0.8;

/// A standard deviation beside what the source of the sensor's model says about this wall.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sigma {
    pub measured_m: f64,
    pub source_m: f64,
    /// Share of pixels that answered.
    pub fill: f64,
}

/// What happens where something nearer ends.
#[expect(
    clippy::struct_field_names,
    reason = "a number's name ends in its unit"
)]
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Edges {
    /// By how much the nearer surface is too wide, on either side.
    pub grown_px: f64,
    /// Deviation of the place where near becomes far.
    pub wobble_px: f64,
    /// Pixels a row and side that are neither near nor far.
    pub flying_px: f64,
    /// Pixels without an answer left and right of the nearer surface.
    pub shadow_px: [f64; 2],
}

/// A wall through the optical axis at a depth, turned about the vertical.
pub fn wall(camera: Intrinsics, depth_m: f32, turned_rad: f32) -> View {
    let normal = vec3(turned_rad.sin(), 0.0, -turned_rad.cos());
    let offset_m = normal.z * depth_m;
    view(camera, |ray| {
        let towards = normal.dot(ray);
        let at_m = if towards < -1e-3 {
            offset_m / towards
        } else {
            0.0
        };
        (at_m.min(60.0), normal)
    })
}

/// A frontal wall, and a nearer slab in front of the middle fifth of its columns.
pub fn slab(camera: Intrinsics, near_m: f32, far_m: f32) -> View {
    let half = camera.width as f32 * 0.1 / camera.fx;
    view(camera, |ray| {
        (if ray.x.abs() < half { near_m } else { far_m }, Vec3::NEG_Z)
    })
}

fn view(camera: Intrinsics, seen: impl Fn(Vec3) -> (f32, Vec3)) -> View {
    let count = camera.pixel_count();
    let mut view = View {
        width: camera.width as usize,
        height: camera.height as usize,
        depth_m: vec![0.0; count],
        normals: vec![Vec3::ZERO; count],
        incidence_rad: vec![0.0; count],
        cosine: vec![0.0; count],
        labels: vec![Label::Wall; count],
        reflectance: vec![REFLECTANCE; count],
        colors: vec![[200; 3]; count],
        camera,
    };
    for pixel in 0..count {
        let (depth_m, normal) = seen(view.ray(pixel));
        if depth_m > 0.0 {
            view.depth_m[pixel] = depth_m;
            view.normals[pixel] = normal;
            view.measure_incidence(pixel);
        }
    }
    view
}

/// A preset's exposure in fine units.
fn exposure(preset: SensorPreset) -> Exposure {
    let mut calibration = preset.calibration();
    calibration.metres_per_unit = UNIT_M;
    Exposure::new(&calibration, preset.defects())
}

/// Noise on a wall at a depth, turned by an angle, over some frames.
pub fn sigma(preset: SensorPreset, depth_m: f32, turned_rad: f32, frames: u64) -> Sigma {
    let view = wall(preset.intrinsics(), depth_m, turned_rad);
    let mut exposure = exposure(preset);
    let (mut squares, mut source, mut sum) = (0.0, 0.0, 0.0);
    let (mut answered, mut asked) = (0.0, 0.0);
    let columns = view.width / 2 - HALF_WIDTH_PX..view.width / 2 + HALF_WIDTH_PX;
    for frame in 0..frames {
        let raw = exposure.expose(&view, 11, FrameId(frame));
        for y in view.height / 5..view.height * 4 / 5 {
            for x in columns.clone() {
                let pixel = y * view.width + x;
                asked += 1.0;
                if raw[pixel] == 0 {
                    continue;
                }
                answered += 1.0;
                let error = f64::from(f32::from(raw[pixel]) * UNIT_M - view.depth_m[pixel]);
                sum += error;
                squares += error * error;
                let expected = source_sigma_m(preset, &view, pixel);
                source += expected * expected;
            }
        }
    }
    let variance = squares / answered - (sum / answered) * (sum / answered);
    Sigma {
        measured_m: variance.sqrt(),
        source_m: f64::sqrt(source / answered),
        fill: answered / asked,
    }
}

/// The published formula, written out again: neither the simulator's code nor the calibration's.
fn source_sigma_m(preset: SensorPreset, view: &View, pixel: usize) -> f64 {
    let z = f64::from(view.depth_m[pixel]);
    let theta = f64::from(view.incidence_rad[pixel]);
    let grazing = (theta / (std::f64::consts::FRAC_PI_2 - theta)).powi(2);
    match preset {
        // BlenderProc after Tolgyessy 2021, the angle term of Fankhauser 2015, and a look aside of 0.25 px.
        SensorPreset::Azure => {
            let axial = 0.0005 + 0.001 * (z - 0.5).max(0.0) + 0.0001 * z.powf(1.5) * grazing;
            let normal = view.normals[pixel];
            let ray = view.ray(pixel);
            let slope =
                f64::from(view.depth_m[pixel] * normal.x / (normal.dot(ray) * view.camera.fx));
            axial.hypot(0.25 * slope)
        }
        // sigma = z^2 s / (f B); no source has an angle term.
        SensorPreset::D435 => z * z * 0.08 / (424.0 * 0.050),
        SensorPreset::D455 => z * z * 0.08 / (424.0 * 0.095),
        SensorPreset::Oak => z * z * 0.10 / (441.0 * 0.075),
        // Nguyen, Izadi and Lovell 2012.
        SensorPreset::Kinect => 0.0012 + 0.0019 * (z - 0.4).powi(2) + 0.0001 / z.sqrt() * grazing,
    }
}

/// What two matching windows of 7 px share, this many columns apart: the correlation of a moving mean of white noise.
pub fn window_correlation(lag: usize) -> f64 {
    const WINDOW_PX: f64 = 7.0;
    (1.0 - lag as f64 / WINDOW_PX).max(0.0)
}

/// Correlation of errors on a frontal wall between pixels of a row, this many columns apart.
pub fn correlation(preset: SensorPreset, depth_m: f32, lags: &[usize], frames: u64) -> Vec<f64> {
    let view = wall(preset.intrinsics(), depth_m, 0.0);
    let mut exposure = exposure(preset);
    let mut products = vec![0.0; lags.len()];
    let mut counts = vec![0.0; lags.len()];
    let (mut squares, mut n) = (0.0, 0.0);
    for frame in 0..frames {
        let raw = exposure.expose(&view, 11, FrameId(frame));
        let error =
            |p: usize| (raw[p] > 0).then(|| f64::from(f32::from(raw[p]) * UNIT_M - depth_m));
        for y in view.height / 3..view.height * 2 / 3 {
            for x in view.width / 3..view.width * 2 / 3 {
                let Some(here) = error(y * view.width + x) else {
                    continue;
                };
                squares += here * here;
                n += 1.0;
                for (k, &lag) in lags.iter().enumerate() {
                    if let Some(there) = error(y * view.width + x + lag) {
                        products[k] += here * there;
                        counts[k] += 1.0;
                    }
                }
            }
        }
    }
    products
        .iter()
        .zip(counts)
        .map(|(product, count)| product / count / (squares / n))
        .collect()
}

/// The edges of a slab in front of a wall.
pub fn edges(preset: SensorPreset, near_m: f32, far_m: f32, frames: u64) -> Edges {
    let view = slab(preset.intrinsics(), near_m, far_m);
    let mut exposure = exposure(preset);
    let row = &view.depth_m[..view.width];
    let left = row.iter().position(|&z| z == near_m).unwrap_or(0);
    let right = row.iter().rposition(|&z| z == near_m).unwrap_or(0);
    // A fifth of the step: three sigma of the noisiest sensor at these depths.
    let margin_m = 0.2 * (far_m - near_m);
    let mut found = Tally::default();
    for frame in 0..frames {
        let raw = exposure.expose(&view, 11, FrameId(frame));
        for y in view.height / 4..view.height * 3 / 4 {
            let kind = |x: usize| match f32::from(raw[y * view.width + x]) * UNIT_M {
                0.0 => Kind::Hole,
                z if z < near_m + margin_m => Kind::Near,
                z if z > far_m - margin_m => Kind::Far,
                _ => Kind::Flying,
            };
            found.add_side((0..EDGE_PX).map(|k| kind(left + EDGE_INSIDE_PX - 1 - k)), 0);
            found.add_side(
                (0..EDGE_PX).map(|k| kind(right + 1 - EDGE_INSIDE_PX + k)),
                1,
            );
        }
    }
    found.edges()
}

const EDGE_PX: usize = 32;
/// Of these so many on the slab.
const EDGE_INSIDE_PX: usize = 8;

#[derive(Clone, Copy, PartialEq, Eq)]
enum Kind {
    Hole,
    Near,
    Far,
    Flying,
}

/// Counts along lines that lead from a slab outwards.
#[derive(Default)]
struct Tally {
    lines: [f64; 2],
    /// Near pixels at each distance, and those that are near or far.
    near: [f64; EDGE_PX],
    decided: [f64; EDGE_PX],
    flying: f64,
    holes: [f64; 2],
}

impl Tally {
    fn add_side(&mut self, kinds: impl Iterator<Item = Kind>, side: usize) {
        self.lines[side] += 1.0;
        for (k, kind) in kinds.enumerate() {
            match kind {
                Kind::Near => self.near[k] += 1.0,
                Kind::Flying => self.flying += 1.0,
                Kind::Hole => self.holes[side] += 1.0,
                Kind::Far => {}
            }
            if matches!(kind, Kind::Near | Kind::Far) {
                self.decided[k] += 1.0;
            }
        }
    }

    /// Near pixels fade out over the edge: their share falls like the edge's distribution.
    fn edges(&self) -> Edges {
        let share = |k: usize| {
            if self.decided[k] > 0.0 {
                self.near[k] / self.decided[k]
            } else {
                0.0
            }
        };
        let (mut mass, mut mean, mut square) = (0.0, 0.0, 0.0);
        for k in 0..EDGE_PX - 1 {
            let falls = (share(k) - share(k + 1)).max(0.0);
            let at = k as f64 + 1.0 - EDGE_INSIDE_PX as f64;
            mass += falls;
            mean += falls * at;
            square += falls * at * at;
        }
        let lines = self.lines[0] + self.lines[1];
        Edges {
            grown_px: mean / mass,
            wobble_px: (square / mass - (mean / mass).powi(2)).max(0.0).sqrt(),
            flying_px: self.flying / lines,
            shadow_px: [0, 1].map(|side: usize| self.holes[side] / self.lines[side]),
        }
    }
}

/// How wide the published models make the shadow beside a slab: the step in disparity.
pub fn shadow_px(preset: SensorPreset, near_m: f32, far_m: f32) -> f64 {
    let focal_baseline = match preset.defects() {
        Defects::TimeOfFlight(_) => 0.0,
        Defects::Stereo(stereo) => stereo.focal_px * stereo.baseline_m,
        Defects::StructuredLight(light) => light.focal_px * light.baseline_m,
    };
    f64::from(focal_baseline * (1.0 / near_m - 1.0 / far_m))
}

/// How far beyond the truth a concave corner of two walls reads: the largest mean error over columns, metres.
pub fn corner_excess_m(preset: SensorPreset, corner_m: f32, opening_rad: f32) -> f64 {
    let camera = preset.intrinsics();
    let half = opening_rad * 0.5;
    let corner = Vec3::Z * corner_m;
    let walls = [-1.0f32, 1.0].map(|side| vec3(side * half.cos(), 0.0, -half.sin()));
    let view = view(camera, |ray| {
        let hits = walls.map(|normal| (normal.dot(corner) / normal.dot(ray), normal));
        let seen = hits
            .into_iter()
            .filter(|(z, normal)| *z > 0.0 && normal.dot(ray) < 0.0);
        // A corner is the intersection of two half-spaces: what lies nearest is what bounds it.
        seen.min_by(|a, b| a.0.total_cmp(&b.0))
            .unwrap_or((0.0, Vec3::ZERO))
    });
    let mut exposure = exposure(preset);
    let raw = exposure.expose(&view, 11, FrameId(0));
    let mean_error = |x: usize| {
        let errors: Vec<f64> = (view.height / 3..view.height * 2 / 3)
            .map(|y| y * view.width + x)
            .filter(|&p| raw[p] > 0)
            .map(|p| f64::from(f32::from(raw[p]) * UNIT_M - view.depth_m[p]))
            .collect();
        errors.iter().sum::<f64>() / errors.len().max(1) as f64
    };
    (view.width / 3..view.width * 2 / 3)
        .map(mean_error)
        .fold(0.0, f64::max)
}

#[cfg(test)]
mod tests;
