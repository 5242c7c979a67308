//! A hash-free grid over a few thousand oriented points, for nearest neighbours by place and direction.

use glam::{IVec3, Vec3};

use super::MatchConfig;

/// Points sorted into cubic cells.
#[derive(Clone, Debug, Default)]
pub(super) struct OrientedGrid {
    origin: Vec3,
    cell_m: f32,
    size: IVec3,
    /// Where each cell's points start in `entries`; one more than cells.
    starts: Vec<u32>,
    entries: Vec<Entry>,
}

#[derive(Clone, Copy, Debug)]
struct Entry {
    position: Vec3,
    normal: Vec3,
    index: u32,
}

/// More cells than this would cost more than they save.
const MOST_CELLS: i32 = 1 << 18;

impl OrientedGrid {
    /// Sorts the chosen points in; `cell_m` grows if the points reach too far for it.
    pub(super) fn new(
        positions: &[Vec3],
        normals: &[Vec3],
        chosen: impl Iterator<Item = u32> + Clone,
        cell_m: f32,
    ) -> Self {
        let (mut low, mut high) = (Vec3::MAX, Vec3::MIN);
        for i in chosen.clone() {
            low = low.min(positions[i as usize]);
            high = high.max(positions[i as usize]);
        }
        if low.x > high.x {
            return Self { cell_m, ..Self::default() };
        }
        let mut grid = Self { origin: low, cell_m, ..Self::default() };
        loop {
            grid.size = ((high - low) / grid.cell_m).floor().as_ivec3() + 1;
            if grid
                .size
                .x
                .saturating_mul(grid.size.y)
                .saturating_mul(grid.size.z)
                <= MOST_CELLS
            {
                break;
            }
            grid.cell_m *= 1.5;
        }
        grid.sort_in(positions, normals, chosen);
        grid
    }

    /// The point that minimises `|p - x|^2 + direction_m^2 |n - m|^2` within `reach_m` of a place, and that
    /// squared measure. Points whose normals have a cosine of `oblique` or less do not count. A good `guess`
    /// (an index and its measure) shortens the search and does not change what it finds.
    pub(super) fn nearest(
        &self,
        position: Vec3,
        normal: Vec3,
        guess: Option<(u32, f32)>,
        config: MatchConfig,
    ) -> Option<(u32, f32)> {
        let MatchConfig { reach_m, oblique, .. } = config;
        if self.entries.is_empty() {
            return None;
        }
        let home = ((position - self.origin) / self.cell_m).floor().as_ivec3();
        let rings = (reach_m / self.cell_m).ceil() as i32;
        let farthest = (u32::MAX, reach_m * reach_m);
        let mut best = guess
            .filter(|guess| guess.1 < farthest.1)
            .unwrap_or(farthest);
        for ring in 0..=rings {
            // Whatever lies in this ring is at least this far away.
            let at_least_m = (ring - 1).max(0) as f32 * self.cell_m;
            if at_least_m * at_least_m >= best.1 {
                break;
            }
            self.for_each_cell_in_ring(home, ring, |at, cell| {
                if self.squared_distance_to_cell(position, at) >= best.1 {
                    return;
                }
                for entry in self.entries_of(cell) {
                    let facing = entry.normal.dot(normal);
                    if facing <= oblique {
                        continue;
                    }
                    let measure = config.measure(entry.position - position, facing);
                    if measure < best.1 {
                        best = (entry.index, measure);
                    }
                }
            });
        }
        (best.0 != u32::MAX).then_some(best)
    }

    fn sort_in(
        &mut self,
        positions: &[Vec3],
        normals: &[Vec3],
        chosen: impl Iterator<Item = u32> + Clone,
    ) {
        let cells = (self.size.x * self.size.y * self.size.z) as usize;
        self.starts = vec![0; cells + 1];
        for i in chosen.clone() {
            let cell = self.cell_of(positions[i as usize]);
            self.starts[cell + 1] += 1;
        }
        for cell in 0..cells {
            self.starts[cell + 1] += self.starts[cell];
        }
        let empty = Entry { position: Vec3::ZERO, normal: Vec3::ZERO, index: 0 };
        self.entries = vec![empty; self.starts[cells] as usize];
        let mut next = self.starts.clone();
        for index in chosen {
            let position = positions[index as usize];
            let cell = self.cell_of(position);
            self.entries[next[cell] as usize] =
                Entry { position, normal: normals[index as usize], index };
            next[cell] += 1;
        }
    }

    fn cell_of(&self, position: Vec3) -> usize {
        // Towards zero is down: no point lies below the origin.
        let at = ((position - self.origin) / self.cell_m).as_ivec3();
        self.cell_index(at.clamp(IVec3::ZERO, self.size - 1))
    }

    fn cell_index(&self, at: IVec3) -> usize {
        ((at.z * self.size.y + at.y) * self.size.x + at.x) as usize
    }

    fn entries_of(&self, cell: usize) -> &[Entry] {
        &self.entries[self.starts[cell] as usize..self.starts[cell + 1] as usize]
    }

    /// Nothing in the cell is nearer than this; a hair less, because cells were chosen with rounding.
    fn squared_distance_to_cell(&self, position: Vec3, at: IVec3) -> f32 {
        const ROUNDING: f32 = 0.999;
        let low = self.origin + at.as_vec3() * self.cell_m;
        let beyond = (low - position)
            .max(position - low - self.cell_m)
            .max(Vec3::ZERO);
        beyond.length_squared() * ROUNDING
    }

    /// Visits the cells at Chebyshev distance `ring` from `home`.
    fn for_each_cell_in_ring(&self, home: IVec3, ring: i32, mut visit: impl FnMut(IVec3, usize)) {
        let low = (home - ring).max(IVec3::ZERO);
        let high = (home + ring).min(self.size - 1);
        for z in low.z..=high.z {
            for y in low.y..=high.y {
                let whole_row = (z - home.z).abs() == ring || (y - home.y).abs() == ring;
                let mut x = low.x;
                while x <= high.x {
                    if !whole_row && (x - home.x).abs() != ring {
                        // Only the row's two ends belong to the ring.
                        x = (home.x + ring).max(x + 1);
                        continue;
                    }
                    let at = IVec3::new(x, y, z);
                    visit(at, self.cell_index(at));
                    x += 1;
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_grid_finds_what_an_exhaustive_search_finds() {
        let mut seed = 1_u32;
        let mut random = || {
            seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (seed >> 8) as f32 / (1 << 24) as f32 - 0.5
        };
        let positions: Vec<Vec3> = (0..500)
            .map(|_| Vec3::new(random(), 2.0 * random(), random()))
            .collect();
        let normals: Vec<Vec3> = (0..500)
            .map(|_| Vec3::new(random(), random(), random()).normalize_or(Vec3::X))
            .collect();
        let grid = OrientedGrid::new(&positions, &normals, 0..500, 0.06);
        let config = MatchConfig { reach_m: 0.2, direction_m: 0.1, oblique: 0.0 };
        for _ in 0..300 {
            let place = Vec3::new(random(), 2.0 * random(), random()) * 1.2;
            let normal = Vec3::new(random(), random(), random()).normalize_or(Vec3::Y);
            let exact = (0..500_u32)
                .map(|i| {
                    let facing = normals[i as usize].dot(normal);
                    let near = positions[i as usize].distance_squared(place);
                    let measure = near + 0.01 * 2.0 * (1.0 - facing);
                    (i, if facing > 0.0 { measure } else { f32::MAX })
                })
                .min_by(|a, b| a.1.total_cmp(&b.1))
                .filter(|(_, measure)| *measure < 0.04);
            let found = grid.nearest(place, normal, None, config);
            assert_eq!(found.map(|f| f.0), exact.map(|e| e.0), "at {place}");
            let facing = normals[7].dot(normal);
            let guess = (facing > 0.0).then(|| (7, config.measure(positions[7] - place, facing)));
            let guessed = grid.nearest(place, normal, guess, config);
            assert_eq!(guessed.map(|f| f.0), exact.map(|e| e.0), "at {place}");
        }
    }
}
