//! Draws a mesh into a depth image: which triangle each pixel of a pinhole camera sees, where, and how far.
//!
//! Coverage is decided in whole 1/256 pixels with a top-left rule, so triangles that share an edge leave
//! neither holes nor overlaps.

use effigy_capture::Intrinsics;
use glam::{Vec2, Vec3, vec2};

/// Sub-pixel steps a pixel is divided into.
const STEPS: i64 = 256;
/// Nothing nearer than this is drawn.
const NEAR_M: f32 = 0.02;
/// Triangles are cut to this many pixels beyond the image, so that whole numbers cannot overflow.
const GUARD_BAND_PX: f32 = 16384.0;
/// `Raster::triangle` where nothing was drawn.
pub const NO_TRIANGLE: u32 = u32::MAX;

/// What was drawn, row-major.
#[derive(Clone, Debug, PartialEq)]
pub struct Raster {
    pub width: usize,
    pub height: usize,
    /// Depth along the optical axis in metres; 0 where nothing was drawn.
    pub depth: Vec<f32>,
    /// The nearest triangle; `u32::MAX` where nothing was drawn.
    pub triangle: Vec<u32>,
    /// Weights of that triangle's second and third corner (the first has the rest), correct in space.
    pub barycentric: Vec<Vec2>,
}

/// Which triangles are drawn.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Faces {
    #[default]
    Both,
    /// Only those whose counter-clockwise side is seen: enough for a closed mesh, and faster.
    Front,
}

/// A rasteriser for one camera; it keeps its buffers from image to image.
#[derive(Clone, Debug)]
pub struct Rasterizer {
    camera: Intrinsics,
    faces: Faces,
    raster: Raster,
    drawn: Rectangle,
    projected: Vec<Projected>,
}

/// A half-open rectangle of pixels.
#[derive(Clone, Copy, Debug, Default)]
struct Rectangle {
    min: [i64; 2],
    max: [i64; 2],
}

/// A vertex on the image, in sub-pixel steps.
#[derive(Clone, Copy, Debug, Default)]
struct Projected {
    x: i64,
    y: i64,
    /// One over depth; 0 marks a vertex that needs clipping first.
    inverse_z: f32,
}

/// A corner of a clipped triangle, with its weights in the whole one.
#[derive(Clone, Copy, Debug)]
struct Corner {
    point: Vec3,
    weights: Vec3,
}

impl Raster {
    fn empty(width: usize, height: usize) -> Self {
        let count = width * height;
        Self {
            width,
            height,
            depth: vec![0.0; count],
            triangle: vec![NO_TRIANGLE; count],
            barycentric: vec![Vec2::ZERO; count],
        }
    }

    /// The triangle at a pixel and the weights of its three corners.
    pub fn hit(&self, pixel: usize) -> Option<(u32, Vec3)> {
        let triangle = self.triangle[pixel];
        let Vec2 { x, y } = self.barycentric[pixel];
        (triangle != NO_TRIANGLE).then(|| (triangle, Vec3::new(1.0 - x - y, x, y)))
    }
}

impl Rasterizer {
    pub fn new(camera: Intrinsics) -> Self {
        Self::with_faces(camera, Faces::Both)
    }

    pub fn with_faces(camera: Intrinsics, faces: Faces) -> Self {
        Self {
            camera,
            faces,
            raster: Raster::empty(camera.width as usize, camera.height as usize),
            drawn: Rectangle::default(),
            projected: Vec::new(),
        }
    }

    /// Draws one mesh on an empty image. Triangles with a vertex that is missing or not finite are left out.
    pub fn draw(&mut self, vertices_in_camera: &[Vec3], triangles: &[[u32; 3]]) -> &Raster {
        self.clear();
        self.draw_over(vertices_in_camera, triangles, 0)
    }

    /// Draws another mesh over what is there; its triangles are numbered from `first_triangle`.
    pub fn draw_over(
        &mut self,
        vertices_in_camera: &[Vec3],
        triangles: &[[u32; 3]],
        first_triangle: u32,
    ) -> &Raster {
        let camera = self.camera;
        self.projected.clear();
        self.projected.extend(
            vertices_in_camera
                .iter()
                .map(|&vertex| project(&camera, vertex)),
        );
        for (number, corners) in triangles.iter().enumerate() {
            let number = first_triangle + number as u32;
            let found = corners.map(|vertex| self.projected.get(vertex as usize).copied());
            let [Some(a), Some(b), Some(c)] = found else {
                continue;
            };
            if a.inverse_z * b.inverse_z * c.inverse_z > 0.0 {
                self.fill(number, [a, b, c], None);
            } else {
                let points = corners.map(|vertex| vertices_in_camera[vertex as usize]);
                self.draw_clipped(number, points);
            }
        }
        &self.raster
    }

    /// What was drawn last.
    pub fn raster(&self) -> &Raster {
        &self.raster
    }

    /// Forgets what was drawn.
    pub fn clear(&mut self) {
        let Rectangle { min, max } = self.drawn;
        for y in min[1]..max[1] {
            let row = y as usize * self.raster.width;
            let range = row + min[0] as usize..row + max[0] as usize;
            self.raster.depth[range.clone()].fill(0.0);
            self.raster.triangle[range.clone()].fill(NO_TRIANGLE);
            self.raster.barycentric[range].fill(Vec2::ZERO);
        }
        self.drawn = Rectangle::default();
    }

    fn draw_clipped(&mut self, number: u32, points: [Vec3; 3]) {
        if !points.iter().all(|point| point.is_finite()) {
            return;
        }
        let polygon = clip(&self.camera, points);
        for index in 2..polygon.len() {
            let fan = [polygon[0], polygon[index - 1], polygon[index]];
            let projected = fan.map(|corner| project_unchecked(&self.camera, corner.point));
            self.fill(number, projected, Some(fan.map(|corner| corner.weights)));
        }
    }

    /// Fills the pixels of one triangle; `weights` are its corners' weights in the whole, if it was clipped.
    fn fill(&mut self, number: u32, corners: [Projected; 3], weights: Option<[Vec3; 3]>) {
        let Some(setup) = Setup::new(corners, self.faces) else {
            return;
        };
        let bounds = self.pixels_within(&corners);
        if bounds.min[0] >= bounds.max[0] || bounds.min[1] >= bounds.max[1] {
            return;
        }
        self.drawn.include(bounds);
        let mut row_edges = setup.edges_at(bounds.min);
        for y in bounds.min[1]..bounds.max[1] {
            let mut edges = row_edges;
            let row = y as usize * self.raster.width;
            for pixel in row + bounds.min[0] as usize..row + bounds.max[0] as usize {
                if (edges[0] | edges[1] | edges[2]) >= 0 {
                    self.plot(pixel, number, &setup, edges, weights);
                }
                for (edge, step) in edges.iter_mut().zip(setup.step_x) {
                    *edge += step;
                }
            }
            for (edge, step) in row_edges.iter_mut().zip(setup.step_y) {
                *edge += step;
            }
        }
    }

    #[inline]
    fn plot(
        &mut self,
        pixel: usize,
        number: u32,
        setup: &Setup,
        edges: [i64; 3],
        weights: Option<[Vec3; 3]>,
    ) {
        // 1/z is linear over the image, z is not.
        let [a, b, c] = setup.inverse_z_share(edges);
        let z = 1.0 / (a + b + c);
        let depth = &mut self.raster.depth[pixel];
        if *depth != 0.0 && *depth <= z {
            return;
        }
        *depth = z;
        self.raster.triangle[pixel] = number;
        self.raster.barycentric[pixel] = match weights {
            None => vec2(setup.second(a, b, c), setup.third(a, b, c)) * z,
            Some(weights) => {
                let shares = setup.unswapped([a, b, c]);
                let whole =
                    (weights[0] * shares[0] + weights[1] * shares[1] + weights[2] * shares[2]) * z;
                vec2(whole.y, whole.z)
            }
        };
    }

    /// The pixels whose centres can lie within a triangle.
    fn pixels_within(&self, corners: &[Projected; 3]) -> Rectangle {
        let [a, b, c] = corners;
        let size = [self.raster.width as i64, self.raster.height as i64];
        let low = [a.x.min(b.x).min(c.x), a.y.min(b.y).min(c.y)];
        let high = [a.x.max(b.x).max(c.x), a.y.max(b.y).max(c.y)];
        let first = |axis: usize| {
            (low[axis] + STEPS - 1)
                .div_euclid(STEPS)
                .clamp(0, size[axis])
        };
        let end = |axis: usize| (high[axis].div_euclid(STEPS) + 1).clamp(0, size[axis]);
        Rectangle { min: [first(0), first(1)], max: [end(0), end(1)] }
    }
}

impl Rectangle {
    fn include(&mut self, other: Self) {
        if self.max == [0, 0] {
            *self = other;
            return;
        }
        for axis in 0..2 {
            self.min[axis] = self.min[axis].min(other.min[axis]);
            self.max[axis] = self.max[axis].max(other.max[axis]);
        }
    }
}

/// A triangle ready to be filled: its edge functions, which are >= 0 inside.
struct Setup {
    corners: [Projected; 3],
    swapped: bool,
    bias: [i64; 3],
    step_x: [i64; 3],
    step_y: [i64; 3],
    /// Turns an edge function into its opposite corner's share of 1/z.
    scale: [f32; 3],
}

impl Setup {
    fn new(mut corners: [Projected; 3], faces: Faces) -> Option<Self> {
        let [a, b, c] = corners;
        let mut doubled_area = (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
        // y points down: a triangle that is counter-clockwise to the eye has a negative area here.
        let swapped = doubled_area < 0;
        if doubled_area == 0 || (faces == Faces::Front && !swapped) {
            return None;
        }
        if swapped {
            corners.swap(1, 2);
            doubled_area = -doubled_area;
        }
        let mut setup = Self {
            corners,
            swapped,
            bias: [0; 3],
            step_x: [0; 3],
            step_y: [0; 3],
            scale: corners.map(|corner| corner.inverse_z / doubled_area as f32),
        };
        for index in 0..3 {
            let (from, to) = (corners[(index + 1) % 3], corners[(index + 2) % 3]);
            let (dx, dy) = (to.x - from.x, to.y - from.y);
            // A pixel centre on an edge belongs to the triangle that has it as its top or left one.
            let top_left = dy < 0 || (dy == 0 && dx > 0);
            setup.bias[index] = i64::from(!top_left);
            setup.step_x[index] = -dy * STEPS;
            setup.step_y[index] = dx * STEPS;
        }
        Some(setup)
    }

    /// The edge functions at a pixel's centre, each less its bias.
    fn edges_at(&self, pixel: [i64; 2]) -> [i64; 3] {
        let [x, y] = pixel.map(|coordinate| coordinate * STEPS);
        std::array::from_fn(|index| {
            let (from, to) = (self.corners[(index + 1) % 3], self.corners[(index + 2) % 3]);
            (to.x - from.x) * (y - from.y) - (to.y - from.y) * (x - from.x) - self.bias[index]
        })
    }

    #[inline]
    fn inverse_z_share(&self, edges: [i64; 3]) -> [f32; 3] {
        std::array::from_fn(|index| (edges[index] + self.bias[index]) as f32 * self.scale[index])
    }

    #[inline]
    fn second(&self, _a: f32, b: f32, c: f32) -> f32 {
        if self.swapped { c } else { b }
    }

    #[inline]
    fn third(&self, _a: f32, b: f32, c: f32) -> f32 {
        if self.swapped { b } else { c }
    }

    fn unswapped(&self, [a, b, c]: [f32; 3]) -> [f32; 3] {
        [a, self.second(a, b, c), self.third(a, b, c)]
    }
}

fn project(camera: &Intrinsics, vertex: Vec3) -> Projected {
    let pixel = camera.project(vertex);
    let inside = vertex.z >= NEAR_M
        && pixel.x.abs() < GUARD_BAND_PX
        && pixel.y.abs() < GUARD_BAND_PX
        && vertex.z.is_finite();
    if inside {
        project_unchecked(camera, vertex)
    } else {
        Projected::default()
    }
}

fn project_unchecked(camera: &Intrinsics, vertex: Vec3) -> Projected {
    let steps = camera.project(vertex) * STEPS as f32;
    Projected { x: nearest(steps.x), y: nearest(steps.y), inverse_z: 1.0 / vertex.z }
}

/// The nearest whole number; the library's own is a call on processors without the instruction.
fn nearest(value: f32) -> i64 {
    let above = value + 0.5;
    let toward_zero = above as i64;
    toward_zero - i64::from(toward_zero as f32 > above)
}

/// Cuts a triangle to what is in front of the near plane and inside the guard band (Sutherland and Hodgman 1974).
fn clip(camera: &Intrinsics, points: [Vec3; 3]) -> Vec<Corner> {
    let mut polygon: Vec<Corner> = points
        .into_iter()
        .zip([Vec3::X, Vec3::Y, Vec3::Z])
        .map(|(point, weights)| Corner { point, weights })
        .collect();
    let band = GUARD_BAND_PX - 1.0;
    // Each plane as (normal, offset): a point is kept where `normal . point >= offset`.
    let planes = [
        (Vec3::Z, NEAR_M),
        (Vec3::new(camera.fx, 0.0, camera.cx + band), 0.0),
        (Vec3::new(-camera.fx, 0.0, band - camera.cx), 0.0),
        (Vec3::new(0.0, camera.fy, camera.cy + band), 0.0),
        (Vec3::new(0.0, -camera.fy, band - camera.cy), 0.0),
    ];
    for (normal, offset) in planes {
        polygon = clip_to_plane(&polygon, normal, offset);
    }
    polygon
}

fn clip_to_plane(polygon: &[Corner], normal: Vec3, offset: f32) -> Vec<Corner> {
    let mut kept = Vec::with_capacity(polygon.len() + 1);
    for (index, &corner) in polygon.iter().enumerate() {
        let next = polygon[(index + 1) % polygon.len()];
        let here = normal.dot(corner.point) - offset;
        let there = normal.dot(next.point) - offset;
        if here >= 0.0 {
            kept.push(corner);
        }
        if (here >= 0.0) != (there >= 0.0) {
            // Always from the inside out, so that neighbours cut their common edge at the same place.
            let (inside, outside, share) = if here >= 0.0 {
                (corner, next, here / (here - there))
            } else {
                (next, corner, there / (there - here))
            };
            kept.push(Corner {
                point: inside.point.lerp(outside.point, share),
                weights: inside.weights.lerp(outside.weights, share),
            });
        }
    }
    kept
}

#[cfg(test)]
mod tests {
    use glam::vec3;

    use super::super::primitives::{cuboid, sphere};
    use super::*;

    const CAMERA: Intrinsics =
        Intrinsics { width: 320, height: 288, fx: 252.0, fy: 252.0, cx: 160.3, cy: 143.8 };

    fn quad(corners: [Vec3; 4]) -> (Vec<Vec3>, Vec<[u32; 3]>) {
        (corners.to_vec(), vec![[0, 1, 2], [0, 2, 3]])
    }

    fn point_at(pixel: usize, depth_m: f32) -> Vec3 {
        let width = CAMERA.width as usize;
        CAMERA.unproject(
            vec2((pixel % width) as f32, (pixel / width) as f32),
            depth_m,
        )
    }

    #[test]
    fn rendered_sphere_lies_within_a_millimetre_of_the_true_one() {
        let (center, radius_m) = (vec3(0.1, -0.05, 1.5), 0.4);
        // 82 k triangles: the facets are within 10 um of the sphere.
        let mesh = sphere(center, radius_m, 6);
        let mut rasterizer = Rasterizer::new(CAMERA);
        let raster = rasterizer.draw(&mesh.vertices, &mesh.triangles);
        let mut covered = 0;
        for (pixel, &depth) in raster.depth.iter().enumerate() {
            let ray = point_at(pixel, 1.0);
            let along = ray.dot(center) / ray.length();
            let miss = (center.length_squared() - along * along).max(0.0).sqrt();
            if depth > 0.0 {
                covered += 1;
                let off = (point_at(pixel, depth).distance(center) - radius_m).abs();
                assert!(off < 1e-3, "pixel {pixel}: {off} m");
            } else {
                assert!(miss > radius_m - 1e-4, "hole at pixel {pixel}");
            }
        }
        assert!(covered > 10_000);
    }

    #[test]
    fn a_slanted_plane_is_correct_in_perspective() {
        let corners = [(-3.0, -3.0), (3.0, -3.0), (3.0, 3.0), (-3.0, 3.0)]
            .map(|(x, y)| vec3(x, y, 2.0 + 0.5 * x + 0.1 * y));
        let (vertices, triangles) = quad(corners);
        let mut rasterizer = Rasterizer::new(CAMERA);
        let raster = rasterizer.draw(&vertices, &triangles);
        for (pixel, &depth) in raster.depth.iter().enumerate() {
            let Some((triangle, weights)) = raster.hit(pixel) else {
                continue;
            };
            let seen = point_at(pixel, depth);
            assert!((seen.z - (2.0 + 0.5 * seen.x + 0.1 * seen.y)).abs() < 1e-3);
            let [a, b, c] = triangles[triangle as usize].map(|vertex| vertices[vertex as usize]);
            let blended = a * weights.x + b * weights.y + c * weights.z;
            // Half a sub-pixel step on a plane this steep is 2 mm at its far end.
            assert!(blended.distance(seen) < 5e-3, "{blended} against {seen}");
        }
    }

    #[test]
    fn triangles_that_share_edges_cover_each_pixel_once() {
        // A fan with corners at whole and half pixels, where the edge rule matters most.
        let at = |x: f32, y: f32| CAMERA.unproject(vec2(x, y), 1.0);
        let rim = [
            (20.0, 20.0),
            (160.0, 20.5),
            (300.0, 20.0),
            (300.0, 144.0),
            (300.0, 260.0),
        ];
        let rim2 = [(160.0, 260.0), (20.0, 260.0), (20.0, 100.0)];
        let mut vertices = vec![at(160.0, 144.0)];
        vertices.extend(rim.iter().chain(&rim2).map(|&(x, y)| at(x, y)));
        let mut counts = vec![0_u32; CAMERA.pixel_count()];
        let mut rasterizer = Rasterizer::new(CAMERA);
        for index in 0..8_u32 {
            let triangle = [0, 1 + index, 1 + (index + 1) % 8];
            let raster = rasterizer.draw(&vertices, &[triangle]);
            for (count, &depth) in counts.iter_mut().zip(&raster.depth) {
                *count += u32::from(depth > 0.0);
            }
        }
        assert!(counts.iter().all(|&count| count <= 1));
        for y in 22..259 {
            for x in 22..299 {
                assert_eq!(counts[y * 320 + x], 1, "pixel {x}, {y}");
            }
        }
    }

    #[test]
    fn a_floor_under_the_camera_is_cut_at_the_near_plane() {
        let corners =
            [(-5.0, -5.0), (5.0, -5.0), (5.0, 500.0), (-5.0, 500.0)].map(|(x, z)| vec3(x, 1.0, z));
        let (vertices, triangles) = quad(corners);
        let mut rasterizer = Rasterizer::new(CAMERA);
        let raster = rasterizer.draw(&vertices, &triangles);
        for y in 175..CAMERA.height as usize {
            for x in 100..220 {
                let pixel = y * raster.width + x;
                let depth = raster.depth[pixel];
                assert!(depth > 0.0, "hole at {x}, {y}");
                let height = point_at(pixel, depth).y;
                // A sub-pixel step near the horizon moves the plane by a thousandth.
                assert!((height - 1.0).abs() < 2e-3, "height {height} at {x}, {y}");
                let (triangle, weights) = raster.hit(pixel).unwrap();
                let [a, b, c] =
                    triangles[triangle as usize].map(|vertex| vertices[vertex as usize]);
                let blended = a * weights.x + b * weights.y + c * weights.z;
                assert!((blended.z - depth).abs() < 0.02 * depth);
            }
        }
    }

    #[test]
    fn the_nearer_surface_wins_and_buffers_are_emptied_between_images() {
        let near = cuboid(vec3(-0.1, -0.1, 1.0), vec3(0.1, 0.1, 1.2));
        let far = cuboid(vec3(-0.5, -0.5, 2.0), vec3(0.5, 0.5, 2.2));
        let mut rasterizer = Rasterizer::new(CAMERA);
        rasterizer.draw(&far.vertices, &far.triangles);
        let both = rasterizer
            .draw_over(&near.vertices, &near.triangles, 12)
            .clone();
        let center = 144 * both.width + 160;
        assert!((both.depth[center] - 1.0).abs() < 1e-5 && both.triangle[center] >= 12);
        let again = rasterizer.draw(&near.vertices, &near.triangles).clone();
        assert_eq!(
            &again,
            Rasterizer::new(CAMERA).draw(&near.vertices, &near.triangles)
        );
    }

    #[test]
    fn a_closed_mesh_looks_the_same_without_its_back_faces() {
        let mesh = sphere(vec3(0.0, 0.1, 1.0), 0.3, 4);
        let mut whole = Rasterizer::new(CAMERA);
        let mut front = Rasterizer::with_faces(CAMERA, Faces::Front);
        let whole = whole.draw(&mesh.vertices, &mesh.triangles);
        let front = front.draw(&mesh.vertices, &mesh.triangles);
        assert!(front.depth.iter().any(|&depth| depth > 0.0));
        let differing = whole
            .depth
            .iter()
            .zip(&front.depth)
            .filter(|(a, b)| a != b)
            .count();
        assert_eq!(differing, 0);
    }

    #[test]
    fn broken_meshes_draw_nothing() {
        let mut rasterizer = Rasterizer::new(CAMERA);
        let vertices = [
            Vec3::NAN,
            vec3(0.0, 0.0, -1.0),
            vec3(f32::INFINITY, 0.0, 1.0),
        ];
        let raster = rasterizer.draw(&vertices, &[[0, 1, 2], [0, 0, 7]]);
        assert!(raster.depth.iter().all(|&depth| depth == 0.0));
        assert!(
            rasterizer
                .draw(&[], &[])
                .depth
                .iter()
                .all(|&depth| depth == 0.0)
        );
    }
}
