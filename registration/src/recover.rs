//! A limb gone astray: tries other places for each arm, and keeps what the picture agrees with.

use glam::{Quat, Vec3};

use crate::{
    align::{Aligned, Effort},
    correspond::Renderer,
    initialize::{COARSE, Searcher, Sight},
    observe::Observation,
    state::BodyState,
    surface::PosedSurface,
};

/// Looks for better arms than the present ones; `None` if there are none.
pub(crate) fn recover_arms(
    searcher: &Searcher<'_>,
    sight: &Sight<'_>,
    present: &Aligned,
) -> Option<Aligned> {
    let mut candidates = vec![present.state];
    for arm in [LEFT, RIGHT] {
        candidates = best_arms(searcher, sight.coarse, &candidates, &arm);
    }
    let coarse = Effort { rounds: 4, widen: 2.0, ..COARSE };
    let nearer = searcher.refine(&candidates, searcher.coarse, sight.coarse, &coarse);
    let fine = Effort {
        rounds: 6,
        steps: 1,
        every: 1,
        drawn_visibility: true,
        widen: 1.5,
        settled_from: 0.5,
    };
    let starts: Vec<BodyState> = nearer.iter().take(FINALISTS).map(|a| a.state).collect();
    let found = searcher.refine(&starts, searcher.fine, sight.fine, &fine);
    let found = found
        .into_iter()
        .min_by(|a, b| a.stray.total_cmp(&b.stray))?;
    let better =
        found.stray < 0.8 * present.stray && found.agreement.error_m < present.agreement.error_m;
    better.then_some(found)
}

/// Bodies kept after each arm, and aligned coarsely.
const CANDIDATES: usize = 4;
/// Bodies aligned finely.
const FINALISTS: usize = 2;

/// The joints of one arm; the right one mirrors the left.
struct Arm {
    collar: usize,
    shoulder: usize,
    elbow: usize,
    wrist: usize,
    side: f32,
}

const LEFT: Arm = Arm { collar: 13, shoulder: 16, elbow: 18, wrist: 20, side: 1.0 };
const RIGHT: Arm = Arm { collar: 14, shoulder: 17, elbow: 19, wrist: 21, side: -1.0 };

/// Where the left upper arm may point, in the chest's axes.
const DIRECTIONS: [[f32; 3]; 14] = [
    [0.30, -0.95, 0.0],
    [0.25, -0.85, 0.45],
    [0.30, -0.85, -0.40],
    [0.70, -0.70, 0.0],
    [0.60, -0.50, 0.60],
    [1.00, 0.0, 0.0],
    [0.75, 0.0, 0.65],
    [0.25, 0.0, 0.97],
    [0.10, -0.5, 0.85],
    [0.75, 0.65, 0.0],
    [0.30, 0.95, 0.0],
    [0.25, 0.65, 0.70],
    [0.15, 0.90, 0.40],
    [0.55, 0.55, 0.60],
];
/// The elbow straight, and bent with the forearm turned in three directions about the upper arm.
const BENDS: [[f32; 2]; 5] = [[0.15, 0.0], [1.4, -1.2], [1.4, 0.0], [1.4, 1.2], [2.0, 0.0]];

/// The best few bodies with this arm anywhere, the given ones among them.
fn best_arms(
    searcher: &Searcher<'_>,
    observation: &Observation,
    starts: &[BodyState],
    arm: &Arm,
) -> Vec<BodyState> {
    let mut renderer = Renderer::new(&observation.view);
    let mut judged = |state: BodyState| {
        let body = PosedSurface::new(searcher.coarse, &state);
        (renderer.agreement(&body, &observation.view).error_m, state)
    };
    let mut candidates: Vec<(f32, BodyState)> = starts.iter().map(|s| judged(*s)).collect();
    for direction in DIRECTIONS {
        for [bend, twist] in BENDS {
            // The other arm is settled in its own turn: the first start stands for all.
            candidates.push(judged(arm.placed(
                &starts[0],
                Vec3::from(direction),
                bend,
                twist,
            )));
        }
    }
    candidates.sort_by(|a, b| a.0.total_cmp(&b.0));
    candidates.truncate(CANDIDATES);
    candidates.into_iter().map(|(_, state)| state).collect()
}

impl Arm {
    fn placed(&self, start: &BodyState, direction: Vec3, bend: f32, twist: f32) -> BodyState {
        let mirror = Vec3::new(self.side, 1.0, 1.0);
        let along = Vec3::X * self.side;
        let towards = (direction * mirror).normalize_or(along);
        let mut state = *start;
        state.rotations[self.collar] = Quat::IDENTITY;
        state.rotations[self.shoulder] =
            Quat::from_rotation_arc(along, towards) * Quat::from_rotation_x(twist);
        state.rotations[self.elbow] = Quat::from_rotation_y(-self.side * bend);
        state.rotations[self.wrist] = Quat::IDENTITY;
        state
    }
}
