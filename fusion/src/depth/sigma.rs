//! The sensor's noise at a depth and an angle, as a table: it is asked for at each pixel of a person.

use effigy_capture::SensorModel;
use glam::Vec3;

/// Depth between rows: noise changes by less than 3 % from one to the next beyond half a metre.
const SPACING_M: f32 = 0.02;
const ROWS: usize = 512;
/// Columns are spaced evenly in the cosine of the angle between ray and normal.
const COLUMNS: usize = 64;

#[derive(Clone, Debug)]
pub(crate) struct SigmaTable {
    sigma_m: Vec<f32>,
}

impl SigmaTable {
    pub(crate) fn new(sensor: SensorModel) -> Self {
        let entry = |index: usize| {
            let cosine = ((index % COLUMNS) as f32 + 0.5) / COLUMNS as f32;
            let depth_m = ((index / COLUMNS) as f32 + 0.5) * SPACING_M;
            sensor.sigma_m(depth_m, cosine.acos())
        };
        Self { sigma_m: (0..ROWS * COLUMNS).map(entry).collect() }
    }

    /// Standard deviation of the depth of a point. Without a normal it lies at an edge, and counts as seen
    /// at a grazing angle; depths beyond 10 m count as 10 m.
    #[inline]
    pub(crate) fn at(&self, point: Vec3, normal: Vec3) -> f32 {
        // NaN becomes 0.
        let cosine = (-point.dot(normal) / point.length()).max(0.0);
        let column = ((cosine * COLUMNS as f32) as usize).min(COLUMNS - 1);
        let row = ((point.z / SPACING_M) as usize).min(ROWS - 1);
        self.sigma_m[row * COLUMNS + column]
    }
}

#[cfg(test)]
mod tests {
    use glam::vec3;

    use super::*;

    #[test]
    fn the_table_agrees_with_the_model() {
        for sensor in [
            SensorModel::StructuredLight,
            SensorModel::TimeOfFlight { floor_m: 0.0005, slope: 0.001 },
            SensorModel::Stereo { baseline_m: 0.05, focal_px: 425.0, subpixel_rms_px: 0.08 },
        ] {
            let table = SigmaTable::new(sensor);
            for (depth_m, incidence_rad) in [(0.6, 0.1), (1.5, 0.5), (2.2, 1.0), (4.0, 0.0)] {
                let normal = vec3(f32::sin(incidence_rad), 0.0, -f32::cos(incidence_rad));
                let found = table.at(vec3(0.0, 0.0, depth_m), normal);
                let expected = sensor.sigma_m(depth_m, incidence_rad);
                assert!(
                    (found / expected - 1.0).abs() < 0.05,
                    "{found} for {expected}"
                );
            }
            assert!(table.at(vec3(0.0, 0.0, 2.0), Vec3::NAN) >= sensor.sigma_m(2.0, 0.0));
        }
    }
}
