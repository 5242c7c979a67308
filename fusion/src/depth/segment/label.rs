//! Splits the scene into connected parts: neighbours hang together unless there is a step between them.

use glam::Vec3;

use super::{
    super::tolerance::Tolerance,
    body::{Body, BodyConfig},
    coarse::{CELL_PX, Coarse},
    floor::noise_across_m,
};
use crate::{clean::FloorPlane, disjoint_sets::DisjointSets, maps::Region};

/// Of the floor, of holes, and of parts too small to matter.
pub(super) const NO_LABEL: u32 = u32::MAX;
/// A surface steeper than this, in metres a metre, ends: 76 degrees from face on.
pub(super) const MAX_SLOPE: f32 = 4.0;
/// Noise that neighbours may differ by, in standard deviations of their difference.
pub(super) const STEP_SIGMAS: f32 = 4.0;
/// The farthest cell that a hole is bridged to: sensors with dropouts cut bodies into pieces otherwise.
const BRIDGE: usize = 3;
/// The farthest cell that a limb is looked for across a hole: stereo leaves a shadow beside every near part.
const LIMB_REACH: usize = 8;
/// Fewer cells than this are noise.
const MIN_CELLS: u32 = 12;
/// Everything closer to the floor than this belongs to it, beside the noise.
const FLOOR_SKIN_M: f32 = 0.02;

/// Nothing this high above the floor is the floor.
const HIGH_M: f32 = 0.4;

/// The part each cell belongs to.
#[derive(Clone, Debug, Default)]
pub(super) struct Labels {
    cells: Vec<u32>,
    sets: DisjointSets,
    /// Cells in each part.
    pub(super) sizes: Vec<u32>,
}

/// Whether a point is the floor, as far as the sensor can tell.
#[inline]
pub(super) fn is_floor(point: Vec3, floor: FloorPlane, tolerance: &Tolerance) -> bool {
    let height_m = floor.height_m(point);
    // Most points are far above any sensor's noise, and need no look at it.
    height_m < HIGH_M && height_m < FLOOR_SKIN_M + 3.0 * noise_across_m(point, floor, tolerance)
}

impl Labels {
    pub(super) fn of_cell(&self, cell: usize) -> u32 {
        self.cells[cell]
    }

    /// Moves a cell to another part.
    pub(super) fn set(&mut self, cell: usize, label: u32) {
        self.sizes[self.cells[cell] as usize] -= 1;
        self.sizes[label as usize] += 1;
        self.cells[cell] = label;
    }

    /// A new part, without cells as yet.
    pub(super) fn add(&mut self) -> u32 {
        self.sizes.push(0);
        self.sizes.len() as u32 - 1
    }

    pub(super) fn split(
        &mut self,
        coarse: &Coarse,
        floor: Option<FloorPlane>,
        tolerance: &Tolerance,
    ) {
        let count = coarse.points.len();
        self.sets.reset(count);
        self.cells.clear();
        self.cells.extend(coarse.points.iter().map(|&point| {
            let solid =
                !point.z.is_nan() && !floor.is_some_and(|floor| is_floor(point, floor, tolerance));
            if solid { 0 } else { NO_LABEL }
        }));
        for y in 0..coarse.height {
            for x in 0..coarse.width {
                let cell = y * coarse.width + x;
                if self.cells[cell] != NO_LABEL {
                    self.join_to_earlier(coarse, [x, y], tolerance);
                }
            }
        }
        self.number();
    }

    /// Joins a cell with those to its left and above; across a hole with the first one behind it.
    fn join_to_earlier(&mut self, coarse: &Coarse, [x, y]: [usize; 2], tolerance: &Tolerance) {
        let width = coarse.width;
        let cell = y * width + x;
        let depth_m = coarse.points[cell].z;
        let near_m = tolerance.step_m(depth_m, CELL_PX as f32, MAX_SLOPE, STEP_SIGMAS);
        let mut joined_above = false;
        for (available, step) in [(x, 1), (y, width)] {
            for distance in 1..=BRIDGE.min(available) {
                let other = cell - distance * step;
                if self.cells[other] == NO_LABEL {
                    continue;
                }
                // Across a hole no more slope is allowed for than next door: it may hide a step.
                if (coarse.points[other].z - depth_m).abs() < near_m {
                    self.sets.join(cell as u32, other as u32);
                    joined_above = step == width;
                }
                break;
            }
        }
        if joined_above {
            return;
        }
        let diagonals = [(x > 0, width + 1), (x + 1 < width, width - 1)];
        for (_, back) in diagonals.into_iter().filter(|&(inside, _)| y > 0 && inside) {
            let other = cell - back;
            if self.cells[other] != NO_LABEL && (coarse.points[other].z - depth_m).abs() < near_m {
                self.sets.join(cell as u32, other as u32);
            }
        }
    }

    /// Gives the parts numbers in order of their first cell, and drops the tiny ones.
    fn number(&mut self) {
        let count = self.cells.len();
        let mut sizes_of_roots = vec![0_u32; count];
        for cell in (0..count).filter(|&cell| self.cells[cell] != NO_LABEL) {
            sizes_of_roots[self.sets.root(cell as u32) as usize] += 1;
        }
        self.sizes.clear();
        // A set's root is its first cell, so it has been numbered when its others come.
        for cell in 0..count {
            if self.cells[cell] == NO_LABEL {
                continue;
            }
            let root = self.sets.root(cell as u32) as usize;
            self.cells[cell] = if sizes_of_roots[root] < MIN_CELLS {
                NO_LABEL
            } else if root == cell {
                self.sizes.push(sizes_of_roots[root]);
                self.sizes.len() as u32 - 1
            } else {
                self.cells[root]
            };
        }
    }

    /// The rectangle of cells around a part.
    pub(super) fn region_of(&self, label: u32, coarse: &Coarse) -> Region {
        let (mut low, mut high) = ([usize::MAX; 2], [0; 2]);
        for (y, row) in self.cells.chunks_exact(coarse.width).enumerate() {
            let Some(first) = row.iter().position(|&cell| cell == label) else {
                continue;
            };
            let last = row.iter().rposition(|&cell| cell == label).unwrap_or(first);
            low = [low[0].min(first), low[1].min(y)];
            high = [high[0].max(last + 1), high[1].max(y + 1)];
        }
        if low[0] == usize::MAX {
            return Region { columns: 0..0, rows: 0..0 };
        }
        Region { columns: low[0]..high[0], rows: low[1]..high[1] }
    }

    /// Gives a body the small parts beside it that it must own: a hand in front of the chest, the far arm
    /// of somebody seen from the side; and the larger ones above or below it: legs behind a hem and a hand.
    pub(super) fn attach_fragments(&mut self, coarse: &Coarse, body: &Body, config: &BodyConfig) {
        let mut contacts = vec![Contact::default(); self.sizes.len()];
        let region =
            self.region_of(body.label, coarse)
                .grown(LIMB_REACH, coarse.width, coarse.height);
        for y in region.rows.clone() {
            for x in region.columns.clone() {
                let cell = y * coarse.width + x;
                if self.cells[cell] != body.label {
                    continue;
                }
                for (available, step) in [
                    (x, -1),
                    (coarse.width - 1 - x, 1),
                    (y, -(coarse.width as isize)),
                    (coarse.height - 1 - y, coarse.width as isize),
                ] {
                    if let Some((label, behind_m)) =
                        self.first_other(coarse, cell, [available as isize, step])
                    {
                        contacts[label as usize].count(behind_m, config);
                    }
                }
            }
        }
        let own_cells = f64::from(self.sizes[body.label as usize]);
        let owned: Vec<bool> = (0_u32..)
            .zip(&contacts)
            .map(|(label, contact)| {
                let cells = f64::from(self.sizes[label as usize]);
                // A part that touches along a good share of its outline, not in passing.
                let limb = cells <= own_cells * f64::from(config.max_fragment_share)
                    && f64::from(contact.limb) > 0.5 * cells.sqrt();
                let half = cells <= own_cells * f64::from(config.max_half_share)
                    && f64::from(contact.half) > 0.3 * cells.sqrt()
                    && self.are_stacked(coarse, body.label, label);
                limb || half
            })
            .collect();
        for cell in &mut self.cells {
            if *cell != NO_LABEL && owned[*cell as usize] {
                *cell = body.label;
            }
        }
    }

    /// The part next to a body's cell in one direction, and how far behind it is.
    fn first_other(
        &self,
        coarse: &Coarse,
        cell: usize,
        [available, step]: [isize; 2],
    ) -> Option<(u32, f32)> {
        let own = self.cells[cell];
        let other = (1..=available.min(LIMB_REACH as isize))
            .map(|distance| cell.wrapping_add_signed(distance * step))
            .find(|&other| self.cells[other] != NO_LABEL)?;
        let label = self.cells[other];
        let behind_m = coarse.points[other].z - coarse.points[cell].z;
        (label != own).then_some((label, behind_m))
    }

    /// Whether one part is above the other rather than beside it, as two people would be.
    fn are_stacked(&self, coarse: &Coarse, a: u32, b: u32) -> bool {
        let (a, b) = (
            self.region_of(a, coarse).rows,
            self.region_of(b, coarse).rows,
        );
        let shared = a.end.min(b.end).saturating_sub(a.start.max(b.start));
        2 * shared <= a.len().min(b.len())
    }
}

/// Cells in which a part touches a body, by what the gap in depth allows it to be.
#[derive(Clone, Copy, Debug, Default)]
struct Contact {
    limb: u32,
    half: u32,
}

impl Contact {
    fn count(&mut self, behind_m: f32, config: &BodyConfig) {
        let limb = behind_m < config.fragment_behind_m && behind_m > -config.fragment_before_m;
        self.limb += u32::from(limb);
        self.half += u32::from(behind_m.abs() < config.half_apart_m);
    }
}
