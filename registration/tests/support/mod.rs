//! Fits the whole body to a whole surface: Gauss-Newton over theta, betas and trans, closest points both ways.

use std::sync::Arc;

use effigy_fusion::mesh::{TriangleMesh, closest_point::ClosestPoint, sample::sample_surface};
use effigy_registration::smpl::{BodyModel, BodyParams, PARAMETER_COUNT, PoseJacobian};
use glam::Vec3;

const ROUNDS: usize = 60;
const TARGET_SAMPLES: usize = 4000;
/// Closest points further than this, in multiples of the robust width, hardly count.
const ROBUST_M: [f32; 2] = [0.08, 0.015];
/// Residual equivalents of one standard deviation of a beta, and of one radian away from the start.
const BETA_PRIOR_M: f64 = 0.02;
const POSE_PRIOR_M: f64 = 0.05;

/// How far apart two surfaces are, millimetres.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SurfaceDistance {
    pub(crate) body_to_target_mm: f32,
    pub(crate) target_to_body_mm: f32,
}

impl SurfaceDistance {
    pub(crate) fn symmetric_mm(self) -> f32 {
        0.5 * (self.body_to_target_mm + self.target_to_body_mm)
    }
}

pub(crate) struct Fitted {
    pub(crate) params: BodyParams,
    pub(crate) posed: Vec<Vec3>,
}

pub(crate) fn fit(body: &Arc<BodyModel>, target: &TriangleMesh, start: &BodyParams) -> Fitted {
    let target_surface = ClosestPoint::from_mesh(target).expect("a sound mesh");
    let samples = sample_surface(target, TARGET_SAMPLES, 7);
    let mut jacobian = PoseJacobian::new(Arc::clone(body));
    let mut params = *start;
    let mut body_surface = ClosestPoint::new(&body.template, &body.triangles).expect("a body");
    for round in 0..ROUNDS {
        let progress = round as f32 / ROUNDS as f32;
        let width_m = ROBUST_M[0] * (ROBUST_M[1] / ROBUST_M[0]).powf(progress);
        let posed = jacobian.update(&params).vertices.clone();
        body_surface.refit(&posed).expect("finite vertices");
        let mut equations = Equations::new();
        for vertex in (0..posed.len()).step_by(3) {
            let hit = target_surface.query(posed[vertex]);
            let normal = target_surface.triangle_normal(hit.triangle);
            let residual = normal.dot(posed[vertex] - hit.point);
            let mut rows = [Vec3::ZERO; PARAMETER_COUNT];
            jacobian.vertex_rows(vertex, &mut rows);
            equations.add(&rows, normal, residual, robust(hit.distance, width_m));
        }
        for sample in &samples {
            let hit = body_surface.query(sample.point);
            if body_surface
                .triangle_normal(hit.triangle)
                .dot(sample.normal)
                < 0.3
            {
                continue;
            }
            let corners = body.triangles[hit.triangle as usize];
            let mut sum = [Vec3::ZERO; PARAMETER_COUNT];
            for (corner, share) in corners.into_iter().zip(hit.barycentric.to_array()) {
                let mut rows = [Vec3::ZERO; PARAMETER_COUNT];
                jacobian.vertex_rows(corner as usize, &mut rows);
                for (s, row) in sum.iter_mut().zip(rows) {
                    *s += row * share;
                }
            }
            let residual = sample.normal.dot(hit.point - sample.point);
            equations.add(&sum, sample.normal, residual, robust(hit.distance, width_m));
        }
        step(&mut params, start, equations);
    }
    let posed = jacobian.update(&params).vertices.clone();
    Fitted { params, posed }
}

/// Mean distances of vertices and samples whose nearest body vertex is counted.
pub(crate) fn distance(
    body: &BodyModel,
    posed: &[Vec3],
    target: &TriangleMesh,
    counted: impl Fn(usize) -> bool,
) -> SurfaceDistance {
    let target_surface = ClosestPoint::from_mesh(target).expect("a sound mesh");
    let body_mesh = TriangleMesh::new(posed.to_vec(), body.triangles.clone());
    let body_surface = ClosestPoint::from_mesh(&body_mesh).expect("a body");
    let is_counted = |triangle: u32| {
        body.triangles[triangle as usize]
            .iter()
            .all(|&i| counted(i as usize))
    };
    let from_body: Vec<f32> = sample_surface(&body_mesh, 20_000, 3)
        .iter()
        .filter(|s| is_counted(s.triangle))
        .map(|s| target_surface.query(s.point).distance)
        .collect();
    let from_target: Vec<f32> = sample_surface(target, 20_000, 4)
        .iter()
        .map(|s| body_surface.query(s.point))
        .filter(|hit| is_counted(hit.triangle))
        .map(|hit| hit.distance)
        .collect();
    let mean_mm = |d: &[f32]| 1e3 * d.iter().sum::<f32>() / d.len() as f32;
    SurfaceDistance {
        body_to_target_mm: mean_mm(&from_body),
        target_to_body_mm: mean_mm(&from_target),
    }
}

fn robust(distance_m: f32, width_m: f32) -> f32 {
    let ratio = distance_m / width_m;
    1.0 / ((1.0 + ratio * ratio) * (1.0 + ratio * ratio))
}

struct Equations {
    normal: Vec<[f64; PARAMETER_COUNT]>,
    gradient: [f64; PARAMETER_COUNT],
    count: f64,
}

impl Equations {
    fn new() -> Self {
        let normal = vec![[0.0; PARAMETER_COUNT]; PARAMETER_COUNT];
        Self { normal, gradient: [0.0; PARAMETER_COUNT], count: 0.0 }
    }

    fn add(&mut self, rows: &[Vec3; PARAMETER_COUNT], direction: Vec3, residual: f32, weight: f32) {
        let row = rows.map(|r| f64::from(r.dot(direction)));
        let weight = f64::from(weight);
        self.count += weight;
        for i in (0..PARAMETER_COUNT).filter(|&i| row[i] != 0.0) {
            let scaled = weight * row[i];
            self.gradient[i] += scaled * f64::from(residual);
            for (sum, other) in self.normal[i][..=i].iter_mut().zip(row) {
                *sum += scaled * other;
            }
        }
    }
}

fn step(params: &mut BodyParams, start: &BodyParams, mut equations: Equations) {
    let n = equations.count;
    for i in 0..PARAMETER_COUNT {
        let (prior_m, away) = match i {
            0..3 => (1e-3, 0.0),
            3..72 => {
                let away = params.theta[i / 3][i % 3] - start.theta[i / 3][i % 3];
                // Hands, feet, head and the short spine bones are nearly free to trade turns: hold them more.
                let held = if matches!(i / 3, 3 | 6 | 9 | 13 | 14 | 22 | 23) {
                    2.0
                } else {
                    0.6
                };
                (POSE_PRIOR_M * held * 0.2, away)
            }
            72..82 => (BETA_PRIOR_M * 0.05, params.betas[i - 72]),
            _ => (1e-4, 0.0),
        };
        equations.normal[i][i] += n * prior_m * prior_m;
        equations.gradient[i] += n * prior_m * prior_m * f64::from(away);
    }
    let delta = solve(equations.normal, equations.gradient);
    for (i, d) in delta.iter().enumerate() {
        let d = -*d as f32;
        match i {
            0..72 => params.theta[i / 3][i % 3] += d.clamp(-0.3, 0.3),
            72..82 => params.betas[i - 72] += d.clamp(-1.0, 1.0),
            _ => params.trans[i - 82] += d,
        }
    }
}

/// Cholesky, in place on the lower triangle.
fn solve(
    mut a: Vec<[f64; PARAMETER_COUNT]>,
    mut x: [f64; PARAMETER_COUNT],
) -> [f64; PARAMETER_COUNT] {
    for j in 0..PARAMETER_COUNT {
        for i in j..PARAMETER_COUNT {
            let along: f64 = a[i][..j].iter().zip(&a[j][..j]).map(|(p, q)| p * q).sum();
            let sum = a[i][j] - along;
            a[i][j] = if i == j {
                sum.max(1e-12).sqrt()
            } else {
                sum / a[j][j]
            };
        }
    }
    for i in 0..PARAMETER_COUNT {
        for k in 0..i {
            x[i] -= a[i][k] * x[k];
        }
        x[i] /= a[i][i];
    }
    for i in (0..PARAMETER_COUNT).rev() {
        for k in i + 1..PARAMETER_COUNT {
            x[i] -= a[k][i] * x[k];
        }
        x[i] /= a[i][i];
    }
    x
}
