//! Normals of a map of points: neighbours' differences, averaged over what lies on the same surface.
#![expect(
    clippy::inline_always,
    clippy::needless_range_loop,
    reason = "compiled anew for each vector unit, inside `simd::run`; loops over lanes are what it makes vectors of"
)]

use std::cell::RefCell;

use glam::Vec3;
use rayon::prelude::*;

use crate::{
    maps::{NormalMap, Region, VertexMap},
    simd,
};

/// Neighbours two pixels apart whose depths differ by more than this share of the depth lie on different surfaces: a
/// surface seen at 75 degrees changes by 1.5 % between them, and noise adds the rest.
const STEP_SHARE: f32 = 0.025;
/// Pixels between the neighbours a normal is computed from, to either side: as few as this, and as many.
const REACH_PX: std::ops::RangeInclusive<usize> = 2..=5;
/// Neighbours are this many standard deviations of depth apart, so that noise turns normals by no more than it does for a
/// quiet sensor.
const REACH_SIGMAS: f32 = 1.5;
/// Rows that one task computes; it looks at twice the reach more on either side.
const ROWS_A_TASK: usize = 32;
/// Pixels computed at once: a register of AVX-512.
const LANES: usize = 16;

thread_local! {
    /// Working memory, some 100 kB.
    static KEPT: RefCell<Kept> = const { RefCell::new(Kept::EMPTY) };
}

impl NormalMap {
    /// Normals of the surface through neighbouring points, smoothed over five pixels; steps in depth are
    /// not bridged. NaN where there is no point, or where it has no neighbours.
    pub fn from_vertices(vertices: &VertexMap) -> Self {
        let whole = Region::whole(vertices.width, vertices.height);
        let nothing = vec![Vec3::NAN; vertices.points.len()];
        Self::within(nothing, vertices, &whole, *REACH_PX.start())
    }

    /// As [`Self::from_vertices`] within a region, in memory that is NaN as yet, from neighbours `reach` pixels away.
    pub(crate) fn within(
        normals: Vec<Vec3>,
        vertices: &VertexMap,
        region: &Region,
        reach: usize,
    ) -> Self {
        let (width, height) = (vertices.width, vertices.height);
        let mut map = Self { width, height, normals };
        if region.is_empty() {
            return map;
        }
        let rows = region.rows.start * width..region.rows.end * width;
        map.normals[rows]
            .par_chunks_mut(ROWS_A_TASK * width)
            .enumerate()
            .for_each(|(task, strip)| {
                let first = region.rows.start + task * ROWS_A_TASK;
                let sight = Sight { vertices, region, reach };
                KEPT.with_borrow_mut(|kept| {
                    simd::run(
                        #[inline(always)]
                        || kept.compute_strip(&sight, first, strip),
                    );
                });
            });
        map
    }
}

/// The share for neighbours as far apart as this. Those far apart are of a noisy sensor, and 4 % of 2 m are an arm's
/// thickness: not more.
fn step_share(reach: usize) -> f32 {
    let farther = reach as f32 / *REACH_PX.start() as f32;
    STEP_SHARE * farther.min(1.6)
}

/// What is looked at.
struct Sight<'a> {
    vertices: &'a VertexMap,
    region: &'a Region,
    reach: usize,
}

/// How far apart neighbours should be where depth is as noisy as this, in pixels of this size there.
pub(crate) fn reach_px(sigma_m: f32, pixel_m: f32) -> usize {
    // NaN becomes 0.
    let wanted = (REACH_SIGMAS * sigma_m / pixel_m).round() as usize;
    wanted.clamp(*REACH_PX.start(), *REACH_PX.end())
}

/// A few rows of points and of rough normals, axis by axis, so that several pixels are handled at a time. Row `y` is
/// in place `y` modulo the number of rows kept; before its first column and after its last come `reach` more, and it is
/// filled up to whole [`LANES`].
struct Kept {
    reach: usize,
    step_share: f32,
    stride: usize,
    /// NaN where there is none.
    points: [Vec<f32>; 3],
    /// A vector along the normal, and the pixel's depth: NaN where the vector has no say.
    rough: [Vec<f32>; 4],
}

impl Kept {
    const EMPTY: Self = Self {
        reach: 0,
        step_share: 0.0,
        stride: 0,
        points: [const { Vec::new() }; 3],
        rough: [const { Vec::new() }; 4],
    };

    /// The normals of whole rows from `first` on, within the region's columns.
    #[inline(always)]
    fn compute_strip(&mut self, sight: &Sight<'_>, first: usize, strip: &mut [Vec3]) {
        let (width, columns) = (sight.vertices.width, sight.region.columns.clone());
        self.make_room(columns.len(), sight.reach);
        let (reach, first) = (sight.reach as isize, first as isize);
        for y in first - 2 * reach..first {
            self.take_points(sight, y);
        }
        for y in first - reach..first + (strip.len() / width) as isize + reach {
            self.take_points(sight, y + reach);
            self.rough_normals(sight.region, y);
            // Rows before the strip's first are only looked at.
            if let Ok(row) = usize::try_from(y - reach - first) {
                self.smooth(y - reach, &mut strip[row * width..][columns.clone()]);
            }
        }
    }

    fn make_room(&mut self, columns: usize, reach: usize) {
        let stride = columns.next_multiple_of(LANES) + 2 * reach;
        (self.reach, self.stride) = (reach, stride);
        self.step_share = step_share(reach);
        for axis in self.points.iter_mut().chain(&mut self.rough) {
            // Whatever is left from before is overwritten, but for the columns beside a row: nothing is there.
            axis.clear();
            axis.resize((2 * reach + 1) * stride, f32::NAN);
        }
    }

    /// Where a row begins, with its columns beside it.
    #[inline(always)]
    fn start(&self, y: isize) -> usize {
        y.rem_euclid(2 * self.reach as isize + 1) as usize * self.stride
    }

    /// Points beyond the region count as well, beyond the picture there are none.
    #[inline(always)]
    fn take_points(&mut self, sight: &Sight<'_>, y: isize) {
        let (width, columns) = (sight.vertices.width, &sight.region.columns);
        let start = self.start(y);
        let [xs, ys, zs] = &mut self.points;
        let row = start..start + self.stride;
        let (xs, ys, zs) = (&mut xs[row.clone()], &mut ys[row.clone()], &mut zs[row]);
        if y < 0 || y as usize >= sight.vertices.height {
            zs.fill(f32::NAN);
            return;
        }
        let points = &sight.vertices.points[y as usize * width..][..width];
        let before = columns.start.min(self.reach);
        let points = &points[columns.start - before..];
        let offset = self.reach - before;
        let count = points.len().min(self.stride - offset);
        let points = &points[..count];
        zs[..offset].fill(f32::NAN);
        zs[offset + count..].fill(f32::NAN);
        let (xs, ys, zs) = (
            &mut xs[offset..][..count],
            &mut ys[offset..][..count],
            &mut zs[offset..][..count],
        );
        for i in 0..count {
            xs[i] = points[i].x;
            ys[i] = points[i].y;
            zs[i] = points[i].z;
        }
    }

    /// For each pixel of a row a vector along the normal, from the nearest points on the same surface left, right, above
    /// and below, zero where there is none; and the pixel's depth beside it.
    #[inline(always)]
    fn rough_normals(&mut self, region: &Region, y: isize) {
        let start = self.start(y);
        let columns = region.columns.len();
        if y < region.rows.start as isize || y >= region.rows.end as isize {
            self.rough[3][start..start + self.stride].fill(f32::NAN);
            return;
        }
        let (above, below) = (
            self.start(y - self.reach as isize),
            self.start(y + self.reach as isize),
        );
        for x in (self.reach..self.reach + columns).step_by(LANES) {
            let center = self.points_at(start + x);
            write(&mut self.rough[3], start + x, center[2]);
            if all_nan(&center[2]) {
                continue;
            }
            let [left, right, above, below] = [
                start + x - self.reach,
                start + x + self.reach,
                above + x,
                below + x,
            ];
            let share = self.step_share;
            let across = difference(
                &pick_near(&self.points_at(right), &center, share),
                &pick_near(&self.points_at(left), &center, share),
            );
            let down = difference(
                &pick_near(&self.points_at(below), &center, share),
                &pick_near(&self.points_at(above), &center, share),
            );
            // Right cross down points away from the camera.
            let normal = cross(&down, &across);
            for axis in 0..3 {
                write(&mut self.rough[axis], start + x, normal[axis]);
            }
        }
        // What fills the row up has no say, nor have points beyond the region.
        self.rough[3][start + self.reach + columns..start + self.stride].fill(f32::NAN);
    }

    /// A row of sums over three by three neighbours, as far apart, on the same surface. Larger triangles
    /// count more: they are the ones measured over both sides.
    #[inline(always)]
    fn smooth(&self, y: isize, normals: &mut [Vec3]) {
        let reach = self.reach as isize;
        let rows = [y - reach, y, y + reach].map(|y| self.start(y));
        for (normals, x) in normals.chunks_mut(LANES).zip((self.reach..).step_by(LANES)) {
            let center: Lanes = *lanes(&self.rough[3], rows[1] + x);
            if all_nan(&center) {
                continue;
            }
            let mut sum = [[0.0; LANES]; 3];
            for row in rows {
                for at in [row + x - self.reach, row + x, row + x + self.reach] {
                    let near = near(lanes(&self.rough[3], at), &center, self.step_share);
                    for axis in 0..3 {
                        let vector = lanes(&self.rough[axis], at);
                        for i in 0..LANES {
                            sum[axis][i] += f32::from_bits(vector[i].to_bits() & near[i]);
                        }
                    }
                }
            }
            write_normalized(&sum, normals);
        }
    }

    #[inline(always)]
    fn points_at(&self, at: usize) -> [Lanes; 3] {
        let [x, y, z] = &self.points;
        [*lanes(x, at), *lanes(y, at), *lanes(z, at)]
    }
}

/// One number for each of several pixels.
type Lanes = [f32; LANES];

#[inline(always)]
fn lanes(values: &[f32], at: usize) -> &Lanes {
    values[at..]
        .first_chunk()
        .expect("rows are filled up to whole lanes")
}

#[inline(always)]
fn write(values: &mut [f32], at: usize, lanes: Lanes) {
    values[at..at + LANES].copy_from_slice(&lanes);
}

#[inline(always)]
fn all_nan(values: &Lanes) -> bool {
    values.iter().fold(true, |all, value| all & value.is_nan())
}

/// All bits where a depth is on the center's surface, none elsewhere.
#[inline(always)]
fn near(depth: &Lanes, center: &Lanes, step_share: f32) -> [u32; LANES] {
    let mut near = [0; LANES];
    for i in 0..LANES {
        // A NaN compares as false.
        let is_near = (depth[i] - center[i]).abs() < step_share * center[i];
        near[i] = u32::from(is_near).wrapping_neg();
    }
    near
}

/// The points on the centers' surfaces, and the centers themselves elsewhere.
#[inline(always)]
fn pick_near(points: &[Lanes; 3], center: &[Lanes; 3], step_share: f32) -> [Lanes; 3] {
    let near = near(&points[2], &center[2], step_share);
    let mut picked = *center;
    for axis in 0..3 {
        for i in 0..LANES {
            let (there, here) = (points[axis][i].to_bits(), center[axis][i].to_bits());
            picked[axis][i] = f32::from_bits(there & near[i] | here & !near[i]);
        }
    }
    picked
}

#[inline(always)]
fn difference(a: &[Lanes; 3], b: &[Lanes; 3]) -> [Lanes; 3] {
    let mut difference = *a;
    for axis in 0..3 {
        for i in 0..LANES {
            difference[axis][i] -= b[axis][i];
        }
    }
    difference
}

#[inline(always)]
fn cross(a: &[Lanes; 3], b: &[Lanes; 3]) -> [Lanes; 3] {
    let mut cross = [[0.0; LANES]; 3];
    for axis in 0..3 {
        let (p, q) = ((axis + 1) % 3, (axis + 2) % 3);
        for i in 0..LANES {
            cross[axis][i] = a[p][i] * b[q][i] - b[p][i] * a[q][i];
        }
    }
    cross
}

/// NaN where a sum has no length.
#[inline(always)]
fn write_normalized(sum: &[Lanes; 3], normals: &mut [Vec3]) {
    let [x, y, z] = sum;
    let mut per_length = [0.0; LANES];
    for i in 0..LANES {
        let length = (x[i] * x[i] + y[i] * y[i] + z[i] * z[i]).sqrt();
        per_length[i] = if length > 0.0 {
            length.recip()
        } else {
            f32::NAN
        };
    }
    if let Some(normals) = normals.first_chunk_mut::<LANES>() {
        for i in 0..LANES {
            normals[i] = Vec3::new(
                x[i] * per_length[i],
                y[i] * per_length[i],
                z[i] * per_length[i],
            );
        }
    } else {
        for (i, normal) in normals.iter_mut().enumerate() {
            *normal = Vec3::new(x[i], y[i], z[i]) * per_length[i];
        }
    }
}

#[cfg(test)]
mod tests {
    use effigy_capture::Intrinsics;
    use glam::{Vec2, vec3};

    use super::*;
    use crate::maps::{DepthMap, Rays};

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

    /// What the strips compute, one pixel at a time.
    fn plainly(vertices: &VertexMap, region: &Region, reach: usize) -> Vec<Vec3> {
        let share = step_share(reach);
        let (width, reach) = (vertices.width as isize, reach as isize);
        let point = |x: isize, y: isize| {
            let inside = (0..width).contains(&x) && (0..vertices.height as isize).contains(&y);
            inside.then(|| vertices.points[(y * width + x) as usize])
        };
        let near = |point: &Vec3, center: Vec3| (point.z - center.z).abs() < share * center.z;
        let rough = |x: isize, y: isize| {
            let (columns, rows) = (&region.columns, &region.rows);
            let inside = columns.contains(&(x as usize)) && rows.contains(&(y as usize));
            let center = point(x, y).filter(|center| inside && !center.z.is_nan())?;
            let at = |x, y| {
                point(x, y)
                    .filter(|point| near(point, center))
                    .unwrap_or(center)
            };
            let (down, across) = (
                at(x, y + reach) - at(x, y - reach),
                at(x + reach, y) - at(x - reach, y),
            );
            Some((center, down.cross(across)))
        };
        let mut normals = vec![Vec3::NAN; vertices.points.len()];
        for (x, y) in region
            .rows
            .clone()
            .flat_map(|y| region.columns.clone().map(move |x| (x, y)))
        {
            let (column, row) = (x as isize, y as isize);
            let Some((center, _)) = rough(column, row) else {
                continue;
            };
            let mut sum = Vec3::ZERO;
            for (dy, dx) in [-1, 0, 1]
                .into_iter()
                .flat_map(|dy| [-1, 0, 1].map(|dx| (dy, dx)))
            {
                let neighbour = rough(column + dx * reach, row + dy * reach);
                sum += neighbour
                    .filter(|(point, _)| near(point, center))
                    .map_or(Vec3::ZERO, |(_, vector)| vector);
            }
            normals[y * vertices.width + x] = sum.try_normalize().unwrap_or(Vec3::NAN);
        }
        normals
    }

    #[test]
    fn strips_of_lanes_agree_with_one_pixel_at_a_time() {
        // Waves with steps and holes, of a size that is no multiple of anything.
        let at = |pixel: usize| {
            let (x, y) = ((pixel % 151) as f32, (pixel / 151) as f32);
            let hole = pixel.is_multiple_of(37) || (x > 60.0 && x < 64.0) || y > 70.0 && x < 31.0;
            let depth_m =
                1.5 + 0.1 * (0.2 * x).sin() * (0.13 * y).cos() + if x > 100.0 { 0.4 } else { 0.0 };
            let z = if hole { f32::NAN } else { depth_m };
            vec3(0.004 * x * z, 0.004 * y * z, z)
        };
        let vertices =
            VertexMap { width: 151, height: 99, points: (0..151 * 99).map(at).collect() };
        for (reach, region) in [
            (2, Region::whole(151, 99)),
            (2, Region { columns: 1..150, rows: 3..98 }),
            (3, Region { columns: 47..78, rows: 40..41 }),
            (5, Region { columns: 150..151, rows: 0..99 }),
            (5, Region::whole(151, 99)),
        ] {
            let expected = plainly(&vertices, &region, reach);
            let nothing = vec![Vec3::NAN; vertices.points.len()];
            let found = NormalMap::within(nothing, &vertices, &region, reach).normals;
            for (pixel, (found, expected)) in found.iter().zip(&expected).enumerate() {
                let same =
                    found.is_nan() && expected.is_nan() || (found - expected).length() < 1e-6;
                assert!(
                    same,
                    "{region:?}, pixel {pixel}: {found} instead of {expected}"
                );
            }
        }
    }
}
