//! A frame made metric, denoised, and reduced to the person.

use effigy_capture::{Calibration, Frame, FrameId, Timestamp};
use glam::Vec3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::{
    depth::{
        bilateral::{Bilateral, BilateralConfig},
        fill::{self, FillConfig, Filled},
        flying_pixels::{FlyingPixelConfig, drop_flying_pixels},
        segment::{Body, SegmentConfig, Segmentation, Segmenter},
        sigma::SigmaTable,
        tolerance::Tolerance,
    },
    error::FusionError,
    maps::{DepthMap, NormalMap, Rays, Region, VertexMap},
    normals::reach_px,
};

/// One frame's clean geometry in the depth camera's space; all maps have one size.
#[derive(Clone, Debug)]
pub struct CleanFrame {
    pub id: FrameId,
    pub timestamp: Timestamp,
    /// Everything in the working volume: cleaned where the person is, as measured elsewhere.
    pub depth: DepthMap,
    /// The person's points; NaN elsewhere.
    pub vertices: VertexMap,
    /// The person's normals; NaN elsewhere.
    pub normals: NormalMap,
    /// Pixels that belong to the person being followed.
    pub person: Vec<bool>,
    /// Standard deviation of each of the person's depths, in metres; NaN elsewhere.
    pub sigma_m: Vec<f32>,
    /// The floor, where enough of it is seen.
    pub floor: Option<FloorPlane>,
    pub visibility: PersonVisibility,
}

/// Points `p` with `normal . p = offset_m`; the normal points up, away from the floor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FloorPlane {
    pub normal: Vec3,
    pub offset_m: f32,
}

/// How much of a person the camera has in view.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PersonVisibility {
    Nobody,
    /// The image border or the working volume cuts the body.
    Partial,
    Whole,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct CleanConfig {
    /// The working volume's nearest and farthest depth; the sensor's own range if not given.
    pub range_m: Option<[f32; 2]>,
    pub flying_pixels: FlyingPixelConfig,
    pub bilateral: BilateralConfig,
    pub fill: FillConfig,
    /// A filled pixel was not measured: its sigma is this many times the sensor's.
    pub filled_sigma_factor: f32,
    pub segment: SegmentConfig,
}

impl Default for CleanConfig {
    fn default() -> Self {
        Self {
            range_m: None,
            flying_pixels: FlyingPixelConfig::default(),
            bilateral: BilateralConfig::default(),
            fill: FillConfig::default(),
            filled_sigma_factor: 3.0,
            segment: SegmentConfig::default(),
        }
    }
}

/// Pixels around the person in which flying pixels are looked for.
const MARGIN_PX: usize = 8;

/// Cleans one source's frames, one after the other.
#[derive(Clone, Debug)]
pub struct Cleaner {
    calibration: Calibration,
    config: CleanConfig,
    rays: Rays,
    tolerance: Tolerance,
    sigmas: SigmaTable,
    segmenter: Segmenter,
    bilateral: Bilateral,
    bodies: Vec<Body>,
    scratch_depth: Vec<f32>,
    spare: Option<Spare>,
}

/// The memory of a frame that nobody needs any more; without a measurement but for the depth.
#[derive(Clone, Debug)]
struct Spare {
    depth: Vec<f32>,
    points: Vec<Vec3>,
    normals: Vec<Vec3>,
    sigma_m: Vec<f32>,
}

impl Cleaner {
    pub fn new(calibration: Calibration, config: CleanConfig) -> Self {
        let rays = Rays::new(&calibration.depth);
        Self {
            tolerance: Tolerance::new(calibration.sensor, &calibration.depth.intrinsics),
            sigmas: SigmaTable::new(calibration.sensor),
            segmenter: Segmenter::new(&rays, config.segment.clone()),
            bilateral: Bilateral::new(&config.bilateral),
            bodies: Vec::new(),
            scratch_depth: Vec::new(),
            spare: None,
            rays,
            calibration,
            config,
        }
    }

    /// Cleans the next frame. Nobody in view is not an error; a frame of another size is.
    pub fn process(&mut self, frame: &Frame) -> Result<CleanFrame, FusionError> {
        self.check_size(frame)?;
        let range_m = self.config.range_m.unwrap_or(self.calibration.range_m);
        let scale = self.calibration.metres_per_unit;
        let Spare { depth, points, normals, sigma_m } = self.spare();
        let mut depth = DepthMap::in_metres_into(depth, &frame.depth, scale, range_m);
        let Segmentation { mut person, region, floor, visibility, bodies } =
            self.segmenter.segment(&depth, &self.rays, &self.tolerance);
        let person_m = bodies.first().map_or(f32::NAN, |body| body.centroid.z);
        self.bodies = bodies;
        let filled = self.clean_person(&mut depth, &mut person, &region);
        let vertices = self.unproject_person(points, &depth, &person, &region);
        let reach = self.reach_px(person_m);
        let normals = NormalMap::within(normals, &vertices, &region, reach);
        let sigma_m = self.sigma(sigma_m, (&vertices, &normals), &region, &filled);
        let (id, timestamp) = (frame.id, frame.timestamp);
        Ok(CleanFrame {
            id,
            timestamp,
            depth,
            vertices,
            normals,
            person,
            sigma_m,
            floor,
            visibility,
        })
    }

    /// Takes a frame back, as [`Self::process`] made it: its memory serves the next one, which spares the system
    /// some ten megabytes of fresh pages a frame.
    pub fn recycle(&mut self, frame: CleanFrame) {
        let CleanFrame { depth, vertices, normals, person, mut sigma_m, .. } = frame;
        let (mut points, mut normals) = (vertices.points, normals.normals);
        let width = depth.width.max(1);
        for (row, person) in person.chunks_exact(width).enumerate() {
            let Some(first) = person.iter().position(|&person| person) else {
                continue;
            };
            let last = person.iter().rposition(|&person| person).unwrap_or(first);
            let touched = row * width + first..=row * width + last;
            points[touched.clone()].fill(Vec3::NAN);
            normals[touched.clone()].fill(Vec3::NAN);
            sigma_m[touched].fill(f32::NAN);
        }
        self.spare = Some(Spare { depth: depth.metres, points, normals, sigma_m });
    }

    /// Memory for a frame of this source.
    fn spare(&mut self) -> Spare {
        let camera = &self.calibration.depth.intrinsics;
        let count = camera.pixel_count();
        let fits = |spare: &Spare| spare.points.len() == count && spare.sigma_m.len() == count;
        self.spare.take().filter(fits).unwrap_or_else(|| Spare {
            depth: Vec::new(),
            points: vec![Vec3::NAN; count],
            normals: vec![Vec3::NAN; count],
            sigma_m: vec![f32::NAN; count],
        })
    }

    /// From the next frame on follows whoever is nearest to a place in the picture, from `[0, 0]` at its top left to
    /// `[1, 1]`.
    pub fn pick(&mut self, place: [f32; 2]) {
        self.segmenter.pick(place);
    }

    /// Everything in the last frame with a body's measures, the person being followed first.
    pub fn bodies(&self) -> &[Body] {
        &self.bodies
    }

    /// How far normals reach at somebody's distance: farther where depth is noisy.
    fn reach_px(&self, person_m: f32) -> usize {
        if person_m.is_nan() {
            return reach_px(0.0, 1.0);
        }
        reach_px(
            self.tolerance.sigma_m(person_m),
            self.tolerance.pixel_size_m(person_m),
        )
    }

    fn check_size(&self, frame: &Frame) -> Result<(), FusionError> {
        let got_px = [frame.depth.width(), frame.depth.height()];
        let camera = &self.calibration.depth.intrinsics;
        let expected_px = [camera.width, camera.height];
        if got_px == expected_px {
            return Ok(());
        }
        Err(FusionError::SizeMismatch { got_px, expected_px })
    }

    /// Drops flying pixels, smooths and fills where the person is; returns what was filled.
    fn clean_person(
        &mut self,
        depth: &mut DepthMap,
        person: &mut [bool],
        region: &Region,
    ) -> Vec<Filled> {
        if region.is_empty() {
            return Vec::new();
        }
        let around = region.grown(MARGIN_PX, depth.width, depth.height);
        let flying = &self.config.flying_pixels;
        drop_flying_pixels(
            depth,
            &around,
            &self.tolerance,
            flying,
            &mut self.scratch_depth,
        );
        self.bilateral
            .smooth(depth, region, person, &self.tolerance);
        let rows = region.rows.start * depth.width..region.rows.end * depth.width;
        for (person, depth_m) in person[rows.clone()].iter_mut().zip(&depth.metres[rows]) {
            *person &= !depth_m.is_nan();
        }
        let filled = fill::fill_holes(depth, person, region, &self.tolerance, &self.config.fill);
        for &Filled { pixel, depth_m } in &filled {
            depth.metres[pixel] = depth_m;
            person[pixel] = true;
        }
        filled
    }

    fn unproject_person(
        &self,
        points: Vec<Vec3>,
        depth: &DepthMap,
        person: &[bool],
        region: &Region,
    ) -> VertexMap {
        let mut vertices = VertexMap { width: depth.width, height: depth.height, points };
        for y in region.rows.clone() {
            let row = y * depth.width;
            let columns = row + region.columns.start..row + region.columns.end;
            for pixel in columns.filter(|&pixel| person[pixel]) {
                vertices.points[pixel] = self.rays.point(pixel, depth.metres[pixel]);
            }
        }
        vertices
    }

    /// The sensor's noise at each of the person's pixels, by depth and by angle of incidence.
    fn sigma(
        &self,
        mut sigma_m: Vec<f32>,
        (vertices, normals): (&VertexMap, &NormalMap),
        region: &Region,
        filled: &[Filled],
    ) -> Vec<f32> {
        let width = vertices.width;
        let rows = region.rows.start * width..region.rows.end * width;
        sigma_m[rows]
            .par_chunks_mut(width)
            .enumerate()
            .for_each(|(row, sigmas)| {
                for x in region.columns.clone() {
                    let pixel = (region.rows.start + row) * width + x;
                    let point = vertices.points[pixel];
                    if !point.z.is_nan() {
                        sigmas[x] = self.sigmas.at(point, normals.normals[pixel]);
                    }
                }
            });
        for fill in filled {
            sigma_m[fill.pixel] *= self.config.filled_sigma_factor;
        }
        sigma_m
    }
}
