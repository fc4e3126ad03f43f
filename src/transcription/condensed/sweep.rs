//! The elimination of one run's states: forward for sensitivities, offsets and steps, backward for
//! multipliers.

use super::Stencils;
use super::dense::axpy;
use super::lanes::{LANES, vectorised};
use super::run::{Place, RunSweep};
use super::sparse_lu::Factors;
use super::stencil::{Group, Order, Stencil};
use crate::transcription::constraints::ParameterConstraints;
use crate::transcription::grid::{Grid, PointState};
use pilotage_models::Dynamics;
use std::sync::Arc;

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
            36 => {
                const $w: usize = 36;
                $code
            }
            width => unreachable!("rows of {width}: at most 16 states and 16 parameters"),
        }
    };
}
pub(super) use with_width;

/// A group of elements of one kind that follow each other: their matrices stand side by side.
#[derive(Debug, Clone, Copy)]
pub struct Span {
    kind: usize,
    /// First element.
    first: usize,
    /// Number of elements; the lanes beyond repeat the last one.
    count: usize,
    /// First entries of its factors and of its `K_0`.
    lu: usize,
    k0: usize,
}

impl RunSweep {
    /// Factors every element's matrix and sweeps forward for the sensitivities `S` and the offsets `e`
    /// that remove the run's constraint values `c`. False when an element is singular or something is not
    /// finite.
    pub fn eliminate<D: Dynamics, C: ParameterConstraints>(
        &mut self,
        at: Place<'_, D, C>,
        stencils: &Stencils,
        c: &[f64],
    ) -> bool {
        let grid = &at.problem.grids[at.j];
        self.divide(grid, stencils, at.j);
        self.special.clear();
        let shared = &at.problem.model.shared;
        let mut swept = true;
        let mut flat = std::mem::take(&mut self.nodes.s);
        vectorised(|| {
            with_width!(self.w, W => {
                swept = self.forward::<W>(grid, stencils, (shared, c), &mut flat);
            });
        });
        let (r, w) = (self.r(), self.w);
        let offsets = self.nodes.e.iter_mut().zip(flat.chunks_exact(w));
        offsets.for_each(|(e, row)| *e = row[r]);
        self.nodes.s = flat;
        if grid.combinations > 0 {
            let (nodes, mut combined) = (&self.nodes.s, std::mem::take(&mut self.combined.s));
            self.combine(at, nodes, &mut combined, w, Of::Sensitivities);
            self.combined.s = combined;
            let offsets = (self.combined.e.iter_mut()).zip(self.combined.s.chunks_exact(w));
            offsets.for_each(|(e, row)| *e = row[r]);
        }
        // Zero times infinity or NaN is NaN.
        let mut sums = [0.0; LANES];
        for own in self.nodes.s.chunks_exact(LANES) {
            sums.iter_mut().zip(own).for_each(|(sum, v)| *sum += 0.0 * v);
        }
        swept && sums.iter().all(|sum| *sum == 0.0)
    }

    /// Divides the elements into groups where that was not done for these orders.
    fn divide(&mut self, grid: &Grid, stencils: &Stencils, j: usize) {
        let (mut spans, mut lu, mut k0) = (Vec::with_capacity(self.spans.len()), 0, 0);
        let kinds = &stencils.kind[j];
        let mut first = 0;
        while first < grid.elements.len() {
            let kind = kinds[first];
            let same = kinds[first..].iter().take(LANES);
            let count = same.take_while(|k| **k == kind).count();
            let kind = kind as usize;
            spans.push(Span {
                kind,
                first,
                count,
                lu,
                k0,
            });
            let (stencil, order) = &stencils.kinds[kind];
            lu += order.symbolic.entries();
            k0 += stencil.start.len();
            first += count;
        }
        self.spans = spans;
        self.lu.resize(lu, [0.0; LANES]);
        self.k0.resize(k0, [0.0; LANES]);
    }

    #[inline(always)]
    fn forward<const W: usize>(
        &mut self,
        grid: &Grid,
        stencils: &Stencils,
        (shared, c): (&[bool], &[f64]),
        flat: &mut [f64],
    ) -> bool {
        let (n, p, r) = (self.n, self.p, self.r());
        let (known, c) = c.split_at(n - self.free.len());
        let (s, _) = flat.as_chunks_mut::<W>();
        s[..n].fill([0.0; W]);
        for (l, &i) in self.free.iter().enumerate() {
            s[i][p + l] = 1.0;
        }
        let places = (0..n).filter(|i| !self.free.contains(i));
        places.zip(known).for_each(|(i, value)| s[i][r] = -value);
        let mut work = std::mem::take(&mut self.work);
        let (mut lu, mut k0) = (std::mem::take(&mut self.lu), std::mem::take(&mut self.k0));
        let (right, _) = work.right.as_chunks_mut::<W>();
        let mut regular = true;
        'spans: for span in &self.spans {
            let (stencil, order) = &stencils.kinds[span.kind];
            let size = stencil.size();
            let (lu, k0) = (span.lu(&mut lu, order), span.k0(&mut k0, stencil));
            let group = span.group(grid, stencil, &self.jacobian, &mut work.points);
            work.parameters.resize(stencil.parameters.len(), [0.0; LANES]);
            let b = &mut work.parameters;
            stencil.fill(order, &group, (lu, k0, b));
            let lanes = order.symbolic.factor(lu, &mut work.lanes[..size]);
            for (lane, is_regular) in lanes.iter().enumerate().take(span.count) {
                if *is_regular {
                    continue;
                }
                let Some((symbolic, own)) = stencil.factor_alone(&group, lane, shared) else {
                    regular = false;
                    break 'spans;
                };
                let own = (Arc::new(symbolic), own);
                self.special.insert(span.first + lane, own);
            }
            for lane in 0..span.count {
                let first = grid.elements[span.first + lane].first * n;
                let (done, rest) = s.split_at_mut(first + n);
                let right = &mut right[..size];
                stencil.start((k0, lane), &done[first..], right);
                stencil.parameters((b, lane), right);
                let own = right.iter_mut().zip(&c[first..]);
                own.for_each(|(row, c)| row[r] -= c);
                let factors = match self.special.get(&(span.first + lane)) {
                    None => Factors {
                        symbolic: &order.symbolic,
                        lu,
                        lane,
                    },
                    Some((symbolic, lu)) => Factors {
                        symbolic,
                        lu,
                        lane: 0,
                    },
                };
                factors.solve(right, &mut rest[..size]);
            }
        }
        (self.work, self.lu, self.k0) = (work, lu, k0);
        regular
    }

    /// Forward sweep for the offsets `e` that remove the constraint values `c` (of the run).
    pub fn sweep_offsets<D: Dynamics, C: ParameterConstraints>(
        &mut self,
        at: Place<'_, D, C>,
        stencils: &Stencils,
        c: &[f64],
    ) {
        vectorised(|| self.offsets(at, stencils, c));
        if at.problem.grids[at.j].combinations > 0 {
            let (nodes, mut combined) = (&self.nodes.e, std::mem::take(&mut self.combined.e));
            self.combine(at, nodes, &mut combined, 1, Of::Offsets);
            self.combined.e = combined;
        }
        self.offset_bounded(at);
    }

    #[inline(always)]
    fn offsets<D: Dynamics, C: ParameterConstraints>(
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
        for (span, lane) in self.lanes() {
            let (stencil, order) = &stencils.kinds[span.kind];
            let first = grid.elements[span.first + lane].first * n;
            let (done, rest) = e.split_at_mut(first + n);
            let right = &mut right[..stencil.size()];
            let k0 = &self.k0[span.k0..span.k0 + stencil.start.len()];
            stencil.start((k0, lane), &done[first..], right);
            let own = right.iter_mut().zip(&c[first..]);
            own.for_each(|([right], c)| *right -= c);
            let factors = self.factors(span, lane, order);
            factors.solve(right, &mut rest[..stencil.size()]);
        }
        self.work.right = work;
        self.nodes.e = flat;
    }

    /// Backward over the elements: the multipliers of the run's equalities from the derivatives `right`
    /// of the rest of the Lagrangian's model by the unknowns.
    #[inline(always)]
    pub(super) fn eliminate_backward<D: Dynamics, C: ParameterConstraints>(
        &mut self,
        at: Place<'_, D, C>,
        stencils: &Stencils,
        lambda: &mut [f64],
    ) {
        let n = self.n;
        let grid = &at.problem.grids[at.j];
        let (known, lambda) = lambda.split_at_mut(n - self.free.len());
        let mut right = std::mem::take(&mut self.right);
        let mut pivots = std::mem::take(&mut self.work.pivots);
        for (span, lane) in self.lanes().rev() {
            let (stencil, order) = &stencils.kinds[span.kind];
            let first = grid.elements[span.first + lane].first * n;
            let rows = &mut lambda[first..first + stencil.size()];
            let (head, tail) = right.split_at_mut(first + n);
            rows.iter_mut().zip(tail).for_each(|(row, v)| *row = -*v);
            let factors = self.factors(span, lane, order);
            factors.solve_transposed(rows, &mut pivots);
            let k0 = &self.k0[span.k0..span.k0 + stencil.start.len()];
            stencil.start_transposed((k0, lane), rows, &mut head[first..]);
        }
        self.work.pivots = pivots;
        let places = (0..n).filter(|i| !self.free.contains(i));
        places.zip(known).for_each(|(i, out)| *out = -right[i]);
        self.right = right;
    }

    /// All elements in time order: group and lane.
    #[inline(always)]
    fn lanes(&self) -> impl DoubleEndedIterator<Item = (&Span, usize)> {
        let spans = self.spans.iter();
        spans.flat_map(|span| (0..span.count).map(move |lane| (span, lane)))
    }

    /// The factors of an element.
    #[inline(always)]
    fn factors<'a>(&'a self, span: &Span, lane: usize, order: &'a Order) -> Factors<'a> {
        if !self.special.is_empty()
            && let Some((symbolic, lu)) = self.special.get(&(span.first + lane))
        {
            return Factors {
                symbolic,
                lu,
                lane: 0,
            };
        }
        Factors {
            symbolic: &order.symbolic,
            lu: &self.lu[span.lu..span.lu + order.symbolic.entries()],
            lane,
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

impl Span {
    fn lu<'a>(&self, all: &'a mut [[f64; LANES]], order: &Order) -> &'a mut [[f64; LANES]] {
        &mut all[self.lu..self.lu + order.symbolic.entries()]
    }

    fn k0<'a>(&self, all: &'a mut [[f64; LANES]], stencil: &Stencil) -> &'a mut [[f64; LANES]] {
        &mut all[self.k0..self.k0 + stencil.start.len()]
    }

    /// The elements with their Jacobians; `points` is scratch.
    fn group<'a>(
        &self,
        grid: &Grid,
        stencil: &Stencil,
        jacobians: &'a [f64],
        points: &'a mut Vec<[usize; LANES]>,
    ) -> Group<'a> {
        let last = self.first + self.count - 1;
        let elements =
            std::array::from_fn(|lane| &grid.elements[last.min(self.first + lane)]);
        Group::new(grid, elements, stencil, jacobians, points)
    }
}

impl Stencils {
    /// A group of one element of run `j`.
    pub(super) fn alone<'a>(
        &self,
        grid: &Grid,
        (j, element): (usize, usize),
        jacobians: &'a [f64],
        points: &'a mut Vec<[usize; LANES]>,
    ) -> Group<'a> {
        let (stencil, _) = &self.kinds[self.kind[j][element] as usize];
        let elements = [&grid.elements[element]; LANES];
        Group::new(grid, elements, stencil, jacobians, points)
    }
}
