//! The elimination of one run's states: forward for sensitivities, offsets and steps, backward for
//! multipliers.

use super::Stencils;
use super::dense::axpy;
use super::run::{Place, RunSweep};
use super::sparse_lu::Factors;
use super::stencil::{Group, Order, Stencil};
use crate::transcription::constraints::ParameterConstraints;
use crate::transcription::grid::{Grid, PointState};
use crate::transcription::lanes::{Grouped, Kernel, LANES, run};
use pilotage_models::Dynamics;
use std::ops::Range;

/// A group of elements of one kind that follow each other: their matrices stand side by side.
#[derive(Debug, Clone, Copy)]
pub struct Span {
    pub kind: usize,
    /// First element.
    pub first: usize,
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
        let mut flat = std::mem::take(&mut self.nodes.s);
        let (r, w) = (self.r(), self.w);
        let kernel = Forward {
            own: self,
            grid,
            stencils,
            shared,
            c,
            flat: &mut flat,
        };
        let swept = run(w, kernel);
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
        let (growth, is_finite) = run(
            w,
            Extent {
                s: &self.nodes.s,
                r,
            },
        );
        self.growth = growth;
        swept && is_finite
    }

    /// Divides the elements into groups at the first use: the orders of their kinds never change.
    fn divide(&mut self, grid: &Grid, stencils: &Stencils, j: usize) {
        if !self.spans.is_empty() {
            return;
        }
        let (mut spans, mut lu, mut k0) = (Vec::new(), 0, 0);
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

    /// What else has offsets, once the unknowns have them.
    pub fn complete_offsets<D: Dynamics, C: ParameterConstraints>(&mut self, at: Place<'_, D, C>) {
        if at.problem.grids[at.j].combinations > 0 {
            let (nodes, mut combined) = (&self.nodes.e, std::mem::take(&mut self.combined.e));
            self.combine(at, nodes, &mut combined, 1, Of::Offsets);
            self.combined.e = combined;
        }
        self.offset_bounded(at);
    }

    /// All elements in time order: group and lane.
    #[inline(always)]
    pub(super) fn elements(&self) -> impl DoubleEndedIterator<Item = (&Span, usize)> {
        let spans = self.spans.iter();
        spans.flat_map(|span| (0..span.count).map(move |lane| (span, lane)))
    }

    /// The states whose initial values are known.
    #[inline(always)]
    pub(super) fn known(&self) -> impl Iterator<Item = usize> {
        (0..self.n).filter(|i| !self.free.contains(i))
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
                for (value, &(i, column)) in self.jacobian.of(l).zip(entries) {
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

/// The forward sweep of a run.
struct Forward<'a> {
    own: &'a mut RunSweep,
    grid: &'a Grid,
    stencils: &'a Stencils,
    shared: &'a [bool],
    c: &'a [f64],
    /// Rows `S`.
    flat: &'a mut [f64],
}

impl Kernel for Forward<'_> {
    /// False when an element is singular.
    type Output = bool;

    #[inline(always)]
    fn run<const W: usize>(self) -> bool {
        let Self {
            own,
            grid,
            stencils,
            shared,
            c,
            flat,
        } = self;
        let (n, p, r) = (own.n, own.p, own.r());
        let (known, c) = c.split_at(n - own.free.len());
        let (s, _) = flat.as_chunks_mut::<W>();
        s[..n].fill([0.0; W]);
        for (l, &i) in own.free.iter().enumerate() {
            s[i][p + l] = 1.0;
        }
        let places = own.known();
        places.zip(known).for_each(|(i, value)| s[i][r] = -value);
        let mut work = std::mem::take(&mut own.work);
        let (mut lu, mut k0) = (std::mem::take(&mut own.lu), std::mem::take(&mut own.k0));
        let mut regular = true;
        'spans: for span in &own.spans {
            let (stencil, order) = &stencils.kinds[span.kind];
            let size = stencil.size();
            let (lu, k0) = (&mut lu[span.lu(order)], &mut k0[span.k0(stencil)]);
            let group = span.group(grid, &own.jacobian, &mut work.points);
            work.parameters
                .resize(stencil.parameters.len(), [0.0; LANES]);
            let b = &mut work.parameters;
            stencil.fill(order, &group, (lu, k0, b));
            let lanes = order.symbolic.factor(lu, &mut work.lanes[..size]);
            for (lane, is_regular) in lanes.iter().enumerate().take(span.count) {
                if *is_regular {
                    continue;
                }
                let Some((symbolic, alone)) = stencil.factor_alone(&group, lane, shared) else {
                    regular = false;
                    break 'spans;
                };
                own.special.insert(span.first + lane, (symbolic, alone));
            }
            for lane in 0..span.count {
                let first = grid.elements[span.first + lane].first * n;
                let (done, rest) = s.split_at_mut(first + n);
                let x = &mut rest[..size];
                let factors = match own.special.get(&(span.first + lane)) {
                    None => Factors::new(&order.symbolic, lu, lane),
                    Some((symbolic, lu)) => Factors::new(symbolic, lu, 0),
                };
                let slots = factors.slots();
                x.fill([0.0; W]);
                for (slot, c) in slots.iter().zip(&c[first..]) {
                    x[*slot as usize][r] = -c;
                }
                stencil.start((k0, lane), &done[first..], (slots, x));
                stencil.parameters((b, lane), (slots, x));
                factors.solve(x);
            }
        }
        (own.work, own.lu, own.k0) = (work, lu, k0);
        regular
    }
}

/// The largest magnitude in the first `r` columns of rows, and whether all numbers are finite.
struct Extent<'a> {
    s: &'a [f64],
    r: usize,
}

impl Kernel for Extent<'_> {
    type Output = (f64, bool);

    #[inline(always)]
    fn run<const W: usize>(self) -> (f64, bool) {
        let (rows, _) = self.s.as_chunks::<W>();
        let (mut largest, mut sums) = ([0.0_f64; W], [0.0; W]);
        for row in rows {
            for ((v, largest), sum) in row.iter().zip(&mut largest).zip(&mut sums) {
                *largest = if v.abs() > *largest {
                    v.abs()
                } else {
                    *largest
                };
                // Zero times infinity or NaN is NaN.
                *sum += 0.0 * v;
            }
        }
        let growth = largest[..self.r].iter().copied().fold(0.0, f64::max);
        (growth, sums.iter().all(|sum| *sum == 0.0))
    }
}

impl Span {
    /// Places of its factors.
    pub fn lu(&self, order: &Order) -> Range<usize> {
        self.lu..self.lu + order.symbolic.entries()
    }

    /// Places of its `K_0`.
    pub fn k0(&self, stencil: &Stencil) -> Range<usize> {
        self.k0..self.k0 + stencil.start.len()
    }

    /// The elements with their Jacobians; `points` is scratch.
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

impl Stencils {
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
