//! Each depth point finds the visible piece of body nearest in place and direction.

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

/// Side of a grid cell: about twice the spacing of the surface's vertices.
const CELL_M: f32 = 0.06;

/// Matches in the order of the points; points without a partner are left out.
pub(crate) fn match_points(
    points: &[DataPoint],
    body: &PosedSurface<'_>,
    visibility: &Visibility,
    config: MatchConfig,
    matches: &mut Vec<Match>,
) {
    matches.clear();
    let visible = (0..body.vertices.len() as u32).filter(|&v| visibility.is_visible(v));
    let grid = OrientedGrid::new(&body.vertices, &body.normals, visible, CELL_M);
    for point in points {
        let found = grid.nearest(point.position, point.normal, config);
        let Some((vertex, _)) = found else {
            continue;
        };
        let body_normal = body.normals[vertex as usize];
        let Some(normal) = (point.normal + body_normal).try_normalize() else {
            continue;
        };
        matches.push(Match {
            vertex,
            point: point.position,
            normal,
            sigma_m: point.sigma_m,
            trust: ((point.normal.dot(body_normal) - config.oblique) / (1.0 - config.oblique))
                .min(1.0),
        });
    }
}
