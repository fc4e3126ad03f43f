//! Elimination of the states of one run: the matrices of the elements, and computations that follow the sweeps over
//! them ([`super::batch`]).

use super::dense::axpy;
use super::element::{ElementJacobian, Group, Order};
use super::elements::ElementJacobians;
use super::run::{Place, RunSweep};
use crate::grid::{Grid, PointState};
use crate::simd::{self, Grouped, LANES, Task};
use std::ops::Range;

/// A group of consecutive elements of one kind, whose matrices are stored side by side.
#[derive(Debug, Clone, Copy)]
pub struct Span {
    pub kind: usize,
    /// First element.
    pub first: usize,
    /// Number of elements; excess lanes repeat the last one.
    count: usize,
    /// Start of its factors, of its `K_0` and of its `B`.
    lu: usize,
    k0: usize,
    b: usize,
}

impl RunSweep {
    /// Computes and factors the matrices of all elements. False if an element is singular.
    pub fn factor(&mut self, at: Place<'_>, jacobians: &ElementJacobians) -> bool {
        let grid = &at.problem.grids[at.j];
        self.divide(grid, jacobians, at.j);
        self.special.clear();
        simd::vectorised(Factor {
            own: self,
            grid,
            jacobians,
            shared: &at.problem.model.shared,
        })
    }

    /// Sensitivities of the points that are combinations, from those of the unknowns.
    pub fn complete(&mut self, at: Place<'_>) {
        if at.problem.grids[at.j].combinations > 0 {
            let (nodes, mut combined) = (&self.nodes.s, std::mem::take(&mut self.combined.s));
            self.combine(at, nodes, &mut combined);
            self.combined.s = combined;
        }
    }

    /// Divides the elements into groups at the first use; the elimination orders of their kinds never change.
    fn divide(&mut self, grid: &Grid, jacobians: &ElementJacobians, j: usize) {
        if !self.spans.is_empty() {
            return;
        }
        let (mut spans, mut lu, mut k0, mut b) = (Vec::new(), 0, 0, 0);
        let kinds = &jacobians.kind[j];
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
                b,
            });
            let (pattern, order) = &jacobians.kinds[kind];
            lu += order.symbolic.entries();
            k0 += pattern.start.len();
            b += pattern.parameters.len();
            first += count;
        }
        self.spans = spans;
        self.lu.resize(lu, [0.0; LANES]);
        self.k0.resize(k0, [0.0; LANES]);
        self.b.resize(b, [0.0; LANES]);
    }

    /// All elements in time order, as group and lane.
    #[inline(always)]
    pub(super) fn elements(&self) -> impl DoubleEndedIterator<Item = (&Span, usize)> {
        let spans = self.spans.iter();
        spans.flat_map(|span| (0..span.count).map(move |lane| (span, lane)))
    }

    /// The states with known initial values.
    #[inline(always)]
    pub(super) fn known(&self) -> impl Iterator<Item = usize> {
        (0..self.n).filter(|i| !self.free.contains(i))
    }

    /// Rows of the points that are combinations, from those of the unknowns:
    /// `Σ p rows_k + Σ q (J_l rows_l + ∂f/∂θ)`.
    fn combine(&self, at: Place<'_>, nodes: &[f64], out: &mut [f64]) {
        let (n, columns, grid) = (self.n, self.w, &at.problem.grids[at.j]);
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
                for (value, &(i, column)) in self.jacobian.of(l).zip(entries) {
                    match column.checked_sub(n) {
                        None => {
                            let source = &from[column * columns..(column + 1) * columns];
                            axpy(q * value, source, &mut own[i * columns..(i + 1) * columns]);
                        }
                        Some(theta) => own[i * columns + theta] += q * value,
                    }
                }
            }
        }
    }
}

/// The task of [`RunSweep::factor`], in groups.
struct Factor<'a> {
    own: &'a mut RunSweep,
    grid: &'a Grid,
    jacobians: &'a ElementJacobians,
    shared: &'a [bool],
}

impl Task for Factor<'_> {
    type Output = bool;

    #[inline(always)]
    fn run(self) -> bool {
        let Self {
            own,
            grid,
            jacobians,
            shared,
        } = self;
        let mut work = std::mem::take(&mut own.work);
        let mut regular = true;
        'spans: for span in &own.spans {
            let (pattern, order) = &jacobians.kinds[span.kind];
            let lu = &mut own.lu[span.lu(order)];
            let (k0, b) = (&mut own.k0[span.k0(pattern)], &mut own.b[span.b(pattern)]);
            let group = span.group(grid, &own.jacobian, &mut work.points);
            pattern.fill(order, &group, (lu, k0, b));
            let lanes = order.symbolic.factor(lu, &mut work.lanes[..pattern.size()]);
            for (lane, is_regular) in lanes.iter().enumerate().take(span.count) {
                if *is_regular {
                    continue;
                }
                let Some(alone) = pattern.factor_alone(&group, lane, shared) else {
                    regular = false;
                    break 'spans;
                };
                own.special.insert(span.first + lane, alone);
            }
        }
        own.work = work;
        regular
    }
}

impl Span {
    /// Range of its factors.
    #[inline]
    pub fn lu(&self, order: &Order) -> Range<usize> {
        self.lu..self.lu + order.symbolic.entries()
    }

    /// Range of its `K_0`.
    #[inline]
    pub fn k0(&self, pattern: &ElementJacobian) -> Range<usize> {
        self.k0..self.k0 + pattern.start.len()
    }

    /// Range of its `B`.
    #[inline]
    pub fn b(&self, pattern: &ElementJacobian) -> Range<usize> {
        self.b..self.b + pattern.parameters.len()
    }

    /// The elements with their Jacobians; `points` is scratch space.
    fn group<'a>(
        &self,
        grid: &Grid,
        jacobians: &'a Grouped,
        points: &'a mut Vec<[usize; LANES]>,
    ) -> Group<'a> {
        let last = self.first + self.count - 1;
        let elements = std::array::from_fn(|lane| &grid.elements[last.min(self.first + lane)]);
        Group::new(grid, elements, jacobians, points)
    }
}

impl ElementJacobians {
    /// A group of one element.
    pub(super) fn alone<'a>(
        grid: &Grid,
        element: usize,
        jacobians: &'a Grouped,
        points: &'a mut Vec<[usize; LANES]>,
    ) -> Group<'a> {
        let elements = [&grid.elements[element]; LANES];
        Group::new(grid, elements, jacobians, points)
    }
}
