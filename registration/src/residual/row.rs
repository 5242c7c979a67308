//! One residual with its sparse derivative.

use glam::Vec3;

use crate::state::{ALL_UNKNOWNS, BETA_COUNT, FIRST_BETA};

/// Threes of unknowns: `trans` and each joint.
pub(crate) const BLOCKS: usize = FIRST_BETA / 3;

/// A residual, its weight, and its derivative by `trans`, the joints that move it, and maybe the betas.
#[derive(Clone, Debug)]
pub(crate) struct Row {
    pub(crate) residual: f32,
    /// Of the squared residual, robust weight included.
    pub(crate) weight: f32,
    /// What this residual adds to the energy (the robust cost, not `weight * residual^2`).
    pub(crate) cost: f32,
    used: u32,
    blocks: [Vec3; BLOCKS],
    betas: Option<[f32; BETA_COUNT]>,
}

/// Where terms put their rows.
pub(crate) trait RowSink {
    fn wants_derivatives(&self) -> bool;
    fn take(&mut self, row: &Row);
}

/// A sink that only adds up the energy.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct CostSum(pub(crate) f64);

impl Row {
    /// A row with no derivative yet, and the plain cost.
    pub(crate) fn new(residual: f32, weight: f32) -> Self {
        Self {
            residual,
            weight,
            cost: weight * residual * residual,
            used: 0,
            blocks: [Vec3::ZERO; BLOCKS],
            betas: None,
        }
    }

    /// Starts the next row in the same memory.
    pub(crate) fn restart(&mut self, residual: f32, weight: f32, cost: f32) {
        self.residual = residual;
        self.weight = weight;
        self.cost = cost;
        self.used = 0;
        self.betas = None;
    }

    /// Adds to the derivative by the three unknowns that start at `first`.
    pub(crate) fn add(&mut self, first: usize, derivative: Vec3) {
        let block = first / 3;
        if self.used & (1 << block) == 0 {
            self.used |= 1 << block;
            self.blocks[block] = derivative;
        } else {
            self.blocks[block] += derivative;
        }
    }

    pub(crate) fn add_betas(&mut self, derivative: &[f32; BETA_COUNT]) {
        let betas = self.betas.get_or_insert([0.0; BETA_COUNT]);
        for (sum, d) in betas.iter_mut().zip(derivative) {
            *sum += d;
        }
    }

    pub(crate) fn has_betas(&self) -> bool {
        self.betas.is_some()
    }

    /// Writes where each block that is not zero starts (ascending), and its derivative; returns how many.
    pub(crate) fn blocks(
        &self,
        starts: &mut [usize; BLOCKS],
        values: &mut [[f64; 3]; BLOCKS],
    ) -> usize {
        let mut count = 0;
        let mut used = self.used;
        while used != 0 {
            let block = used.trailing_zeros() as usize;
            used &= used - 1;
            starts[count] = 3 * block;
            values[count] = self.blocks[block].as_dvec3().to_array();
            count += 1;
        }
        count
    }

    /// Writes indices (ascending) and values of the derivative; returns how many.
    pub(crate) fn sparse(
        &self,
        indices: &mut [usize; ALL_UNKNOWNS],
        values: &mut [f64; ALL_UNKNOWNS],
    ) -> usize {
        let mut count = 0;
        let mut used = self.used;
        while used != 0 {
            let block = used.trailing_zeros() as usize;
            used &= used - 1;
            for (axis, value) in self.blocks[block].to_array().into_iter().enumerate() {
                indices[count] = 3 * block + axis;
                values[count] = f64::from(value);
                count += 1;
            }
        }
        for (k, &value) in self.betas.iter().flatten().enumerate() {
            indices[count] = FIRST_BETA + k;
            values[count] = f64::from(value);
            count += 1;
        }
        count
    }
}

impl RowSink for CostSum {
    fn wants_derivatives(&self) -> bool {
        false
    }

    fn take(&mut self, row: &Row) {
        self.0 += f64::from(row.cost);
    }
}
