//! From an ideal image to what a sensor of some kind would have delivered.
//!
//! In: a [`View`] in metres. Out: raw depth in sensor units, 0 where nothing was measured. Each frame's noise
//! follows from seed and frame number alone. Formulas and measured figures: `docs/sensors.md`.

use effigy_capture::{Calibration, FrameId};

use crate::{preset::Defects, random::Randomness, render::View};

mod correlated;
pub mod multi_path;
pub mod stereo;
pub mod structured_light;
pub mod time_of_flight;

/// One sensor's way of exposing; it keeps its buffers.
pub struct Exposure {
    defects: Defects,
    range_m: [f32; 2],
    metres_per_unit: f32,
    stereo: stereo::Buffers,
    structured_light: structured_light::Buffers,
    time_of_flight: time_of_flight::Buffers,
}

/// What the kinds of sensor need to know about a frame.
#[derive(Clone, Copy)]
struct Shot {
    seed: u64,
    frame: u64,
}

impl Shot {
    fn randomness(self, purpose: u64) -> Randomness {
        Randomness::new(self.seed, self.frame.wrapping_add(1), purpose)
    }
}

impl Exposure {
    pub fn new(calibration: &Calibration, defects: Defects) -> Self {
        Self {
            defects,
            range_m: calibration.range_m,
            metres_per_unit: calibration.metres_per_unit,
            stereo: stereo::Buffers::default(),
            structured_light: structured_light::Buffers::default(),
            time_of_flight: time_of_flight::Buffers::default(),
        }
    }

    /// The frame a real sensor would deliver.
    pub fn expose(&mut self, view: &View, seed: u64, frame: FrameId) -> Vec<u16> {
        let shot = Shot { seed, frame: frame.0 };
        let mut metres = vec![0.0; view.depth_m.len()];
        match &self.defects {
            Defects::TimeOfFlight(sensor) => {
                sensor.expose(view, shot, &mut self.time_of_flight, &mut metres);
            }
            Defects::Stereo(sensor) => sensor.expose(view, shot, &mut self.stereo, &mut metres),
            Defects::StructuredLight(sensor) => {
                sensor.expose(view, shot, &mut self.structured_light, &mut metres);
            }
        }
        self.quantised(&metres)
    }

    /// The truth in sensor units, whatever the range.
    pub fn truth(&self, view: &View) -> Vec<u16> {
        view.depth_m
            .iter()
            .map(|&depth_m| units(depth_m, self.metres_per_unit))
            .collect()
    }

    fn quantised(&self, metres: &[f32]) -> Vec<u16> {
        let [near_m, far_m] = self.range_m;
        metres
            .iter()
            .map(|&depth_m| {
                let in_range = depth_m >= near_m && depth_m <= far_m;
                if in_range {
                    units(depth_m, self.metres_per_unit)
                } else {
                    0
                }
            })
            .collect()
    }
}

fn units(depth_m: f32, metres_per_unit: f32) -> u16 {
    (depth_m / metres_per_unit).round().clamp(0.0, 65535.0) as u16
}

#[cfg(test)]
mod tests;
