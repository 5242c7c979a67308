//! One clean frame as the fit sees it: a sample of the person's points, and a small cropped view with the mask.

mod distance;
mod sample;
mod view;

pub(crate) use sample::{DataPoint, sample};
pub(crate) use view::{Seen, View};

use effigy_capture::{CameraModel, Rigid3};
use effigy_fusion::CleanFrame;
use glam::Vec3;

/// How finely a frame is observed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ObserveConfig {
    pub(crate) points: usize,
    pub(crate) cell_m: f32,
    /// Fewer person pixels than this are nobody.
    pub(crate) min_px: usize,
}

/// Everything the fit takes from a frame; positions in the world.
#[derive(Clone, Debug)]
pub(crate) struct Observation {
    pub(crate) points: Vec<DataPoint>,
    pub(crate) view: View,
    pub(crate) extent: Extent,
}

/// How far the person's points reach, robustly (0.5th and 99.5th percentile of the sample), in the world.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Extent {
    pub(crate) low_y: f32,
    pub(crate) high_y: f32,
    pub(crate) center: Vec3,
}

impl Observation {
    /// `None` where there is nobody, or next to nobody.
    pub(crate) fn new(
        clean: &CleanFrame,
        camera: &CameraModel,
        world_from_camera: Rigid3,
        config: &ObserveConfig,
    ) -> Option<Self> {
        let person_px = clean.person.iter().filter(|&&p| p).count();
        if person_px < config.min_px.max(1) {
            return None;
        }
        let points = sample(clean, world_from_camera, person_px, config.points);
        let extent = Extent::of(&points)?;
        let mut view = View::new(clean, camera, world_from_camera, config.cell_m)?;
        view.noise_m = face_on_m(points.iter().map(|point| point.sigma_m))?;
        if let Some(floor) = clean.floor {
            let depth_m = (view.camera_from_world * extent.center).z;
            view.ground_m = ground_m(view.noise_m, floor.offset_m.abs() / depth_m.max(0.5));
        }
        Some(Self { points, view, extent })
    }

    /// The same frame after the world has moved.
    pub(crate) fn move_by(&mut self, new_from_old: Rigid3) {
        for point in &mut self.points {
            point.position = new_from_old * point.position;
            point.normal = new_from_old.rotate(point.normal);
        }
        self.extent.center = new_from_old * self.extent.center;
        self.view.camera_from_world = self.view.camera_from_world * new_from_old.inverse();
    }
}

/// Standard deviation of what is seen face on, of those of a person's points: most of a body is seen at an angle, so it is
/// among the smallest. `None` of no points.
pub(crate) fn face_on_m(sigmas_m: impl Iterator<Item = f32>) -> Option<f32> {
    let mut sigmas_m: Vec<f32> = sigmas_m.collect();
    if sigmas_m.is_empty() {
        return None;
    }
    let rank = sigmas_m.len() / 10;
    Some(*sigmas_m.select_nth_unstable_by(rank, f32::total_cmp).1)
}

/// Up to where cleaning takes depth for the floor: a skin, and three standard deviations of the depth as they show
/// across a floor that falls away by `slope`.
fn ground_m(noise_m: f32, slope: f32) -> f32 {
    const SKIN_M: f32 = 0.02;
    /// Cells are coarser than pixels.
    const CELL_M: f32 = 0.01;
    SKIN_M + CELL_M + 3.0 * noise_m * slope
}

impl Extent {
    fn of(points: &[DataPoint]) -> Option<Self> {
        if points.len() < 20 {
            return None;
        }
        let mut heights: Vec<f32> = points.iter().map(|p| p.position.y).collect();
        heights.sort_by(f32::total_cmp);
        let at = |share: f32| heights[((heights.len() - 1) as f32 * share) as usize];
        let sum: Vec3 = points.iter().map(|p| p.position).sum();
        Some(Self { low_y: at(0.005), high_y: at(0.995), center: sum / points.len() as f32 })
    }
}
