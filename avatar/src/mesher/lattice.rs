//! Field values on a regular lattice, asked for only where they are needed.

use glam::{IVec3, Vec3, ivec3};

use crate::sdf::SignedDistanceField;

/// Coarse cells a side in the first look: 6 cm for an adult, thinner than anything that stands alone.
const COARSE_CELLS: usize = 32;
/// Values asked for at a time, which bounds the memory of a field's intermediate results.
const BATCH: usize = 1 << 16;
/// What marks a value that nobody asked for yet; real zeros are stored as the smallest positive number.
/// Zero, so that memory far from the surface is never touched.
const UNKNOWN: f32 = 0.0;

/// `side^3` points over `[-1, 1]^3`, both ends included; x runs fastest.
pub(super) struct Lattice<'a> {
    sdf: &'a dyn SignedDistanceField,
    side: usize,
    values: Vec<f32>,
    evaluated: usize,
}

impl<'a> Lattice<'a> {
    pub(super) fn new(sdf: &'a dyn SignedDistanceField, side: usize) -> Self {
        Self { sdf, side, values: vec![UNKNOWN; side * side * side], evaluated: 0 }
    }

    /// Cells the surface passes through, in rising order; a cell is named by its lowest point.
    pub(super) fn surface_cells(&mut self) -> Vec<u32> {
        let mut frontier = self.first_cells();
        let mut seen = vec![0_u64; self.values.len().div_ceil(64)];
        let mut found = Vec::new();
        while !frontier.is_empty() {
            frontier.sort_unstable();
            frontier.retain(|&cell| {
                let (word, bit) = (&mut seen[cell as usize / 64], 1 << (cell % 64));
                let new = *word & bit == 0;
                *word |= bit;
                new
            });
            let corners = frontier
                .iter()
                .flat_map(|&cell| self.corners(cell))
                .collect();
            self.evaluate(corners);
            let mut next = Vec::new();
            for &cell in &frontier {
                let inside = self.inside_mask(&self.corners(cell));
                if inside != 0 && inside != 0xff {
                    found.push(cell);
                    self.push_neighbors(cell, inside, &mut next);
                }
            }
            frontier = next;
        }
        found.sort_unstable();
        found
    }

    /// How many values the field was asked for.
    pub(super) fn evaluated(&self) -> usize {
        self.evaluated
    }

    /// The place of a point on the lattice, in cells.
    pub(super) fn coordinates(&self, point: u32) -> IVec3 {
        let (point, side) = (point as i32, self.side as i32);
        ivec3(point % side, point / side % side, point / (side * side))
    }

    pub(super) fn point(&self, coordinates: IVec3) -> u32 {
        let side = self.side as i32;
        ((coordinates.z * side + coordinates.y) * side + coordinates.x) as u32
    }

    pub(super) fn value(&self, point: u32) -> f32 {
        self.values[point as usize]
    }

    fn position(&self, point: u32) -> Vec3 {
        self.coordinates(point).as_vec3() * (2.0 / (self.side - 1) as f32) - 1.0
    }

    /// The eight points of a cell; corner `c` lies at `(c & 1, c >> 1 & 1, c >> 2 & 1)`.
    fn corners(&self, cell: u32) -> [u32; 8] {
        let strides = self.strides();
        std::array::from_fn(|corner| {
            cell + (0..3)
                .map(|axis| strides[axis] * (corner >> axis & 1) as u32)
                .sum::<u32>()
        })
    }

    /// A bit for each corner whose value is negative.
    fn inside_mask(&self, corners: &[u32; 8]) -> u8 {
        corners
            .iter()
            .enumerate()
            .map(|(corner, &point)| u8::from(self.value(point) < 0.0) << corner)
            .sum()
    }

    /// Cells around each sign change on the edges of the coarse lattice.
    fn first_cells(&mut self) -> Vec<u32> {
        let last = self.side - 1;
        let stride = last.div_ceil(COARSE_CELLS);
        let stops: Vec<i32> = (0..last)
            .step_by(stride)
            .chain([last])
            .map(|stop| stop as i32)
            .collect();
        let mut points = Vec::with_capacity(stops.len().pow(3));
        for &z in &stops {
            for &y in &stops {
                points.extend(stops.iter().map(|&x| self.point(ivec3(x, y, z))));
            }
        }
        self.evaluate(points.clone());
        let edges = self.crossed_coarse_edges(&points, stride);
        let strides = self.strides();
        let along = |&(from, axis, length): &(u32, usize, usize)| {
            (0..=length as u32).map(move |step| from + step * strides[axis])
        };
        self.evaluate(edges.iter().flat_map(along).collect());
        let mut cells = Vec::new();
        for (from, axis, length) in edges {
            for step in 0..length as u32 {
                let a = from + step * strides[axis];
                let b = a + strides[axis];
                if (self.value(a) < 0.0) != (self.value(b) < 0.0) {
                    cells.push(self.cell_at(a));
                }
            }
        }
        cells
    }

    /// Coarse edges whose ends differ in sign: first point, axis, length.
    fn crossed_coarse_edges(&self, points: &[u32], stride: usize) -> Vec<(u32, usize, usize)> {
        let mut edges = Vec::new();
        for &from in points {
            let coordinates = self.coordinates(from);
            for axis in 0..3 {
                let length = stride.min(self.side - 1 - coordinates[axis] as usize);
                if length == 0 {
                    continue;
                }
                let to = from + self.strides()[axis] * length as u32;
                if (self.value(from) < 0.0) != (self.value(to) < 0.0) {
                    edges.push((from, axis, length));
                }
            }
        }
        edges
    }

    /// Neighbours across those faces that the surface passes through.
    fn push_neighbors(&self, cell: u32, inside: u8, cells: &mut Vec<u32>) {
        /// Corners on the upper side of each axis.
        const UPPER: [u8; 3] = [0b1010_1010, 0b1100_1100, 0b1111_0000];
        let coordinates = self.coordinates(cell);
        for axis in 0..3 {
            let stride = self.strides()[axis];
            let mixed = |side: u8| inside & side != 0 && inside & side != side;
            if mixed(UPPER[axis]) && coordinates[axis] + 2 < self.side as i32 {
                cells.push(cell + stride);
            }
            if mixed(!UPPER[axis]) && coordinates[axis] > 0 {
                cells.push(cell - stride);
            }
        }
    }

    /// Fills in what is not known yet of these points.
    fn evaluate(&mut self, mut points: Vec<u32>) {
        points.retain(|&point| self.value(point) == UNKNOWN);
        points.sort_unstable();
        points.dedup();
        self.evaluated += points.len();
        let mut values = vec![0.0; points.len().min(BATCH)];
        for batch in points.chunks(BATCH) {
            let positions: Vec<Vec3> = batch.iter().map(|&point| self.position(point)).collect();
            let values = &mut values[..batch.len()];
            self.sdf.values(&positions, values);
            for (&point, &value) in batch.iter().zip(&*values) {
                self.values[point as usize] = self.stored(point, value);
            }
        }
    }

    /// Outside for what is no number, and on the cube's wall, where the surface is closed.
    fn stored(&self, point: u32, value: f32) -> f32 {
        let coordinates = self.coordinates(point);
        let on_wall =
            coordinates.min_element() == 0 || coordinates.max_element() == self.side as i32 - 1;
        if value.is_nan() {
            1.0
        } else if value == 0.0 || on_wall {
            value.max(f32::MIN_POSITIVE)
        } else {
            value
        }
    }

    /// The cell whose lowest point this is, or the last cell that holds it.
    fn cell_at(&self, point: u32) -> u32 {
        self.point(
            self.coordinates(point)
                .min(IVec3::splat(self.side as i32 - 2)),
        )
    }

    fn strides(&self) -> [u32; 3] {
        [1, self.side as u32, (self.side * self.side) as u32]
    }
}
