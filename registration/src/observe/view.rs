//! A small pinhole image around the person: who is where, how far, and how far from the mask.

use effigy_capture::{CameraModel, Intrinsics, Rigid3};
use effigy_fusion::CleanFrame;
use glam::{Vec2, Vec3};

use super::distance::Nearest;

/// The person and what surrounds it, in cells of about `cell_m` a side at its distance. Lens distortion is gone: cells are filled
/// from the measured points, not from pixels.
#[derive(Clone, Debug)]
pub(crate) struct View {
    /// Of the cropped image, in cells.
    pub(crate) pinhole: Intrinsics,
    pub(crate) camera_from_world: Rigid3,
    pub(crate) cells: Vec<Cell>,
    person: Nearest,
    /// Where the sensor's image ends within the view: `[left, top, right, bottom]`, half-open.
    image: [i32; 4],
    /// In the world: what is lower cannot be told from the floor by its depth, so it may be missing from the mask.
    pub(crate) ground_m: f32,
    /// Standard deviation of a depth seen face on.
    pub(crate) noise_m: f32,
}

#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Cell {
    pub(crate) seen: Seen,
    /// Nearest depth measured of what is seen, in metres; 0 for nothing.
    pub(crate) depth_m: f32,
}

/// What the camera measured in a cell.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Seen {
    #[default]
    Nothing,
    /// Nothing measured in a hole or crack of the person: cleaning drops what is seen at a grazing angle, so the
    /// body may well be there.
    Gap,
    Other,
    Person,
}

/// Cracks narrower than twice this may hide a limb.
const GAP_M: f32 = 0.05;
/// Room around the person.
const MARGIN_M: f32 = 0.25;

impl View {
    /// `None` where no person pixel has a depth.
    pub(crate) fn new(
        clean: &CleanFrame,
        camera: &CameraModel,
        world_from_camera: Rigid3,
        cell_m: f32,
    ) -> Option<Self> {
        let person = PersonBox::of(clean, &camera.intrinsics)?;
        let full = &camera.intrinsics;
        let scale = (cell_m * full.fx / person.depth_m).round().clamp(1.0, 16.0);
        let margin_px = MARGIN_M * full.fx / person.depth_m;
        let [left, top] = (person.min - margin_px)
            .to_array()
            .map(|px| (px / scale).floor());
        let [right, bottom] = (person.max + margin_px)
            .to_array()
            .map(|px| (px / scale).ceil());
        let pinhole = Intrinsics {
            width: (right - left + 1.0).clamp(1.0, 4096.0) as u32,
            height: (bottom - top + 1.0).clamp(1.0, 4096.0) as u32,
            fx: full.fx / scale,
            fy: full.fy / scale,
            cx: (full.cx + 0.5) / scale - 0.5 - left,
            cy: (full.cy + 0.5) / scale - 0.5 - top,
        };
        let image = [
            -left as i32,
            -top as i32,
            (full.width as f32 / scale) as i32 - left as i32,
            (full.height as f32 / scale) as i32 - top as i32,
        ];
        let mut view = Self {
            pinhole,
            camera_from_world: world_from_camera.inverse(),
            cells: vec![Cell::default(); pinhole.pixel_count()],
            person: Nearest::of(&[], 1),
            image,
            ground_m: f32::MIN,
            noise_m: 0.0,
        };
        view.fill(clean, person.pixels_with_margin(clean, margin_px), scale);
        let inside: Vec<bool> = view.cells.iter().map(|c| c.seen == Seen::Person).collect();
        view.person = Nearest::of(&inside, pinhole.width as usize);
        view.mark_gaps(cell_m);
        Some(view)
    }

    /// The cell a point in camera space falls into; `None` outside the view.
    pub(crate) fn cell_of(&self, in_camera: Vec3) -> Option<usize> {
        // NaN is nowhere either.
        if in_camera.z.is_nan() || in_camera.z <= 0.05 {
            return None;
        }
        let at = self.pinhole.project(in_camera) + 0.5;
        let inside = at.x >= 0.0
            && at.y >= 0.0
            && at.x < self.pinhole.width as f32
            && at.y < self.pinhole.height as f32;
        inside.then(|| at.y as usize * self.pinhole.width as usize + at.x as usize)
    }

    /// The person's cell nearest to a place in the view (which may lie outside), if the sensor looks there at all.
    pub(crate) fn nearest_person_to(&self, place: Vec2) -> Option<Vec2> {
        let (x, y) = (place.x.round() as i32, place.y.round() as i32);
        let [left, top, right, bottom] = self.image;
        if x < left || y < top || x >= right || y >= bottom {
            return None;
        }
        let x = x.clamp(0, self.pinhole.width as i32 - 1) as usize;
        let y = y.clamp(0, self.pinhole.height as i32 - 1) as usize;
        let [x, y] = self.person.to([x, y])?;
        Some(Vec2::new(x as f32, y as f32))
    }

    /// Whether a point on a cell's ray is so low that the sensor would take it for the floor.
    pub(crate) fn is_lost_in_floor(&self, cell: usize, depth_m: f32) -> bool {
        if self.ground_m == f32::MIN {
            return false;
        }
        let width = self.pinhole.width as usize;
        let place = Vec2::new((cell % width) as f32, (cell / width) as f32);
        let in_camera = self.pinhole.unproject(place, depth_m);
        // The world's y axis in the camera's space: no need to invert the whole transform.
        let up = self.camera_from_world.rotation * Vec3::Y;
        up.dot(in_camera - self.camera_from_world.translation) < self.ground_m
    }

    pub(crate) fn metres_per_cell(&self, depth_m: f32) -> f32 {
        depth_m / self.pinhole.fx
    }

    fn fill(&mut self, clean: &CleanFrame, pixels: [usize; 4], scale: f32) {
        // Every other pixel still fills cells four pixels wide, and surroundings half as wide.
        let person_step = if scale >= 4.0 { 2 } else { 1 };
        let other_step = if scale >= 2.0 { 2 } else { 1 };
        let [left, top, right, bottom] = pixels;
        for y in (top..bottom).step_by(person_step) {
            for x in (left..right).step_by(person_step) {
                let i = y * clean.vertices.width + x;
                if clean.person[i] {
                    let point = clean.vertices.points[i];
                    if let Some(cell) = self.cell_of(point) {
                        self.cells[cell].add(Seen::Person, point.z);
                    }
                }
            }
        }
        for y in (top..bottom).step_by(other_step) {
            for x in (left..right).step_by(other_step) {
                let i = y * clean.vertices.width + x;
                if !clean.person[i]
                    && clean.depth.metres[i] > 0.05
                    && let Some(cell) = self.cell_of_pixel(x, y, scale)
                {
                    // Surroundings only matter where they hide the person: a lens' distortion does not.
                    self.cells[cell].add(Seen::Other, clean.depth.metres[i]);
                }
            }
        }
    }

    /// Closes the mask: empty cells that a disc of [`GAP_M`] outside the person cannot reach are gaps.
    fn mark_gaps(&mut self, cell_m: f32) {
        let radius = (GAP_M / cell_m).max(1.0);
        let outside = self.person.farther_than(radius);
        let closed = Nearest::of(&outside, self.pinhole.width as usize).farther_than(radius);
        for (cell, closed) in self.cells.iter_mut().zip(closed) {
            if cell.seen == Seen::Nothing && closed {
                cell.seen = Seen::Gap;
            }
        }
    }

    fn cell_of_pixel(&self, x: usize, y: usize, scale: f32) -> Option<usize> {
        let place = |pixel: usize, start: i32| ((pixel as f32 + 0.5) / scale) as i32 + start;
        let (x, y) = (place(x, self.image[0]), place(y, self.image[1]));
        let (width, height) = (self.pinhole.width as i32, self.pinhole.height as i32);
        let inside = x >= 0 && y >= 0 && x < width && y < height;
        inside.then(|| (y * width + x) as usize)
    }

    #[cfg(test)]
    pub(crate) fn empty_for_tests() -> Self {
        use glam::Quat;
        let rotation = Quat::from_rotation_x(std::f32::consts::PI - 0.1);
        let pinhole =
            Intrinsics { width: 320, height: 288, fx: 252.0, fy: 252.0, cx: 160.0, cy: 144.0 };
        let mut first_cell = vec![false; pinhole.pixel_count()];
        first_cell[0] = true;
        Self {
            pinhole,
            camera_from_world: Rigid3 { rotation, translation: Vec3::new(0.05, 1.0, 0.2) },
            cells: vec![Cell::default(); pinhole.pixel_count()],
            person: Nearest::of(&first_cell, 320),
            image: [0, 0, 320, 288],
            ground_m: f32::MIN,
            noise_m: 0.0,
        }
    }
}

impl Cell {
    /// The person wins over what else falls into the cell; among equals the nearest does.
    fn add(&mut self, seen: Seen, depth_m: f32) {
        let outranked = self.seen == Seen::Person && seen != Seen::Person;
        let same = self.seen == seen;
        if !outranked && (!same || depth_m < self.depth_m) {
            *self = Self { seen, depth_m };
        }
    }
}

/// Where the person is in the image.
struct PersonBox {
    /// Of the undistorted projections, in full pixels.
    min: Vec2,
    max: Vec2,
    /// Of the pixels themselves: `[left, top, right, bottom]`, half-open.
    pixels: [usize; 4],
    /// The mean depth.
    depth_m: f32,
}

impl PersonBox {
    fn of(clean: &CleanFrame, camera: &Intrinsics) -> Option<Self> {
        /// Looking at every other pixel misses less than the margin around the box has room for.
        const STEP: usize = 2;
        let mut found = Self {
            min: Vec2::MAX,
            max: Vec2::MIN,
            pixels: [usize::MAX, usize::MAX, 0, 0],
            depth_m: 0.0,
        };
        let mut count = 0;
        let width = clean.vertices.width;
        for (y, row) in clean.person.chunks_exact(width).enumerate().step_by(STEP) {
            for x in (0..width).step_by(STEP).filter(|&x| row[x]) {
                let point = clean.vertices.points[y * width + x];
                if !point.is_finite() || point.z <= 0.05 {
                    continue;
                }
                let place = camera.project(point);
                found.min = found.min.min(place);
                found.max = found.max.max(place);
                let [left, top, right, bottom] = found.pixels;
                found.pixels = [left.min(x), top.min(y), right.max(x + 1), bottom.max(y + 1)];
                found.depth_m += point.z;
                count += 1;
            }
        }
        found.depth_m /= count.max(1) as f32;
        (count > 0).then_some(found)
    }

    fn pixels_with_margin(&self, clean: &CleanFrame, margin_px: f32) -> [usize; 4] {
        let margin = margin_px.ceil() as usize;
        let [left, top, right, bottom] = self.pixels;
        [
            left.saturating_sub(margin),
            top.saturating_sub(margin),
            (right + margin).min(clean.vertices.width),
            (bottom + margin).min(clean.vertices.height),
        ]
    }
}
