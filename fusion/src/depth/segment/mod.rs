//! Which pixels are the person being followed.
//!
//! On an image of half the size: find the floor, take it away, split what is left at steps in depth, keep
//! what has a body's measures, and choose: whoever was followed, else the nearest.

mod body;
mod coarse;
mod floor;
mod label;
mod planarity;
mod split;
mod visibility;

use glam::Vec3;
use serde::{Deserialize, Serialize};

pub use self::{
    body::{Body, BodyConfig},
    floor::FloorConfig,
    visibility::VisibilityConfig,
};
use self::{
    coarse::{CELL_PX, Coarse},
    floor::FloorFinder,
    label::{Labels, NO_LABEL},
    visibility::ValidWindow,
};
use super::tolerance::Tolerance;
use crate::{
    clean::{FloorPlane, PersonVisibility},
    maps::{DepthMap, Rays, Region},
};

#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SegmentConfig {
    pub floor: FloorConfig,
    pub body: BodyConfig,
    pub visibility: VisibilityConfig,
    /// Who is followed at first, if not the nearest: whoever is nearest to this place in the picture, from `[0, 0]` at
    /// its top left to `[1, 1]`.
    pub pick: Option<[f32; 2]>,
}

/// What was found in one frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Segmentation {
    /// One flag a pixel.
    pub person: Vec<bool>,
    /// The smallest rectangle with all of the person's pixels.
    pub region: Region,
    pub floor: Option<FloorPlane>,
    pub visibility: PersonVisibility,
    /// Everything with a body's measures, the chosen one first.
    pub bodies: Vec<Body>,
}

/// Follows one person from frame to frame.
#[derive(Clone, Debug)]
pub struct Segmenter {
    config: SegmentConfig,
    coarse: Coarse,
    floor: FloorFinder,
    labels: Labels,
    valid_window: ValidWindow,
    /// Where the person was seen last, and how many frames ago.
    target: Option<(Vec3, u32)>,
    /// Who is to be followed from the next frame on that shows anybody.
    pick: Option<[f32; 2]>,
}

impl Segmenter {
    pub fn new(rays: &Rays, config: SegmentConfig) -> Self {
        Self {
            coarse: Coarse::new(rays),
            floor: FloorFinder::new(config.floor.clone()),
            labels: Labels::default(),
            valid_window: ValidWindow::default(),
            target: None,
            pick: config.pick,
            config,
        }
    }

    /// From the next frame on follows whoever is nearest to a place in the picture: see [`SegmentConfig::pick`].
    pub fn pick(&mut self, place: [f32; 2]) {
        self.pick = Some(place);
    }

    /// Finds the person in the next frame.
    pub fn segment(
        &mut self,
        depth: &DepthMap,
        rays: &Rays,
        tolerance: &Tolerance,
    ) -> Segmentation {
        self.coarse.update(depth, tolerance);
        self.valid_window.include(&self.coarse);
        let floor = self.floor.find(&self.coarse, tolerance);
        self.labels.split(&self.coarse, floor, tolerance);
        let mut bodies = body::find(
            &self.coarse,
            &mut self.labels,
            floor,
            tolerance,
            &self.config.body,
        );
        self.choose(&mut bodies, rays);
        let Some(chosen) = bodies.first() else {
            return Segmentation {
                person: vec![false; depth.metres.len()],
                region: Region { columns: 0..0, rows: 0..0 },
                floor,
                visibility: PersonVisibility::Nobody,
                bodies,
            };
        };
        self.labels
            .attach_fragments(&self.coarse, chosen, &self.config.body);
        let visibility = self.visibility(chosen, floor, tolerance);
        let (person, region) = self.mask(depth, rays, chosen.label, floor, tolerance);
        Segmentation { person, region, floor, visibility, bodies }
    }

    /// Puts the body first that was picked or followed, or else the nearest.
    fn choose(&mut self, bodies: &mut [Body], rays: &Rays) {
        let config = &self.config.body;
        if !bodies.is_empty()
            && let Some(place) = self.pick.take()
        {
            let ray = rays.at(place);
            let off = |body: &Body| (body.centroid / body.centroid.z).truncate().distance(ray);
            bodies.sort_by(|a, b| off(a).total_cmp(&off(b)));
            self.target = Some((bodies[0].centroid, 0));
            return;
        }
        if let Some((last, missed)) = self.target {
            let nearest = |body: &Body| body.centroid.distance(last);
            bodies.sort_by(|a, b| nearest(a).total_cmp(&nearest(b)));
            if bodies
                .first()
                .is_some_and(|body| nearest(body) <= config.follow_within_m)
            {
                self.target = Some((bodies[0].centroid, 0));
                return;
            }
            if missed < config.wait_frames {
                self.target = Some((last, missed + 1));
            } else {
                self.target = None;
            }
        }
        bodies.sort_by(|a, b| a.rank_m.total_cmp(&b.rank_m));
        // While waiting for the followed person somebody else is shown, but not yet followed.
        if self.target.is_none() {
            self.target = bodies.first().map(|body| (body.centroid, 0));
        }
    }

    fn visibility(
        &self,
        chosen: &Body,
        floor: Option<FloorPlane>,
        tolerance: &Tolerance,
    ) -> PersonVisibility {
        let contact =
            self.valid_window
                .contact(&self.coarse, &self.labels, chosen.label, tolerance);
        visibility::judge(chosen, contact, floor, &self.config.visibility)
    }

    /// The label's pixels at full size: those near the depth of a cell of its beside them, and off the floor.
    fn mask(
        &self,
        depth: &DepthMap,
        rays: &Rays,
        label: u32,
        floor: Option<FloorPlane>,
        tolerance: &Tolerance,
    ) -> (Vec<bool>, Region) {
        let mut person = vec![false; depth.metres.len()];
        let cells = self.labels.region_of(label, &self.coarse).grown(
            1,
            self.coarse.width,
            self.coarse.height,
        );
        let (mut low, mut high) = ([usize::MAX; 2], [0; 2]);
        let rows = cells.rows.start * CELL_PX..(cells.rows.end * CELL_PX).min(depth.height);
        let columns = cells.columns.start * CELL_PX..(cells.columns.end * CELL_PX).min(depth.width);
        for y in rows {
            for x in columns.clone() {
                let pixel = y * depth.width + x;
                let depth_m = depth.metres[pixel];
                if depth_m.is_nan() || !self.near_label(x, y, depth_m, label, tolerance) {
                    continue;
                }
                if floor.is_some_and(|floor| {
                    label::is_floor(rays.point(pixel, depth_m), floor, tolerance)
                }) {
                    continue;
                }
                person[pixel] = true;
                low = [low[0].min(x), low[1].min(y)];
                high = [high[0].max(x + 1), high[1].max(y + 1)];
            }
        }
        if low[0] == usize::MAX {
            return (person, Region { columns: 0..0, rows: 0..0 });
        }
        (
            person,
            Region { columns: low[0]..high[0], rows: low[1]..high[1] },
        )
    }

    /// Whether the pixel's cell, or one of the three cells it is next to, is of the label and at its depth.
    #[inline]
    fn near_label(
        &self,
        x: usize,
        y: usize,
        depth_m: f32,
        label: u32,
        tolerance: &Tolerance,
    ) -> bool {
        let (width, height) = (self.coarse.width, self.coarse.height);
        let cell_at = |x: usize, y: usize| y.min(height - 1) * width + x.min(width - 1);
        let (cell_x, cell_y) = (x / CELL_PX, y / CELL_PX);
        let own = cell_at(cell_x, cell_y);
        let limit_m = tolerance.step_m(
            depth_m,
            CELL_PX as f32,
            label::MAX_SLOPE,
            label::STEP_SIGMAS,
        );
        let agrees = |cell: usize| {
            self.labels.of_cell(cell) == label
                && (self.coarse.points[cell].z - depth_m).abs() < limit_m
        };
        if agrees(own) {
            return true;
        }
        let beside_x = if x.is_multiple_of(CELL_PX) {
            cell_x.saturating_sub(1)
        } else {
            cell_x + 1
        };
        let beside_y = if y.is_multiple_of(CELL_PX) {
            cell_y.saturating_sub(1)
        } else {
            cell_y + 1
        };
        // A cell of another label is somebody's: only unlabelled depth is taken in from beside.
        let is_free = self.labels.of_cell(own) == NO_LABEL
            || (self.coarse.points[own].z - depth_m).abs() >= limit_m;
        is_free
            && (agrees(cell_at(beside_x, cell_y))
                || agrees(cell_at(cell_x, beside_y))
                || agrees(cell_at(beside_x, beside_y)))
    }
}
