//! Sweeps along several runs at once, one in each SIMD lane: the step from one element to the next depends on the
//! previous one and is too short for vectorisation.

use super::elements::ElementJacobians;
use super::run::RunSweep;
use super::sparse_lu::{Factors, Together};
use super::sweep::Span;
use crate::Collocation;
use crate::simd::{self, Kernel, LANES, Task, side_by_side};
use std::ops::Range;

/// Up to [`LANES`] runs with the same kinds of elements.
#[derive(Debug)]
pub struct Batch<'a> {
    /// The problem.
    pub problem: &'a Collocation,
    /// The element Jacobians.
    pub jacobians: &'a ElementJacobians,
    /// Index of the first run.
    pub first: usize,
    /// The runs.
    pub runs: &'a mut [RunSweep],
}

/// The batches of a problem's runs, each with the items that belong to its runs.
pub fn with_items<'a, T>(
    batches: Vec<Batch<'a>>,
    mut rest: &'a mut [T],
) -> impl Iterator<Item = (Batch<'a>, &'a mut [T])> {
    batches.into_iter().map(move |batch| {
        let (own, tail) = std::mem::take(&mut rest).split_at_mut(batch.runs.len());
        rest = tail;
        (batch, own)
    })
}

impl Batch<'_> {
    /// Forward sweep for the sensitivities `S`, two runs at a time. The last column of `S` holds the offsets that
    /// remove the constraint values `c` (of all runs).
    pub fn sensitivities(&mut self, c: &[f64]) {
        for part in self.parts() {
            for first in part.clone().step_by(2) {
                let own = self.part(first..part.end.min(first + 2));
                let w = own.runs[0].w;
                match own.runs.len() {
                    2 => simd::run(w, Sensitivities::<2> { own, c }),
                    _ => simd::run(w, Sensitivities::<1> { own, c }),
                }
            }
        }
    }

    /// Forward sweep that adds to the step `d` of each run's unknowns the correction that removes the constraint values
    /// `c` (of all runs).
    pub fn correct(&mut self, c: &[f64], d: &mut [&mut [f64]]) {
        for part in self.parts() {
            simd::vectorised(Correct {
                own: self.part(part.clone()),
                c,
                d: &mut d[part],
            });
        }
    }

    /// Backward sweep: the multipliers `lambda` of the equalities of each run, from the derivatives `right` of the
    /// remaining model of the Lagrangian with respect to the unknowns.
    pub fn multipliers(&mut self, lambda: &mut [&mut [f64]]) {
        for part in self.parts() {
            simd::vectorised(Multipliers {
                own: self.part(part.clone()),
                lambda: &mut lambda[part],
            });
        }
    }

    /// Ranges of runs that are processed together; a run with special elimination orders is processed alone.
    fn parts(&self) -> impl Iterator<Item = Range<usize>> + use<> {
        let count = self.runs.len();
        let together = self.runs.iter().all(|run| run.special.is_empty());
        let step = if together { count } else { 1 };
        (0..count).step_by(step).map(move |k| k..k + step)
    }

    fn part(&mut self, part: Range<usize>) -> Batch<'_> {
        Batch {
            problem: self.problem,
            jacobians: self.jacobians,
            first: self.first + part.start,
            runs: &mut self.runs[part],
        }
    }

    /// The run in each lane; excess lanes repeat the last run.
    #[inline(always)]
    fn members(&self) -> [usize; LANES] {
        simd::group(0, LANES, self.runs.len()).0
    }

    /// The constraint values of a run.
    #[inline(always)]
    fn equalities<'c>(&self, k: usize, c: &'c [f64]) -> &'c [f64] {
        &c[self.problem.layout.runs[self.first + k].equalities()]
    }

    /// The factors of an element of each run.
    #[inline(always)]
    fn factors(&self, span: &Span, lane: usize) -> Together<'_> {
        let runs = self.members().map(|k| &self.runs[k]);
        if let Some((symbolic, lu)) = runs[0].special.get(&(span.first + lane)) {
            return Together::new(symbolic, [lu; LANES], 0);
        }
        let (_, order) = &self.jacobians.kinds[span.kind];
        let lu = runs.map(|run| &run.lu[span.lu(order)]);
        Together::new(&order.symbolic, lu, lane)
    }
}

/// The task of [`Batch::sensitivities`] for `B` runs.
struct Sensitivities<'a, const B: usize> {
    own: Batch<'a>,
    c: &'a [f64],
}

impl<const B: usize> Kernel for Sensitivities<'_, B> {
    type Output = ();

    #[inline(always)]
    fn run<const W: usize>(self) {
        let Self { own, c } = self;
        let (n, p, r) = (own.runs[0].n, own.runs[0].p, own.runs[0].r());
        let members: [usize; B] = std::array::from_fn(|k| k);
        // Rows of the element and of the previous one, whose last rows are the start of this element.
        let size = own.runs[0].work.lanes.len().max(n);
        let (mut work, mut before) = (vec![[[0.0; W]; B]; size], vec![[[0.0; W]; B]; size]);
        let at = &mut before[..n];
        let mut rows: Vec<Vec<f64>> = Vec::with_capacity(B);
        for k in members {
            let run = &own.runs[k];
            let free = run.free.iter().enumerate();
            free.for_each(|(l, &i)| at[i][k][p + l] = 1.0);
            let known = run.known().zip(own.equalities(k, c));
            known.for_each(|(i, c)| at[i][k][r] = -c);
            let mut s = std::mem::take(&mut own.runs[k].nodes.s);
            let first = s.as_chunks_mut::<W>().0.iter_mut().zip(&*at);
            first.for_each(|(s, at)| *s = at[k]);
            rows.push(s);
        }
        let defects = members.map(|k| &own.equalities(k, c)[n - own.runs[k].free.len()..]);
        let mut extents = [Extent::<W>::default(); B];
        for (k, extent) in extents.iter_mut().enumerate() {
            at.iter().for_each(|row| extent.take(&row[k]));
        }
        let mut last = n;
        let grid = &own.problem.grids[own.first];
        for (span, lane) in own.runs[0].elements() {
            let (pattern, order) = &own.jacobians.kinds[span.kind];
            let (first, size) = (grid.elements[span.first + lane].first * n, pattern.size());
            let x = &mut work[..size];
            let factors = match own.runs[0].special.get(&(span.first + lane)) {
                Some((symbolic, lu)) => Factors::new(symbolic, [lu.as_slice(); B], 0),
                None => {
                    let lu = members.map(|k| &own.runs[k].lu[span.lu(order)]);
                    Factors::new(&order.symbolic, lu, lane)
                }
            };
            let slots = factors.slots();
            x.fill([[0.0; W]; B]);
            let c = defects.map(|c| &c[first..first + size]);
            for (k, slot) in slots.iter().enumerate() {
                let x = &mut x[*slot as usize];
                x.iter_mut().zip(c).for_each(|(x, c)| x[r] = -c[k]);
            }
            let k0 = members.map(|k| &own.runs[k].k0[span.k0(pattern)]);
            pattern.start((k0, lane), &before[last - n..last], (slots, x));
            let b = members.map(|k| &own.runs[k].b[span.b(pattern)]);
            pattern.parameters((b, lane), (slots, x));
            factors.solve(x);
            for (k, rows) in rows.iter_mut().enumerate() {
                let s = &mut rows.as_chunks_mut::<W>().0[first + n..first + n + size];
                let extent = &mut extents[k];
                for (s, x) in s.iter_mut().zip(&*x) {
                    *s = x[k];
                    extent.take(&x[k]);
                }
            }
            std::mem::swap(&mut work, &mut before);
            last = size;
        }
        let runs = own.runs.iter_mut().zip(rows);
        for ((run, s), extent) in runs.zip(extents) {
            run.nodes.s = s;
            (run.growth, run.is_finite) = extent.of(r);
        }
    }
}

/// The largest magnitude in each column of rows, and whether all numbers are finite.
#[derive(Debug, Clone, Copy)]
struct Extent<const W: usize> {
    largest: [f64; W],
    /// Sum of zeros, or NaN: zero times infinity or NaN is NaN.
    zeros: [f64; W],
}

impl<const W: usize> Default for Extent<W> {
    fn default() -> Self {
        Self {
            largest: [0.0; W],
            zeros: [0.0; W],
        }
    }
}

impl<const W: usize> Extent<W> {
    #[inline(always)]
    fn take(&mut self, row: &[f64; W]) {
        let own = self.largest.iter_mut().zip(&mut self.zeros);
        for (v, (largest, zero)) in row.iter().zip(own) {
            *largest = if v.abs() > *largest {
                v.abs()
            } else {
                *largest
            };
            *zero = 0.0f64.mul_add(*v, *zero);
        }
    }

    /// The largest magnitude in the first `r` columns, and whether all values are finite.
    fn of(&self, r: usize) -> (f64, bool) {
        let growth = self.largest[..r].iter().copied().fold(0.0, f64::max);
        (growth, self.zeros.iter().all(|zero| *zero == 0.0))
    }
}

/// The task of [`Batch::correct`].
struct Correct<'a, 'b> {
    own: Batch<'a>,
    c: &'a [f64],
    d: &'a mut [&'b mut [f64]],
}

impl Task for Correct<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self { own, c, d } = self;
        let (n, members) = (own.runs[0].n, own.members());
        let mut at = vec![[0.0; LANES]; n];
        for (k, d) in d.iter_mut().enumerate() {
            let known = own.runs[k].known().zip(own.equalities(k, c));
            known.for_each(|(i, c)| at[i][k] = -c);
            d[..n].iter_mut().zip(&at).for_each(|(d, at)| *d += at[k]);
        }
        let defects = members.map(|k| &own.equalities(k, c)[n - own.runs[k].free.len()..]);
        let mut work = vec![[0.0; LANES]; own.runs[0].work.lanes.len()];
        let grid = &own.problem.grids[own.first];
        for (span, lane) in own.runs[0].elements() {
            let (pattern, _) = &own.jacobians.kinds[span.kind];
            let (first, size) = (grid.elements[span.first + lane].first * n, pattern.size());
            let x = &mut work[..size];
            let factors = own.factors(span, lane);
            let c = defects.map(|c| &c[first..first + size]);
            for (k, slot) in factors.slots().iter().enumerate() {
                x[*slot as usize] = c.map(|c| -c[k]);
            }
            let k0 = members.map(|k| &own.runs[k].k0[span.k0(pattern)]);
            pattern.start_together((k0, lane), &at, (factors.slots(), x));
            factors.solve(x);
            for (k, d) in d.iter_mut().enumerate() {
                let d = &mut d[first + n..first + n + size];
                d.iter_mut().zip(&*x).for_each(|(d, x)| *d += x[k]);
            }
            at[..n].copy_from_slice(&x[size - n..]);
        }
    }
}

/// The task of [`Batch::multipliers`].
struct Multipliers<'a, 'b> {
    own: Batch<'a>,
    lambda: &'a mut [&'b mut [f64]],
}

impl Task for Multipliers<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self { own, lambda } = self;
        let (n, members) = (own.runs[0].n, own.members());
        let right = members.map(|k| own.runs[k].right.as_slice());
        // Derivatives with respect to the states at the start of the elements processed so far.
        let mut at = vec![[0.0; LANES]; n];
        side_by_side(right.map(|right| &right[right.len() - n..]), &mut at[..n]);
        let size = own.runs[0].work.lanes.len();
        let (mut b, mut rows) = (vec![[0.0; LANES]; size], vec![[0.0; LANES]; size]);
        let known: Vec<usize> = own.runs.iter().map(|run| n - run.free.len()).collect();
        let grid = &own.problem.grids[own.first];
        for (span, lane) in own.runs[0].elements().rev() {
            let (pattern, _) = &own.jacobians.kinds[span.kind];
            let (first, size) = (grid.elements[span.first + lane].first * n, pattern.size());
            let (b, rows) = (&mut b[..size], &mut rows[..size]);
            side_by_side(right.map(|right| &right[first + n..]), &mut b[..size - n]);
            b[size - n..].copy_from_slice(&at[..n]);
            b.as_flattened_mut().iter_mut().for_each(|b| *b = -*b);
            own.factors(span, lane).solve_transposed(b, rows);
            for (k, lambda) in lambda.iter_mut().enumerate() {
                let lambda = &mut lambda[known[k] + first..][..size];
                let pairs = lambda.iter_mut().zip(&*rows);
                pairs.for_each(|(lambda, row)| *lambda = row[k]);
            }
            side_by_side(right.map(|right| &right[first..]), &mut at[..n]);
            let k0 = members.map(|k| &own.runs[k].k0[span.k0(pattern)]);
            pattern.start_transposed((k0, lane), rows, &mut at);
        }
        for ((k, run), lambda) in own.runs.iter().enumerate().zip(lambda) {
            let places = run.known().zip(lambda.iter_mut());
            places.for_each(|(i, lambda)| *lambda = -at[i][k]);
        }
    }
}
