//! A straight line through points.

/// A fitted pinhole that misses the grid by more than this is none.
const MAX_FIT_RMS_PX: f64 = 1.0;
const MIN_FIT_POINTS: usize = 100;

/// Sums for a straight line through points, by least squares.
#[derive(Default)]
pub(super) struct Line {
    count: usize,
    a: f64,
    b: f64,
    aa: f64,
    ab: f64,
    bb: f64,
}

impl Line {
    pub(super) fn add(&mut self, a: f64, b: f64) {
        self.count += 1;
        self.a += a;
        self.b += b;
        self.aa += a * a;
        self.ab += a * b;
        self.bb += b * b;
    }

    /// Slope and offset, if the points do lie on a rising line.
    pub(super) fn fit(&self) -> Option<(f32, f32)> {
        let n = self.count as f64;
        let variance = self.aa / n - (self.a / n).powi(2);
        let covariance = self.ab / n - self.a / n * self.b / n;
        let slope = covariance / variance;
        let offset = (self.b - slope * self.a) / n;
        let residual = self.bb / n - (self.b / n).powi(2) - slope * covariance;
        let good = self.count >= MIN_FIT_POINTS
            && slope > 0.0
            && residual.max(0.0).sqrt() < MAX_FIT_RMS_PX;
        (good && slope.is_finite() && offset.is_finite()).then_some((slope as f32, offset as f32))
    }
}
