//! Each depth point finds the visible piece of body nearest in place and direction.

use glam::Vec3;

use super::{Visibility, grid::OrientedGrid};
use crate::{observe::DataPoint, residual::Match, surface::PosedSurface};

/// How far and how obliquely matches may reach.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct MatchConfig {
    pub(crate) reach_m: f32,
    /// A difference of normals of one radian counts like this much distance.
    pub(crate) direction_m: f32,
    /// Normals whose cosine is this or less belong to different surfaces.
    pub(crate) oblique: f32,
}

impl MatchConfig {
    /// What is minimised: the squared distance, and the squared chord between the normals.
    #[inline]
    pub(super) fn measure(&self, offset: Vec3, facing: f32) -> f32 {
        offset.length_squared() + self.direction_m * self.direction_m * 2.0 * (1.0 - facing)
    }
}

/// Side of a grid cell: about twice the spacing of the surface's vertices.
const CELL_M: f32 = 0.06;

/// Matches points again and again while the body moves: where a point was last is where it is looked for first.
#[derive(Clone, Debug, Default)]
pub(crate) struct Matcher {
    /// For each point the vertex it was matched with, or `u32::MAX`.
    last: Vec<u32>,
}

impl Matcher {
    /// Matches in the order of the points; points without a partner are left out.
    pub(crate) fn match_points(
        &mut self,
        points: &[DataPoint],
        body: &PosedSurface<'_>,
        visibility: &Visibility,
        config: MatchConfig,
        matches: &mut Vec<Match>,
    ) {
        matches.clear();
        self.last.resize(points.len(), u32::MAX);
        let visible = (0..body.vertices.len() as u32).filter(|&v| visibility.is_visible(v));
        let grid = OrientedGrid::new(&body.vertices, &body.normals, visible, CELL_M);
        for (point, last) in points.iter().zip(&mut self.last) {
            let guess = guess(*last, point, body, visibility, config);
            let found = grid.nearest(point.position, point.normal, guess, config);
            *last = found.map_or(u32::MAX, |found| found.0);
            let matched = found.and_then(|(vertex, _)| matched(point, vertex, body, config));
            matches.extend(matched);
        }
    }
}

/// A vertex and its measure, if it could be matched now.
fn guess(
    vertex: u32,
    point: &DataPoint,
    body: &PosedSurface<'_>,
    visibility: &Visibility,
    config: MatchConfig,
) -> Option<(u32, f32)> {
    if vertex == u32::MAX || !visibility.is_visible(vertex) {
        return None;
    }
    let facing = body.normals[vertex as usize].dot(point.normal);
    let offset = body.vertices[vertex as usize] - point.position;
    (facing > config.oblique).then(|| (vertex, config.measure(offset, facing)))
}

fn matched(
    point: &DataPoint,
    vertex: u32,
    body: &PosedSurface<'_>,
    config: MatchConfig,
) -> Option<Match> {
    let body_normal = body.normals[vertex as usize];
    let facing = point.normal.dot(body_normal);
    Some(Match {
        vertex,
        point: point.position,
        normal: (point.normal + body_normal).try_normalize()?,
        sigma_m: point.sigma_m,
        trust: ((facing - config.oblique) / (1.0 - config.oblique)).min(1.0),
    })
}
