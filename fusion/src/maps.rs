//! Per-pixel geometry in the depth camera's space, row-major; NaN means "no measurement".

use std::ops::Range;

use effigy_capture::{CameraModel, DepthImage};
use glam::{Vec2, Vec3, Vec4};
use rayon::prelude::*;

/// Neighbours whose depths differ by more than this share of the depth lie on different surfaces: a surface
/// seen at 75 degrees changes by 1.5 % between the pixels compared here, and noise adds the rest.
const STEP_SHARE: f32 = 0.025;
/// Pixels between the neighbours a normal is computed from, to either side.
const REACH_PX: usize = 2;

/// Depth along the optical axis, in metres.
#[derive(Clone, Debug, PartialEq)]
pub struct DepthMap {
    pub width: usize,
    pub height: usize,
    pub metres: Vec<f32>,
}

/// The point seen by each pixel, in metres.
#[derive(Clone, Debug, PartialEq)]
pub struct VertexMap {
    pub width: usize,
    pub height: usize,
    pub points: Vec<Vec3>,
}

/// The unit normal at each pixel, towards the camera.
#[derive(Clone, Debug, PartialEq)]
pub struct NormalMap {
    pub width: usize,
    pub height: usize,
    pub normals: Vec<Vec3>,
}

/// Where each pixel's ray meets the plane z = 1: computed once a camera, so that a lens costs nothing later.
#[derive(Clone, Debug)]
pub struct Rays {
    pub width: usize,
    pub height: usize,
    pub on_unit_plane: Vec<Vec2>,
}

/// A rectangle of pixels.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Region {
    pub columns: Range<usize>,
    pub rows: Range<usize>,
}

impl Region {
    pub fn whole(width: usize, height: usize) -> Self {
        Self { columns: 0..width, rows: 0..height }
    }

    pub fn is_empty(&self) -> bool {
        self.columns.is_empty() || self.rows.is_empty()
    }

    /// Grown by a border, within an image of that size.
    pub fn grown(&self, border: usize, width: usize, height: usize) -> Self {
        let grow = |range: &Range<usize>, size: usize| {
            range.start.saturating_sub(border)..(range.end + border).min(size)
        };
        Self { columns: grow(&self.columns, width), rows: grow(&self.rows, height) }
    }
}

impl Rays {
    pub fn new(camera: &CameraModel) -> Self {
        Self {
            width: camera.intrinsics.width as usize,
            height: camera.intrinsics.height as usize,
            on_unit_plane: camera.rays(),
        }
    }

    pub fn point(&self, pixel: usize, depth_m: f32) -> Vec3 {
        self.on_unit_plane[pixel].extend(1.0) * depth_m
    }
}

impl DepthMap {
    /// Raw depth in metres; NaN where there is none, or where it lies outside `range_m`.
    pub fn in_metres(image: &DepthImage, metres_per_unit: f32, range_m: [f32; 2]) -> Self {
        Self::in_metres_into(Vec::new(), image, metres_per_unit, range_m)
    }

    /// As [`Self::in_metres`], in memory that may have served before.
    #[expect(
        clippy::needless_bitwise_bool,
        reason = "without shortcuts several pixels are converted at a time"
    )]
    pub(crate) fn in_metres_into(
        mut metres: Vec<f32>,
        image: &DepthImage,
        metres_per_unit: f32,
        range_m: [f32; 2],
    ) -> Self {
        let convert = |&raw: &u16| {
            let depth_m = f32::from(raw) * metres_per_unit;
            let usable = (raw != 0) & (depth_m >= range_m[0]) & (depth_m <= range_m[1]);
            if usable { depth_m } else { f32::NAN }
        };
        metres.clear();
        metres.extend(image.pixels().iter().map(convert));
        Self { width: image.width() as usize, height: image.height() as usize, metres }
    }

    /// A map without any measurement.
    pub fn empty(width: usize, height: usize) -> Self {
        Self { width, height, metres: vec![f32::NAN; width * height] }
    }

    pub fn valid_count(&self) -> usize {
        self.metres.iter().filter(|depth| depth.is_finite()).count()
    }
}

impl VertexMap {
    /// The point at each pixel's depth along its ray.
    ///
    /// # Panics
    /// If depth and rays differ in size.
    pub fn unproject(depth: &DepthMap, rays: &Rays) -> Self {
        assert_eq!(
            (depth.width, depth.height),
            (rays.width, rays.height),
            "one ray a pixel"
        );
        let points = depth
            .metres
            .par_iter()
            .with_min_len(1 << 14)
            .zip(&rays.on_unit_plane)
            .map(|(&depth_m, ray)| ray.extend(1.0) * depth_m)
            .collect();
        Self { width: depth.width, height: depth.height, points }
    }

    pub fn empty(width: usize, height: usize) -> Self {
        Self { width, height, points: vec![Vec3::NAN; width * height] }
    }
}

impl NormalMap {
    /// Normals of the surface through neighbouring points, smoothed over five pixels; steps in depth are
    /// not bridged. NaN where there is no point, or where it has no neighbours.
    pub fn from_vertices(vertices: &VertexMap) -> Self {
        let whole = Region::whole(vertices.width, vertices.height);
        let normals = vec![Vec3::NAN; vertices.points.len()];
        Self::within(normals, vertices, &whole, &mut Vec::new())
    }

    /// As [`Self::from_vertices`] within a region; `normals` are NaN as yet, `rough` is working memory.
    pub(crate) fn within(
        normals: Vec<Vec3>,
        vertices: &VertexMap,
        region: &Region,
        rough: &mut Vec<Vec4>,
    ) -> Self {
        let (width, height) = (vertices.width, vertices.height);
        let mut map = Self { width, height, normals };
        if region.is_empty() {
            return map;
        }
        let columns = region.columns.len();
        // What is left in it from before is overwritten.
        rough.resize(columns * region.rows.len(), Vec4::ZERO);
        rough
            .par_chunks_mut(columns)
            .with_min_len(ROWS_A_TASK)
            .enumerate()
            .for_each(|(row, normals)| {
                rough_normals(
                    vertices,
                    region.columns.start,
                    region.rows.start + row,
                    normals,
                );
            });
        let patch = Patch { rough, columns, rows: region.rows.len() };
        let rows = region.rows.start * width..region.rows.end * width;
        map.normals[rows]
            .par_chunks_mut(width)
            .with_min_len(ROWS_A_TASK)
            .enumerate()
            .for_each(|(row, normals)| patch.smooth(row, &mut normals[region.columns.clone()]));
        map
    }
}

/// Fewer rows are not worth another thread's attention.
const ROWS_A_TASK: usize = 16;

/// For each pixel of a row from `first` on, a vector along the normal, from the nearest points on the same surface left,
/// right, above and below, zero where there is none; and the pixel's depth beside it.
fn rough_normals(vertices: &VertexMap, first: usize, y: usize, normals: &mut [Vec4]) {
    let (width, height) = (vertices.width, vertices.height);
    let row = |y: usize| &vertices.points[y * width..(y + 1) * width];
    let here = row(y);
    // Beyond the picture there is nothing: a row compared with itself gives no vector.
    let above = if y >= REACH_PX {
        row(y - REACH_PX)
    } else {
        here
    };
    let below = if y + REACH_PX < height {
        row(y + REACH_PX)
    } else {
        here
    };
    for (x, normal) in (first..).zip(normals) {
        let center = here[x];
        let limit_m = STEP_SHARE * center.z;
        let on_surface = |point: Vec3| {
            // A NaN compares as false.
            if (point.z - center.z).abs() < limit_m {
                point
            } else {
                center
            }
        };
        let left = if x >= REACH_PX {
            on_surface(here[x - REACH_PX])
        } else {
            center
        };
        let right = if x + REACH_PX < width {
            on_surface(here[x + REACH_PX])
        } else {
            center
        };
        // Right cross down points away from the camera.
        let vector = (on_surface(below[x]) - on_surface(above[x])).cross(right - left);
        let vector = if center.z.is_nan() {
            Vec3::ZERO
        } else {
            vector
        };
        *normal = vector.extend(center.z);
    }
}

/// Rough normals of a region with their depths, ready to be smoothed.
struct Patch<'a> {
    rough: &'a [Vec4],
    columns: usize,
    rows: usize,
}

impl Patch<'_> {
    /// A row of sums over three by three neighbours, two pixels apart, on the same surface. Larger triangles
    /// count more: they are the ones measured over both sides.
    fn smooth(&self, y: usize, normals: &mut [Vec3]) {
        let row = |y: usize| &self.rough[y * self.columns..(y + 1) * self.columns];
        let here = row(y);
        let mut near = [here; 3];
        let mut count = 0;
        for at in [y.wrapping_sub(REACH_PX), y, y + REACH_PX] {
            if at < self.rows {
                near[count] = row(at);
                count += 1;
            }
        }
        let near = &near[..count];
        for (x, normal) in normals.iter_mut().enumerate() {
            let center = here[x].w;
            *normal = if center.is_nan() {
                Vec3::NAN
            } else {
                let sum = if x >= REACH_PX && x + REACH_PX < self.columns {
                    sum_of(near, [x - REACH_PX, x, x + REACH_PX], center)
                } else if x >= REACH_PX {
                    sum_of(near, [x - REACH_PX, x], center)
                } else if x + REACH_PX < self.columns {
                    sum_of(near, [x, x + REACH_PX], center)
                } else {
                    sum_of(near, [x], center)
                };
                sum.try_normalize().unwrap_or(Vec3::NAN)
            };
        }
    }
}

/// The vectors at these places whose depth is near this one.
#[inline]
fn sum_of<const N: usize>(rows: &[&[Vec4]], places: [usize; N], depth_m: f32) -> Vec3 {
    let limit_m = STEP_SHARE * depth_m;
    let mut sum = Vec4::ZERO;
    for row in rows {
        for place in places {
            let vector = row[place];
            let near = (vector.w - depth_m).abs() < limit_m;
            sum += if near { vector } else { Vec4::ZERO };
        }
    }
    sum.truncate()
}

#[cfg(test)]
mod tests {
    use effigy_capture::Intrinsics;
    use glam::vec3;

    use super::*;

    const CAMERA: Intrinsics =
        Intrinsics { width: 160, height: 120, fx: 130.0, fy: 131.0, cx: 80.2, cy: 59.1 };

    fn map_of(depth_at: impl Fn(Vec2) -> f32) -> (DepthMap, Rays) {
        let rays = Rays::new(&CAMERA.into());
        let metres = rays
            .on_unit_plane
            .iter()
            .map(|&ray| depth_at(ray))
            .collect();
        (DepthMap { width: 160, height: 120, metres }, rays)
    }

    #[test]
    fn zero_and_far_pixels_have_no_depth() {
        let image = DepthImage::new(4, 1, vec![0, 100, 1500, 9000]).unwrap();
        let map = DepthMap::in_metres(&image, 0.001, [0.3, 5.0]);
        assert_eq!(map.valid_count(), 1);
        assert!((map.metres[2] - 1.5).abs() < 1e-6);
    }

    #[test]
    fn normals_of_a_slanted_plane_are_exact_and_face_the_camera() {
        let normal = vec3(0.4, -0.3, -0.8).try_normalize().unwrap();
        let (depth, rays) = map_of(|ray| -1.2 / normal.dot(ray.extend(1.0)));
        let normals = NormalMap::from_vertices(&VertexMap::unproject(&depth, &rays));
        for &found in &normals.normals {
            assert!(found.dot(normal) > 1.0 - 1e-4, "{found}");
        }
    }

    #[test]
    fn normals_beside_a_step_belong_to_their_own_side() {
        let (depth, rays) = map_of(|ray| if ray.x < 0.0 { 1.0 } else { 1.4 });
        let normals = NormalMap::from_vertices(&VertexMap::unproject(&depth, &rays));
        for &found in &normals.normals {
            assert!(found.dot(vec3(0.0, 0.0, -1.0)) > 0.9999, "{found}");
        }
    }

    #[test]
    fn missing_points_have_no_normal_and_do_not_disturb_their_neighbours() {
        let (mut depth, rays) = map_of(|_| 2.0);
        depth.metres[60 * 160 + 80] = f32::NAN;
        let normals = NormalMap::from_vertices(&VertexMap::unproject(&depth, &rays));
        let missing = normals
            .normals
            .iter()
            .filter(|normal| normal.x.is_nan())
            .count();
        assert_eq!(missing, 1);
        let (empty, rays) = map_of(|_| f32::NAN);
        let normals = NormalMap::from_vertices(&VertexMap::unproject(&empty, &rays));
        assert!(normals.normals.iter().all(|normal| normal.is_nan()));
    }
}
