//! The world that bodies stand in: y up, floor at y = 0, the camera looking along -z, the origin below the camera.

use effigy_capture::Rigid3;
use effigy_fusion::clean::FloorPlane;
use glam::{Mat3, Quat, Vec3};

/// Frames whose floors are averaged; after that the world stays where it is.
const FLOOR_FRAMES: usize = 15;

/// Learns where the floor is from the first frames that show it.
#[derive(Clone, Debug)]
pub(crate) struct World {
    present: Rigid3,
    known: Option<Rigid3>,
    floors: Vec<FloorPlane>,
    /// Whether y = 0 is known to be the floor.
    grounded: bool,
}

impl World {
    /// Starts with what is known of the camera; without that it looks straight ahead from the origin.
    pub(crate) fn new(known: Option<Rigid3>) -> Self {
        let straight_ahead = Rigid3 {
            rotation: Quat::from_rotation_x(std::f32::consts::PI),
            translation: Vec3::ZERO,
        };
        Self {
            present: known.unwrap_or(straight_ahead),
            known,
            floors: Vec::new(),
            grounded: known.is_some(),
        }
    }

    pub(crate) fn world_from_camera(&self) -> Rigid3 {
        self.present
    }

    pub(crate) fn is_grounded(&self) -> bool {
        self.grounded
    }

    /// Takes one more frame's floor in; returns how the world moved, if it did.
    pub(crate) fn observe(&mut self, floor: Option<&FloorPlane>) -> Option<Rigid3> {
        let floor = floor.copied().filter(|floor| is_plausible(*floor))?;
        if self.floors.len() >= FLOOR_FRAMES {
            return None;
        }
        self.floors.push(floor);
        let before = self.present;
        let floor = median(&self.floors);
        self.present = match self.known {
            Some(known) => levelled(known, floor),
            None => from_floor(floor),
        };
        self.grounded = true;
        Some(self.present * before.inverse())
    }
}

/// Up is up (camera y points down) to within 60 degrees, and the floor is below the camera.
fn is_plausible(floor: FloorPlane) -> bool {
    floor.normal.is_finite()
        && (floor.normal.length() - 1.0).abs() < 1e-2
        && floor.normal.y < -0.5
        && floor.offset_m.is_finite()
        && floor.offset_m < 0.0
}

/// The component-wise median: single bad planes do not move it.
fn median(floors: &[FloorPlane]) -> FloorPlane {
    let middle = |of: &dyn Fn(&FloorPlane) -> f32| {
        let mut values: Vec<f32> = floors.iter().map(of).collect();
        values.sort_by(f32::total_cmp);
        0.5 * (values[(values.len() - 1) / 2] + values[values.len() / 2])
    };
    let normal = Vec3::new(
        middle(&|f| f.normal.x),
        middle(&|f| f.normal.y),
        middle(&|f| f.normal.z),
    );
    FloorPlane { normal: normal.normalize_or(-Vec3::Y), offset_m: middle(&|f| f.offset_m) }
}

/// A known world, turned and lifted as little as it takes to have the floor at y = 0.
fn levelled(known: Rigid3, floor: FloorPlane) -> Rigid3 {
    let up = known.rotate(floor.normal).normalize_or(Vec3::Y);
    let rotation = (Quat::from_rotation_arc(up, Vec3::Y) * known.rotation).normalize();
    let Vec3 { x, z, .. } = known.translation;
    Rigid3 { rotation, translation: Vec3::new(x, -floor.offset_m, z) }
}

/// The world whose floor is the plane: `normal . p = offset` becomes y = 0.
fn from_floor(floor: FloorPlane) -> Rigid3 {
    let up = floor.normal;
    let ahead = (Vec3::Z - up * up.z).normalize_or(Vec3::X);
    let back = -ahead;
    let right = up.cross(back);
    // Rows are the world's axes in the camera's space.
    let rotation = Mat3::from_cols(right, up, back).transpose();
    Rigid3 {
        rotation: Quat::from_mat3(&rotation).normalize(),
        translation: Vec3::new(0.0, -floor.offset_m, 0.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tilted_camera_finds_the_floor_at_zero_and_looks_along_minus_z() {
        let tilt = Quat::from_rotation_x(std::f32::consts::PI + 0.2);
        let truth = Rigid3 { rotation: tilt, translation: Vec3::new(0.0, 1.4, 0.0) };
        let camera_from_world = truth.inverse();
        let normal = camera_from_world.rotate(Vec3::Y);
        let floor = FloorPlane { normal, offset_m: normal.dot(camera_from_world.translation) };
        let mut world = World::new(None);
        assert!(world.observe(Some(&floor)).is_some());
        let found = world.world_from_camera();
        assert!((found.translation - truth.translation).length() < 1e-5);
        assert!(found.rotation.angle_between(truth.rotation) < 1e-3);
        assert!(world.is_grounded());
    }

    #[test]
    fn a_known_camera_keeps_its_place_and_heading_when_the_floor_corrects_it() {
        let heading = Quat::from_rotation_y(0.7) * Quat::from_rotation_x(std::f32::consts::PI);
        let known = Rigid3 { rotation: heading, translation: Vec3::new(1.0, 1.3, 2.0) };
        let floor = FloorPlane { normal: Vec3::new(0.0, -0.995, 0.0998), offset_m: -1.25 };
        let mut world = World::new(Some(known));
        world.observe(Some(&floor));
        let found = world.world_from_camera();
        assert!((found.translation - Vec3::new(1.0, 1.25, 2.0)).length() < 1e-5);
        assert!(found.rotation.angle_between(heading) < 0.11);
        assert!((found.rotate(floor.normal) - Vec3::Y).length() < 1e-3);
    }

    #[test]
    fn one_wild_floor_does_not_move_the_world() {
        let level = FloorPlane { normal: -Vec3::Y, offset_m: -1.0 };
        let wild = FloorPlane { normal: Vec3::new(0.5, -0.866, 0.0), offset_m: -0.3 };
        let mut world = World::new(None);
        for floor in [level, level, wild, level] {
            world.observe(Some(&floor));
        }
        assert!((world.world_from_camera().translation.y - 1.0).abs() < 1e-6);
    }

    #[test]
    fn the_default_world_has_the_persons_left_at_plus_x() {
        let world = World::new(None).world_from_camera();
        assert!((world.rotate(Vec3::X) - Vec3::X).length() < 1e-6);
        assert!((world.rotate(Vec3::Z) + Vec3::Z).length() < 1e-6);
        assert!(!World::new(None).is_grounded());
    }
}
