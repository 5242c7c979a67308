//! `J^T W J` and `J^T W r`, summed row by row in the order the rows come.

use faer::{Mat, Side, linalg::solvers::Solve as _};

use crate::{
    residual::{BLOCKS, Row, RowSink},
    state::ALL_UNKNOWNS,
};

/// The Gauss-Newton system of some terms at one state.
#[derive(Clone, Debug)]
pub(crate) struct NormalEquations {
    pub(crate) unknowns: usize,
    /// Lower triangle, row-major; [`unknowns`, `unknowns`].
    pub(crate) hessian: Vec<f64>,
    pub(crate) gradient: Vec<f64>,
    pub(crate) cost: f64,
}

/// A system with its first unknowns solved for: what is left for the others, and how to get the first back.
#[derive(Clone, Debug)]
pub(crate) struct Eliminated {
    pub(crate) rest: NormalEquations,
    /// `H_first^-1 g_first`; [first].
    offset: Vec<f64>,
    /// `H_first^-1 H_first,rest`; [first][rest].
    coupling: Vec<Vec<f64>>,
}

impl NormalEquations {
    pub(crate) fn new(unknowns: usize) -> Self {
        Self {
            unknowns,
            hessian: vec![0.0; unknowns * unknowns],
            gradient: vec![0.0; unknowns],
            cost: 0.0,
        }
    }

    /// Solves `(H + relative diag(H) + absolute) x = -g`; `None` if that is not positive definite.
    pub(crate) fn solve(&self, relative: f64, absolute: f64) -> Option<Vec<f64>> {
        let n = self.unknowns;
        let factor = self.damped(n, relative, absolute).llt(Side::Lower).ok()?;
        let solution = factor.solve(&Mat::from_fn(n, 1, |i, _| -self.gradient[i]));
        let step: Vec<f64> = (0..n).map(|i| solution[(i, 0)]).collect();
        step.iter().all(|x| x.is_finite()).then_some(step)
    }

    /// The diagonal of the inverse: how uncertain each unknown is once the others are free; `None` if that is
    /// not positive definite.
    pub(crate) fn variances(&self) -> Option<Vec<f64>> {
        let n = self.unknowns;
        let factor = self.damped(n, 0.0, 0.0).llt(Side::Lower).ok()?;
        let inverse = factor.solve(&Mat::<f64>::identity(n, n));
        let variances: Vec<f64> = (0..n).map(|i| inverse[(i, i)]).collect();
        variances.iter().all(|v| v.is_finite()).then_some(variances)
    }

    /// The Schur complement of the first unknowns, which are damped.
    pub(crate) fn eliminate(
        &self,
        first: usize,
        relative: f64,
        absolute: f64,
    ) -> Option<Eliminated> {
        let rest = self.unknowns - first;
        let factor = self
            .damped(first, relative, absolute)
            .llt(Side::Lower)
            .ok()?;
        let right = Mat::from_fn(first, rest + 1, |i, j| {
            if j < rest {
                self.entry(first + j, i)
            } else {
                self.gradient[i]
            }
        });
        let solved = factor.solve(&right);
        let mut left = Self::new(rest);
        for a in 0..rest {
            let against = |column: usize| -> f64 {
                (0..first)
                    .map(|i| self.entry(first + a, i) * solved[(i, column)])
                    .sum()
            };
            for b in 0..=a {
                left.hessian[a * rest + b] = self.entry(first + a, first + b) - against(b);
            }
            left.gradient[a] = self.gradient[first + a] - against(rest);
        }
        left.cost = self.cost;
        Some(Eliminated {
            rest: left,
            offset: (0..first).map(|i| solved[(i, rest)]).collect(),
            coupling: (0..first)
                .map(|i| (0..rest).map(|j| solved[(i, j)]).collect())
                .collect(),
        })
    }

    /// Adds another system over the same unknowns.
    pub(crate) fn add(&mut self, other: &Self) {
        for (sum, x) in self.hessian.iter_mut().zip(&other.hessian) {
            *sum += x;
        }
        for (sum, x) in self.gradient.iter_mut().zip(&other.gradient) {
            *sum += x;
        }
        self.cost += other.cost;
    }

    /// The system of the unknowns from `first` on, the others held.
    pub(crate) fn tail(&self, first: usize) -> Self {
        let mut tail = Self::new(self.unknowns - first);
        for i in 0..tail.unknowns {
            for j in 0..=i {
                tail.hessian[i * tail.unknowns + j] = self.entry(first + i, first + j);
            }
            tail.gradient[i] = self.gradient[first + i];
        }
        tail.cost = self.cost;
        tail
    }

    fn entry(&self, row: usize, column: usize) -> f64 {
        let (row, column) = (row.max(column), row.min(column));
        self.hessian[row * self.unknowns + column]
    }

    fn damped(&self, n: usize, relative: f64, absolute: f64) -> Mat<f64> {
        Mat::from_fn(n, n, |i, j| {
            let entry = self.entry(i, j);
            if i == j {
                entry * (1.0 + relative) + absolute
            } else {
                entry
            }
        })
    }
}

impl Eliminated {
    /// The step of the first unknowns that belongs to a step of the rest.
    pub(crate) fn first_step(&self, rest_step: &[f64]) -> Vec<f64> {
        self.offset
            .iter()
            .zip(&self.coupling)
            .map(|(offset, coupling)| {
                let coupled: f64 = coupling.iter().zip(rest_step).map(|(c, x)| c * x).sum();
                -offset - coupled
            })
            .collect()
    }
}

impl RowSink for NormalEquations {
    fn wants_derivatives(&self) -> bool {
        true
    }

    fn take(&mut self, row: &Row) {
        if row.has_betas() {
            self.take_entries(row);
        } else {
            self.take_blocks(row);
        }
        self.cost += f64::from(row.cost);
    }
}

impl NormalEquations {
    /// Any row, entry by entry.
    fn take_entries(&mut self, row: &Row) {
        let (mut indices, mut values) = ([0; ALL_UNKNOWNS], [0.0; ALL_UNKNOWNS]);
        let mut count = row.sparse(&mut indices, &mut values);
        while count > 0 && indices[count - 1] >= self.unknowns {
            count -= 1;
        }
        let weight = f64::from(row.weight);
        let residual = f64::from(row.residual);
        for a in 0..count {
            let weighted = values[a] * weight;
            self.gradient[indices[a]] += weighted * residual;
            let line = &mut self.hessian[indices[a] * self.unknowns..][..self.unknowns];
            for b in 0..=a {
                line[indices[b]] += weighted * values[b];
            }
        }
    }

    /// A row without betas, three unknowns at a time: the same sums, faster. Diagonal blocks fill both triangles.
    fn take_blocks(&mut self, row: &Row) {
        let (mut starts, mut values) = ([0; BLOCKS], [[0.0; 3]; BLOCKS]);
        let count = row.blocks(&mut starts, &mut values);
        let weight = f64::from(row.weight);
        let residual = f64::from(row.residual);
        for a in 0..count {
            let weighted = values[a].map(|value| value * weight);
            for (axis, weighted) in weighted.into_iter().enumerate() {
                let index = starts[a] + axis;
                self.gradient[index] += weighted * residual;
                let line = &mut self.hessian[index * self.unknowns..][..self.unknowns];
                for (start, [x, y, z]) in starts.iter().zip(&values).take(a + 1) {
                    let three = &mut line[*start..*start + 3];
                    three[0] += weighted * x;
                    three[1] += weighted * y;
                    three[2] += weighted * z;
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;

    /// A well-posed system of 6 unknowns from pseudo-random rows.
    fn system() -> NormalEquations {
        let mut system = NormalEquations::new(6);
        for k in 0..20 {
            let x = |i: i32| ((k * k * 7 + i * (i + k) * 3) as f32 * 0.61).sin();
            let mut row = Row::new(x(9), 0.5 + x(8).abs());
            row.add(0, Vec3::new(x(0), x(1), x(2)));
            row.add(3, Vec3::new(x(3), x(4), x(5)));
            system.take(&row);
        }
        system
    }

    #[test]
    fn the_solution_makes_the_gradient_vanish() {
        let system = system();
        let step = system.solve(0.0, 0.0).unwrap();
        for i in 0..6 {
            let left: f64 = (0..6).map(|j| system.entry(i, j) * step[j]).sum();
            assert!((left + system.gradient[i]).abs() < 1e-9);
        }
    }

    #[test]
    fn eliminating_the_first_unknowns_does_not_change_the_solution() {
        let system = system();
        let whole = system.solve(0.0, 0.0).unwrap();
        let eliminated = system.eliminate(4, 0.0, 0.0).unwrap();
        let rest = eliminated.rest.solve(0.0, 0.0).unwrap();
        let first = eliminated.first_step(&rest);
        for (a, b) in whole.iter().zip(first.iter().chain(&rest)) {
            assert!((a - b).abs() < 1e-9, "{a} {b}");
        }
    }

    #[test]
    fn variances_are_the_inverse_squared_sigmas_of_independent_unknowns() {
        let mut system = NormalEquations::new(3);
        for (axis, weight) in [4.0, 0.25, 1.0].into_iter().enumerate() {
            let mut row = Row::new(0.0, weight);
            row.add(0, Vec3::AXES[axis]);
            system.take(&row);
        }
        let variances = system.variances().unwrap();
        for (found, expected) in variances.into_iter().zip([0.25, 4.0, 1.0]) {
            assert!((found - expected).abs() < 1e-12);
        }
    }

    #[test]
    fn a_system_without_rows_has_no_solution_rather_than_a_wrong_one() {
        assert!(NormalEquations::new(6).solve(0.1, 0.0).is_none());
    }
}
