//! Light that takes a detour: in concave corners a phase camera also sees what its neighbours reflect, and reads
//! too far.
//!
//! One bounce between diffuse surfaces, gathered on a grid over the image: `w = rho cos cos dA / (pi d^2)` of a
//! neighbour's light, whose path is longer by `(|q| + d - |p|) / 2`. Phases add up, so the excess is the mean of
//! all paths weighted by their light. What the camera does not see does not take part.

use glam::{Vec3, vec3};

use crate::render::View;

/// How much too far each pixel reads, at a quarter of the image's resolution.
#[derive(Clone, Debug, Default)]
pub struct Detours {
    columns: usize,
    rows: usize,
    places: Vec<Place>,
    excess_m: Vec<f32>,
    spokes: Vec<Spoke>,
}

/// What a grid point sees.
#[derive(Clone, Copy, Debug, Default)]
struct Place {
    point: Vec3,
    normal: Vec3,
    /// Reflectance times squared depth over squared range: its part of the light it passes on.
    gives: f32,
    range_m: f32,
}

/// Pixels between two grid points.
const STEP_PX: usize = 4;
/// Rings around a point on which neighbours are asked: middle, inner and outer radius in metres.
const RINGS_M: [[f32; 3]; 4] = [
    [0.022, 0.010, 0.034],
    [0.052, 0.034, 0.072],
    [0.105, 0.072, 0.140],
    [0.200, 0.140, 0.280],
];
const DIRECTIONS: usize = 6;
/// Nearer neighbours count as this far away: their pixels are not points.
const LEAST_DISTANCE_M: f32 = 0.01;
/// Only what belongs to one surface is interpolated.
const SAME_SURFACE_M: f32 = 0.06;

impl Detours {
    /// Gathers the detours of one frame.
    pub fn measure(&mut self, view: &View) {
        self.columns = view.width.div_ceil(STEP_PX) + 1;
        self.rows = view.height.div_ceil(STEP_PX) + 1;
        if self.spokes.is_empty() {
            self.spokes = spokes();
        }
        self.places.clear();
        for row in 0..self.rows {
            let y = (row * STEP_PX).min(view.height - 1);
            for column in 0..self.columns {
                let x = (column * STEP_PX).min(view.width - 1);
                self.places.push(Place::of(view, y * view.width + x));
            }
        }
        let px_per_tangent = view.camera.fx / STEP_PX as f32;
        self.excess_m.clear();
        for row in 0..self.rows {
            for column in 0..self.columns {
                let excess_m = self.gathered_m([column, row], px_per_tangent);
                self.excess_m.push(excess_m);
            }
        }
    }

    /// By how much a pixel reads too far, along the optical axis.
    pub fn excess_m(&self, view: &View, x: usize, y: usize) -> f32 {
        let (column, row) = (x / STEP_PX, y / STEP_PX);
        let first = row * self.columns + column;
        let corners = [
            first,
            first + 1,
            first + self.columns,
            first + self.columns + 1,
        ];
        let excesses = corners.map(|corner| self.excess_m[corner]);
        if excesses == [0.0; 4] {
            return 0.0;
        }
        let share = |at: usize| (at % STEP_PX) as f32 / STEP_PX as f32;
        let (u, v) = (share(x), share(y));
        let shares = [(1.0 - u) * (1.0 - v), u * (1.0 - v), (1.0 - u) * v, u * v];
        let depth_m = view.depth_m[y * view.width + x];
        let (mut sum, mut total) = (0.0, 0.0);
        for k in 0..4 {
            if (self.places[corners[k]].point.z - depth_m).abs() < SAME_SURFACE_M {
                sum += shares[k] * excesses[k];
                total += shares[k];
            }
        }
        if total > 0.0 { sum / total } else { 0.0 }
    }

    fn gathered_m(&self, [column, row]: [usize; 2], px_per_tangent: f32) -> f32 {
        let here = self.places[row * self.columns + column];
        if here.range_m <= 0.0 {
            return 0.0;
        }
        let cells_per_m = px_per_tangent / here.point.z;
        let (x, y) = (column as f32 + 0.5, row as f32 + 0.5);
        let (columns, rows) = (self.columns as f32, self.rows as f32);
        let (mut light, mut excess) = (0.0, 0.0);
        for spoke in &self.spokes {
            let at_x = x + spoke.aside_m[0] * cells_per_m;
            let at_y = y + spoke.aside_m[1] * cells_per_m;
            if !(at_x >= 0.0 && at_y >= 0.0 && at_x < columns && at_y < rows) {
                continue;
            }
            let there = &self.places[at_y as usize * self.columns + at_x as usize];
            let between = there.point - here.point;
            let towards = here.normal.dot(between);
            let back = -there.normal.dot(between);
            if towards <= 0.0 || back <= 0.0 {
                continue;
            }
            let distance2 = between
                .length_squared()
                .max(LEAST_DISTANCE_M * LEAST_DISTANCE_M);
            // The neighbour's cosine cancels: what is slanted is lit less, and has more surface in a pixel.
            let weight = there.gives * towards * back * spoke.area_m2 / (distance2 * distance2);
            light += weight;
            excess += weight * 0.5 * (there.range_m + distance2.sqrt() - here.range_m);
        }
        if light <= 0.0 {
            return 0.0;
        }
        // In shares of the light that comes here straight from the lamp.
        let depth2 = here.point.z * here.point.z;
        let cosine = -here.normal.dot(here.point) / here.range_m;
        let direct =
            cosine.max(0.1) * std::f32::consts::PI * depth2 / (here.range_m * here.range_m);
        // Paths differ in phase by little, so their mean is as good as the phasors' sum.
        excess / (direct + light) * here.point.z / here.range_m
    }
}

impl Place {
    fn of(view: &View, pixel: usize) -> Self {
        let depth_m = view.depth_m[pixel];
        if depth_m <= 0.0 {
            // Far behind and turned away: nothing reaches it, nothing comes from it.
            return Self { point: vec3(0.0, 0.0, 1e3), normal: Vec3::Z, gives: 0.0, range_m: 0.0 };
        }
        let point = view.ray(pixel) * depth_m;
        let range2 = point.length_squared();
        Self {
            point,
            normal: view.normals[pixel],
            gives: view.reflectance[pixel] * depth_m * depth_m / range2,
            range_m: range2.sqrt(),
        }
    }
}

/// A place to ask, in metres aside, and the area it stands for.
#[derive(Clone, Copy, Debug)]
struct Spoke {
    aside_m: [f32; 2],
    area_m2: f32,
}

fn spokes() -> Vec<Spoke> {
    let mut spokes = Vec::with_capacity(RINGS_M.len() * DIRECTIONS);
    for (ring, [middle_m, inner_m, outer_m]) in RINGS_M.into_iter().enumerate() {
        for direction in 0..DIRECTIONS {
            // Rings are turned against each other, so that no direction is always missed.
            let turns = (direction as f32 + 0.37 * ring as f32) / DIRECTIONS as f32;
            let (sin, cos) = (std::f32::consts::TAU * turns).sin_cos();
            let ring_m2 = std::f32::consts::PI * (outer_m * outer_m - inner_m * inner_m);
            spokes.push(Spoke {
                aside_m: [middle_m * cos, middle_m * sin],
                area_m2: ring_m2 / DIRECTIONS as f32,
            });
        }
    }
    spokes
}
