//! Where the body is although the picture says that it cannot be.

use super::Visibility;
use crate::{
    observe::{Seen, View},
    residual::{Pull, Push},
    surface::PosedSurface,
};

/// Vertices beside the mask, and vertices in front of what was measured.
#[derive(Clone, Debug, Default)]
pub(crate) struct Contradictions {
    pub(crate) pulls: Vec<Pull>,
    pub(crate) pushes: Vec<Push>,
}

/// Whatever is measured less than this behind a vertex hides it, or is the very limb, cut off the mask by mistake.
const BEHIND_M: f32 = 0.10;
/// Smaller steps in front of the depth are left to the matches.
const PUSH_FROM_M: f32 = 0.02;
/// And so is what may be noise: it would push the body away from the camera, and nothing would push it back.
const PUSH_SIGMAS: f32 = 2.5;

/// Collects what contradicts the view; `slack_cells` is how far outside the mask a vertex may be.
pub(crate) fn contradictions(
    body: &PosedSurface<'_>,
    visibility: &Visibility,
    view: &View,
    slack_cells: f32,
    found: &mut Contradictions,
) {
    found.pulls.clear();
    found.pushes.clear();
    let push_from_m = PUSH_FROM_M.hypot(PUSH_SIGMAS * view.noise_m);
    let noise_m = push_from_m - PUSH_FROM_M;
    let rotation = view.camera_from_world.rotation_matrix();
    let translation = view.camera_from_world.translation;
    for (vertex, position) in (0_u32..).zip(&body.vertices) {
        let in_camera = rotation * *position + translation;
        if in_camera.z < 0.1 {
            continue;
        }
        let cell = view
            .cell_of(in_camera)
            .map(|cell| view.cells[cell])
            .unwrap_or_default();
        if cell.seen == Seen::Person {
            if visibility.is_visible(vertex) && cell.depth_m - in_camera.z > push_from_m {
                let depth_m = cell.depth_m - noise_m;
                found.pushes.push(Push { vertex, depth_m });
            }
            continue;
        }
        if cell.seen == Seen::Gap || position.y < view.ground_m {
            continue;
        }
        if cell.seen == Seen::Other && cell.depth_m < in_camera.z + BEHIND_M {
            continue;
        }
        let place = view.pinhole.project(in_camera);
        let Some(target) = view.nearest_person_to(place) else {
            continue;
        };
        let away = place - target;
        if away.length() > slack_cells {
            found.pulls.push(Pull {
                vertex,
                target,
                direction: away.normalize_or_zero(),
                metres_per_cell: view.metres_per_cell(in_camera.z),
            });
        }
    }
}
