//! The elimination of one run's states: forward for sensitivities, offsets and steps, backward for
//! multipliers.

use super::Stencils;
use super::dense::{axpy, dot};
use super::run::{Place, RunSweep};
use super::stencil::{Factorable, Stencil};
use crate::transcription::constraints::ParameterConstraints;
use crate::transcription::grid::{Grid, PointState};
use pilotage_models::Dynamics;

/// Runs code with the constant `W` equal to a width of rows: those are padded to a multiple of four, so
/// that the inner loops have a length that the compiler knows.
macro_rules! with_width {
    ($width:expr, $w:ident => $code:expr) => {
        match $width {
            4 => {
                const $w: usize = 4;
                $code
            }
            8 => {
                const $w: usize = 8;
                $code
            }
            12 => {
                const $w: usize = 12;
                $code
            }
            16 => {
                const $w: usize = 16;
                $code
            }
            20 => {
                const $w: usize = 20;
                $code
            }
            24 => {
                const $w: usize = 24;
                $code
            }
            28 => {
                const $w: usize = 28;
                $code
            }
            32 => {
                const $w: usize = 32;
                $code
            }
            width => unreachable!("rows of {width}: at most 16 states and 16 parameters"),
        }
    };
}
pub(super) use with_width;

impl RunSweep {
    /// Factors every element's matrix. False when one is singular.
    pub fn factor<D: Dynamics, C: ParameterConstraints>(
        &mut self,
        at: Place<'_, D, C>,
        stencils: &Stencils,
    ) -> bool {
        let grid = &at.problem.grids[at.j];
        let entries = stencils.factors_of(at.j).sum();
        if self.lu.len() != entries {
            self.lu = vec![0.0; entries];
        }
        self.special.clear();
        let (mut lu, mut pivots) = (
            std::mem::take(&mut self.lu),
            std::mem::take(&mut self.work.pivots),
        );
        let mut rest = lu.as_mut_slice();
        let mut regular = true;
        for element in 0..grid.elements.len() {
            let (stencil, order) = stencils.of(at.j, element);
            let local = self.local(grid, element, stencil);
            let own;
            (own, rest) = rest.split_at_mut(order.symbolic.entries());
            if stencil.factor(&local, order, own, &mut pivots) {
                continue;
            }
            let Some(order) = stencil.order(&local) else {
                regular = false;
                break;
            };
            let mut own = vec![0.0; order.symbolic.entries()];
            if !stencil.factor(&local, &order, &mut own, &mut pivots) {
                regular = false;
                break;
            }
            self.special.insert(element, (order, own));
        }
        (self.lu, self.work.pivots) = (lu, pivots);
        regular
    }

    /// Forward sweep for the sensitivities `S`. False when they are not finite.
    pub fn sweep_sensitivities<D: Dynamics, C: ParameterConstraints>(
        &mut self,
        at: Place<'_, D, C>,
        stencils: &Stencils,
    ) -> bool {
        let grid = &at.problem.grids[at.j];
        with_width!(self.w, W => self.sensitivities::<W>(grid, stencils, at.j));
        if grid.combinations > 0 {
            let (nodes, mut combined) = (&self.nodes.s, std::mem::take(&mut self.combined.s));
            self.combine(at, nodes, &mut combined, self.w, Of::Sensitivities);
            self.combined.s = combined;
        }
        self.nodes.s.iter().all(|v| v.is_finite())
    }

    fn sensitivities<const W: usize>(&mut self, grid: &Grid, stencils: &Stencils, j: usize) {
        let n = self.n;
        let mut flat = std::mem::take(&mut self.nodes.s);
        let (s, _) = flat.as_chunks_mut::<W>();
        s[..n].fill([0.0; W]);
        for (l, &i) in self.free.iter().enumerate() {
            s[i][self.p + l] = 1.0;
        }
        let mut work = std::mem::take(&mut self.work.right);
        let (right, _) = work.as_chunks_mut::<W>();
        let mut offset = 0;
        for (e, element) in grid.elements.iter().enumerate() {
            let (stencil, order) = stencils.of(j, e);
            let local = self.local(grid, e, stencil);
            let (done, rest) = s.split_at_mut((element.first + 1) * n);
            let right = &mut right[..stencil.size()];
            stencil.start(&local, &done[element.first * n..], right);
            stencil.parameters(&local, right);
            let (order, lu) = self.factors(e, order, &mut offset);
            order.symbolic.solve(lu, right, &mut rest[..stencil.size()]);
        }
        self.work.right = work;
        self.nodes.s = flat;
    }

    /// Forward sweep for the offsets `e` that remove the constraint values `c` (of the run).
    pub fn sweep_offsets<D: Dynamics, C: ParameterConstraints>(
        &mut self,
        at: Place<'_, D, C>,
        stencils: &Stencils,
        c: &[f64],
    ) {
        let n = self.n;
        let grid = &at.problem.grids[at.j];
        let (known, c) = c.split_at(n - self.free.len());
        let mut flat = std::mem::take(&mut self.nodes.e);
        flat[..n].fill(0.0);
        let places = (0..n).filter(|i| !self.free.contains(i));
        places.zip(known).for_each(|(i, value)| flat[i] = -value);
        let (e, _) = flat.as_chunks_mut::<1>();
        let mut work = std::mem::take(&mut self.work.right);
        let (right, _) = work.as_chunks_mut::<1>();
        let mut offset = 0;
        for (k, element) in grid.elements.iter().enumerate() {
            let (stencil, order) = stencils.of(at.j, k);
            let local = self.local(grid, k, stencil);
            let (done, rest) = e.split_at_mut((element.first + 1) * n);
            let right = &mut right[..stencil.size()];
            stencil.start(&local, &done[element.first * n..], right);
            let own = right.iter_mut().zip(&c[element.first * n..]);
            own.for_each(|([right], c)| *right -= c);
            let (order, lu) = self.factors(k, order, &mut offset);
            order.symbolic.solve(lu, right, &mut rest[..stencil.size()]);
        }
        self.work.right = work;
        self.nodes.e = flat;
        if grid.combinations > 0 {
            let (nodes, mut combined) = (&self.nodes.e, std::mem::take(&mut self.combined.e));
            self.combine(at, nodes, &mut combined, 1, Of::Offsets);
            self.combined.e = combined;
        }
    }

    /// All steps from the reduced variables, into the rows' `dx`.
    pub fn expand(&mut self, rho: &[f64]) {
        let mut padded = rho.to_vec();
        padded.resize(self.w, 0.0);
        with_width!(self.w, W => {
            let rho = padded.first_chunk::<W>().expect("as wide");
            for rows in [&mut self.nodes, &mut self.combined] {
                let (s, _) = rows.s.as_chunks::<W>();
                for ((dx, s), e) in rows.dx.iter_mut().zip(s).zip(&rows.e) {
                    *dx = e + dot(s, rho);
                }
            }
        });
    }

    /// Backward over the elements: the multipliers of the run's equalities from the derivatives `right`
    /// of the rest of the Lagrangian's model by the unknowns.
    pub(super) fn eliminate_backward<D: Dynamics, C: ParameterConstraints>(
        &mut self,
        at: Place<'_, D, C>,
        stencils: &Stencils,
        right: &mut [f64],
        lambda: &mut [f64],
    ) {
        let n = self.n;
        let grid = &at.problem.grids[at.j];
        let (known, lambda) = lambda.split_at_mut(n - self.free.len());
        let mut pivots = std::mem::take(&mut self.work.pivots);
        let mut end: usize = stencils.factors_of(at.j).sum();
        for (k, element) in grid.elements.iter().enumerate().rev() {
            let (stencil, order) = stencils.of(at.j, k);
            let rows = &mut lambda[element.first * n..][..stencil.size()];
            let (head, tail) = right.split_at_mut((element.first + 1) * n);
            rows.iter_mut().zip(tail).for_each(|(row, v)| *row = -*v);
            end -= order.symbolic.entries();
            let (order, lu) = self.factors(k, order, &mut end.clone());
            order.symbolic.solve_transposed(lu, rows, &mut pivots);
            let local = self.local(grid, k, stencil);
            stencil.start_transposed(&local, rows, &mut head[element.first * n..]);
        }
        self.work.pivots = pivots;
        let places = (0..n).filter(|i| !self.free.contains(i));
        places.zip(known).for_each(|(i, out)| *out = -right[i]);
    }

    /// The factors of an element; `offset` is where they begin, and where the next's do afterwards.
    fn factors<'a>(
        &'a self,
        element: usize,
        order: &'a Factorable,
        offset: &mut usize,
    ) -> (&'a Factorable, &'a [f64]) {
        let start = *offset;
        *offset += order.symbolic.entries();
        match self.special.get(&element) {
            Some((order, lu)) => (order, lu),
            None => (order, &self.lu[start..*offset]),
        }
    }

    /// Rows of the points that are combinations, from those of the unknowns:
    /// `Σ p rows_k + Σ q (J_l rows_l + ∂f/∂θ)`, the last for sensitivities alone.
    fn combine<D: Dynamics, C: ParameterConstraints>(
        &self,
        at: Place<'_, D, C>,
        nodes: &[f64],
        out: &mut [f64],
        columns: usize,
        of: Of,
    ) {
        let (n, grid) = (self.n, &at.problem.grids[at.j]);
        let (size, entries) = (n * columns, &at.problem.model.entries);
        for point in &grid.points {
            let PointState::Combination(c) = &point.state else {
                continue;
            };
            let (done, rest) = out.split_at_mut(c.index * size);
            let own = &mut rest[..size];
            own.fill(0.0);
            for &(k, p) in &c.p {
                axpy(p, &nodes[k * size..(k + 1) * size], own);
            }
            for &(l, q) in &c.q {
                let from = grid.points[l].state.of(nodes, done, size);
                let jacobian = &self.jacobian[l * entries.len()..(l + 1) * entries.len()];
                for (value, &(i, column)) in jacobian.iter().zip(entries) {
                    match column.checked_sub(n) {
                        None => {
                            let source = &from[column * columns..(column + 1) * columns];
                            axpy(q * value, source, &mut own[i * columns..(i + 1) * columns]);
                        }
                        Some(theta) if of == Of::Sensitivities => {
                            own[i * columns + theta] += q * value
                        }
                        Some(_) => {}
                    }
                }
            }
        }
    }
}

/// What rows stand for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Of {
    Sensitivities,
    Offsets,
}

/// The orders in which the elements of a problem are factored: one for each different tableau.
impl Stencils {
    /// Stencil and order of an element of run `j`.
    pub fn of(&self, j: usize, element: usize) -> (&Stencil, &Factorable) {
        let (stencil, order) = &self.kinds[self.kind[j][element] as usize];
        (stencil, order)
    }

    /// Number of entries of the factors of each element of run `j`.
    pub fn factors_of(&self, j: usize) -> impl Iterator<Item = usize> + '_ {
        let kinds = self.kind[j].iter();
        kinds.map(|kind| self.kinds[*kind as usize].1.symbolic.entries())
    }
}
