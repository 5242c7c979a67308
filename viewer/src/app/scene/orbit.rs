//! A camera on a sphere around the person, moved by dragging and scrolling.

use eframe::egui::{PointerButton, Response};
use glam::{Vec3, vec3};

use crate::pictures::PictureCamera;

const RAD_PER_POINT: f32 = 0.008;
/// From just above the floor to almost straight down.
const ELEVATION_RAD: [f32; 2] = [-0.1, 1.45];
const DISTANCE_M: [f32; 2] = [0.8, 12.0];
/// Where the person's middle usually is.
const CHEST: Vec3 = vec3(0.0, 0.92, 0.0);
/// How much of the way to the person the target goes in a second's thirtieth.
const FOLLOW: f32 = 0.06;

#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::app) struct Orbit {
    azimuth_rad: f32,
    elevation_rad: f32,
    distance_m: f32,
    target: Vec3,
    /// What dragging with the other button has added.
    shift: Vec3,
}

impl Default for Orbit {
    fn default() -> Self {
        Self {
            azimuth_rad: 0.35,
            elevation_rad: 0.16,
            distance_m: 4.6,
            target: CHEST,
            shift: Vec3::ZERO,
        }
    }
}

impl Orbit {
    /// Drag turns, the right button shifts, the wheel zooms, a double click starts over.
    pub(super) fn follow_pointer(&mut self, response: &Response, mirror: bool) {
        if response.double_clicked() {
            *self = Self { target: self.target, ..Self::default() };
        }
        let mut drag = response.drag_delta();
        if mirror {
            drag.x = -drag.x;
        }
        if response.dragged_by(PointerButton::Primary) {
            self.azimuth_rad -= drag.x * RAD_PER_POINT;
            let elevation = self.elevation_rad + drag.y * RAD_PER_POINT;
            self.elevation_rad = elevation.clamp(ELEVATION_RAD[0], ELEVATION_RAD[1]);
        } else if response.dragged() {
            let metres_per_point = 0.0012 * self.distance_m;
            let right = vec3(self.azimuth_rad.cos(), 0.0, -self.azimuth_rad.sin());
            self.shift += (-right * drag.x + Vec3::Y * drag.y) * metres_per_point;
        }
        if response.hovered() {
            let scroll = response.ctx.input(|input| input.smooth_scroll_delta().y);
            let pinch = response.ctx.input(eframe::egui::InputState::zoom_delta);
            self.zoom((-0.002 * scroll).exp() / pinch);
        }
    }

    /// Keeps the person in the middle without following every sway.
    pub(super) fn follow_person(&mut self, points: &[Vec3]) {
        let count = points.len().max(1) as f32;
        let middle = points.iter().filter(|p| p.is_finite()).sum::<Vec3>() / count;
        let wanted = vec3(middle.x, CHEST.y, middle.z);
        let gap = wanted - self.target;
        // A jump (somebody new, a loop's start) is followed at once.
        let share = if gap.length() > 1.0 { 1.0 } else { FOLLOW };
        self.target += gap * share;
    }

    /// Where the person stands, as far as the camera has followed.
    pub(super) fn person(&self) -> Vec3 {
        self.target
    }

    pub(super) fn camera(&self, size: [u32; 2]) -> PictureCamera {
        let angles = [self.azimuth_rad, self.elevation_rad];
        // A narrow view stands back until the person's arms fit.
        let narrow = (size[1] as f32 / size[0] as f32).max(1.0);
        PictureCamera::orbit(
            self.target + self.shift,
            self.distance_m * narrow,
            angles,
            size,
        )
    }

    fn zoom(&mut self, factor: f32) {
        self.distance_m = (self.distance_m * factor).clamp(DISTANCE_M[0], DISTANCE_M[1]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn zooming_ends_before_the_person_and_before_the_horizon() {
        let mut orbit = Orbit::default();
        orbit.zoom(1e-6);
        assert_eq!(orbit.distance_m, DISTANCE_M[0]);
        orbit.zoom(1e6);
        assert_eq!(orbit.distance_m, DISTANCE_M[1]);
    }

    #[test]
    fn the_camera_drifts_to_a_person_and_jumps_to_one_far_away() {
        let mut orbit = Orbit::default();
        orbit.follow_person(&[vec3(0.5, 1.0, 0.0)]);
        assert!((orbit.target.x - 0.5 * FOLLOW).abs() < 1e-6);
        orbit.follow_person(&[vec3(3.0, 1.0, -2.0)]);
        assert_eq!(orbit.target, vec3(3.0, CHEST.y, -2.0));
    }
}
