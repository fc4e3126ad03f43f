//! LU factors of many small sparse matrices with one pattern, four at once: the order of the pivots is
//! chosen once.
//!
//! The order is Markowitz's with threshold pivoting (Duff, Erisman & Reid, *Direct Methods for Sparse
//! Matrices*, 2nd ed. 2017, sections 7.2 and 7.8), on the values of one of them. Each refactorisation
//! checks its pivots; where one has become too small, the caller orders that matrix anew.

use super::lanes::{LANES, Lanes, less, times};
use std::ops::Range;

/// Smallest pivot beside the largest entry of its row when the order is chosen.
const THRESHOLD: f64 = 0.1;
/// Smallest pivot beside the largest entry of its row in a refactorisation.
const SMALLEST: f64 = 1e-6;
/// Rows of lowest count among which the next pivot is sought.
const CANDIDATES: usize = 4;

/// Order of elimination and pattern of the factors of a square matrix.
#[derive(Debug, Clone, Default)]
pub struct Symbolic {
    /// Original row and column of each pivot.
    rows: Vec<usize>,
    columns: Vec<usize>,
    /// Start of each row of the factors, in the pivots' order.
    start: Vec<usize>,
    /// Columns of the factors' entries, in the pivots' order, ascending.
    column: Vec<u32>,
    /// The original columns of the factors' entries.
    source: Vec<u32>,
    /// Place of each diagonal entry.
    diagonal: Vec<usize>,
}

impl Symbolic {
    /// Chooses the order for a matrix given as `(row, column, value)`, each place once. The pattern of
    /// the factors holds every given place, those with the value zero too. None when it is singular.
    pub fn new(size: usize, entries: &[(usize, usize, f64)]) -> Option<Self> {
        let mut active: Vec<Vec<(usize, f64)>> = vec![Vec::new(); size];
        let mut counts = vec![0_usize; size];
        for &(i, j, v) in entries {
            active[i].push((j, v));
            counts[j] += 1;
        }
        active.iter_mut().for_each(|row| row.sort_by_key(|e| e.0));
        // Entries of each original row left of its pivot: the columns it was eliminated with.
        let mut lower: Vec<Vec<usize>> = vec![Vec::new(); size];
        let mut upper: Vec<Vec<usize>> = Vec::with_capacity(size);
        let (mut rows, mut columns) = (Vec::with_capacity(size), Vec::with_capacity(size));
        let mut open: Vec<usize> = (0..size).collect();
        while !open.is_empty() {
            let (i, j) = pivot(&mut open, &active, &counts)?;
            let row = std::mem::take(&mut active[i]);
            row.iter().for_each(|(c, _)| counts[*c] -= 1);
            let value = row.iter().find(|e| e.0 == j)?.1;
            for &k in &open {
                let Ok(at) = active[k].binary_search_by_key(&j, |e| e.0) else {
                    continue;
                };
                let factor = active[k].remove(at).1 / value;
                counts[j] -= 1;
                lower[k].push(rows.len());
                active[k] = combined(&active[k], &row, j, factor, &mut counts);
            }
            upper.push(row.iter().map(|e| e.0).collect());
            rows.push(i);
            columns.push(j);
        }
        Some(Self::assembled(rows, columns, &lower, &upper))
    }

    fn assembled(
        rows: Vec<usize>,
        columns: Vec<usize>,
        lower: &[Vec<usize>],
        upper: &[Vec<usize>],
    ) -> Self {
        let mut place = vec![0; columns.len()];
        columns.iter().enumerate().for_each(|(k, j)| place[*j] = k);
        let mut out = Self {
            start: vec![0],
            ..Self::default()
        };
        for (&i, upper) in rows.iter().zip(upper) {
            let mut pattern = lower[i].clone();
            pattern.extend(upper.iter().map(|j| place[*j]));
            pattern.sort_unstable();
            let k = out.diagonal.len();
            let at = pattern.partition_point(|c| *c < k);
            out.diagonal.push(out.column.len() + at);
            out.source
                .extend(pattern.iter().map(|c| columns[*c] as u32));
            out.column.extend(pattern.into_iter().map(|c| c as u32));
            out.start.push(out.column.len());
        }
        out.rows = rows;
        out.columns = columns;
        out
    }

    /// Number of rows.
    pub fn size(&self) -> usize {
        self.rows.len()
    }

    /// Number of entries of the factors.
    pub fn entries(&self) -> usize {
        self.column.len()
    }

    /// Places in the factors of entries given as `(row, column)`.
    pub fn places(&self, entries: impl Iterator<Item = (usize, usize)>) -> Vec<u32> {
        let inverse = |order: &[usize]| {
            let mut out = vec![0; order.len()];
            order.iter().enumerate().for_each(|(k, i)| out[*i] = k);
            out
        };
        let (row, column) = (inverse(&self.rows), inverse(&self.columns));
        let place = |(i, j): (usize, usize)| {
            let range = self.start[row[i]]..self.start[row[i] + 1];
            let own = &self.column[range.clone()];
            (range.start + own.partition_point(|c| (*c as usize) < column[j])) as u32
        };
        entries.map(place).collect()
    }

    /// Factors four matrices in place; `lu` holds them at their [`places`](Self::places) and zeros
    /// elsewhere, and the inverse pivots on the diagonal afterwards. Returns which of them have no pivot
    /// that is too small; the factors of the others mean nothing. `work` has [`size`](Self::size) entries.
    #[inline(always)]
    pub fn factor(&self, lu: &mut [Lanes], work: &mut [Lanes]) -> [bool; LANES] {
        let mut regular = [true; LANES];
        for k in 0..self.size() {
            let (start, diagonal, end) = (self.start[k], self.diagonal[k], self.start[k + 1]);
            for (column, value) in self.column[start..end].iter().zip(&lu[start..end]) {
                work[*column as usize] = *value;
            }
            for i in &self.column[start..diagonal] {
                let i = *i as usize;
                let factor = times(work[i], lu[self.diagonal[i]]);
                work[i] = factor;
                let row = self.diagonal[i] + 1..self.start[i + 1];
                for (c, u) in self.column[row.clone()].iter().zip(&lu[row]) {
                    let c = *c as usize;
                    work[c] = less(work[c], factor, *u);
                }
            }
            let mut largest = [0.0_f64; LANES];
            for at in start..end {
                let value = work[self.column[at] as usize];
                lu[at] = value;
                if at >= diagonal {
                    for (largest, v) in largest.iter_mut().zip(value) {
                        *largest = largest.max(v.abs());
                    }
                }
            }
            let pivots = &mut lu[diagonal];
            for ((pivot, largest), regular) in pivots.iter_mut().zip(largest).zip(&mut regular) {
                // A NaN fails too.
                *regular &=
                    pivot.abs() >= SMALLEST * largest && *pivot != 0.0 && largest.is_finite();
                *pivot = 1.0 / *pivot;
            }
        }
        regular
    }
}

/// The factors of one of four matrices.
#[derive(Debug, Clone, Copy)]
pub struct Factors<'a> {
    /// Their order and pattern.
    pub symbolic: &'a Symbolic,
    /// The four matrices' factors.
    pub lu: &'a [Lanes],
    /// Which of them.
    pub lane: usize,
}

impl Factors<'_> {
    /// Solves `A X = B` for `W` right-hand sides.
    #[inline(always)]
    pub fn solve<const W: usize>(&self, b: &[[f64; W]], x: &mut [[f64; W]]) {
        let order = self.symbolic;
        // Rows of the solution of L y = b wait in x, in the pivots' order of columns.
        for (k, (&from, &to)) in order.rows.iter().zip(&order.columns).enumerate() {
            let at = order.start[k]..order.diagonal[k];
            x[to] = self.reduced(at, b[from], x);
        }
        for (k, &to) in order.columns.iter().enumerate().rev() {
            let at = order.diagonal[k] + 1..order.start[k + 1];
            let row = self.reduced(at, x[to], x);
            let inverse = self.lu[order.diagonal[k]][self.lane];
            x[to] = row.map(|v| v * inverse);
        }
    }

    /// `row` less the rows of `x` times the factors' entries.
    #[inline(always)]
    fn reduced<const W: usize>(
        &self,
        entries: Range<usize>,
        mut row: [f64; W],
        x: &[[f64; W]],
    ) -> [f64; W] {
        let own = &self.lu[entries.clone()];
        for (source, factor) in self.symbolic.source[entries].iter().zip(own) {
            let (by, factor) = (&x[*source as usize], factor[self.lane]);
            for (v, x) in row.iter_mut().zip(by) {
                *v -= factor * x;
            }
        }
        row
    }

    /// Solves `Aᵀ x = b` for one right-hand side; `work` has [`size`](Symbolic::size) entries.
    #[inline(always)]
    pub fn solve_transposed(&self, b: &mut [f64], work: &mut [f64]) {
        let order = self.symbolic;
        let work = &mut work[..order.size()];
        for (w, j) in work.iter_mut().zip(&order.columns) {
            *w = b[*j];
        }
        for k in 0..order.size() {
            let value = work[k] * self.lu[order.diagonal[k]][self.lane];
            work[k] = value;
            self.take(order.diagonal[k] + 1..order.start[k + 1], value, work);
        }
        for k in (0..order.size()).rev() {
            let value = work[k];
            self.take(order.start[k]..order.diagonal[k], value, work);
        }
        for (w, i) in work.iter().zip(&order.rows) {
            b[*i] = *w;
        }
    }

    /// `work` less `value` times the factors' entries, at their columns.
    #[inline(always)]
    fn take(&self, entries: Range<usize>, value: f64, work: &mut [f64]) {
        let own = &self.lu[entries.clone()];
        for (c, factor) in self.symbolic.column[entries].iter().zip(own) {
            work[*c as usize] -= factor[self.lane] * value;
        }
    }
}

/// The pivot of least Markowitz cost among the rows of lowest count; takes its row out of `open`.
fn pivot(
    open: &mut Vec<usize>,
    active: &[Vec<(usize, f64)>],
    counts: &[usize],
) -> Option<(usize, usize)> {
    let few = CANDIDATES.min(open.len());
    if few < open.len() {
        open.select_nth_unstable_by_key(few - 1, |i| (active[*i].len(), *i));
    }
    let mut best: Option<(usize, f64, usize, usize)> = None;
    for (at, &i) in open[..few].iter().enumerate() {
        let largest = active[i].iter().fold(0.0_f64, |m, e| m.max(e.1.abs()));
        for &(j, v) in &active[i] {
            if v == 0.0 || v.abs() < THRESHOLD * largest {
                continue;
            }
            let cost = (active[i].len() - 1) * (counts[j] - 1);
            let better = |b: &(usize, f64, usize, usize)| (cost, -v.abs()) < (b.0, -b.1);
            if best.as_ref().is_none_or(better) {
                best = Some((cost, v.abs(), at, j));
            }
        }
    }
    let (_, _, at, j) = best?;
    Some((open.swap_remove(at), j))
}

/// `row - factor * by` without column `pivot`; zero results stay in the pattern.
fn combined(
    row: &[(usize, f64)],
    by: &[(usize, f64)],
    pivot: usize,
    factor: f64,
    counts: &mut [usize],
) -> Vec<(usize, f64)> {
    let mut out = Vec::with_capacity(row.len() + by.len());
    let mut by = by.iter().filter(|e| e.0 != pivot).peekable();
    for &(j, v) in row {
        while let Some(&(c, u)) = by.next_if(|e| e.0 < j) {
            counts[c] += 1;
            out.push((c, -factor * u));
        }
        match by.next_if(|e| e.0 == j) {
            Some(&(_, u)) => out.push((j, v - factor * u)),
            None => out.push((j, v)),
        }
    }
    for &(c, u) in by {
        counts[c] += 1;
        out.push((c, -factor * u));
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{DMatrix, DVector};
    use proptest::prelude::*;

    fn dense(size: usize, entries: &[(usize, usize, f64)]) -> DMatrix<f64> {
        let mut out = DMatrix::zeros(size, size);
        entries.iter().for_each(|&(i, j, v)| out[(i, j)] += v);
        out
    }

    /// Factors of four matrices of one pattern in the order of `symbolic`, and which are regular.
    fn factored(
        symbolic: &Symbolic,
        matrices: [&[(usize, usize, f64)]; LANES],
    ) -> (Vec<Lanes>, [bool; LANES]) {
        let mut lu = vec![[0.0; LANES]; symbolic.entries()];
        let places = symbolic.places(matrices[0].iter().map(|&(i, j, _)| (i, j)));
        for (lane, entries) in matrices.iter().enumerate() {
            let values = places.iter().zip(*entries);
            values.for_each(|(at, e)| lu[*at as usize][lane] = e.2);
        }
        let regular = symbolic.factor(&mut lu, &mut vec![[0.0; LANES]; symbolic.size()]);
        (lu, regular)
    }

    proptest! {
        #![proptest_config(ProptestConfig {
            rng_seed: proptest::test_runner::RngSeed::Fixed(5),
            failure_persistence: None,
            ..ProptestConfig::default()
        })]

        /// Solutions agree with nalgebra's, for the matrix that the order was chosen on and for one
        /// of the same pattern.
        #[test]
        fn solves_agree_with_nalgebra(
            size in 1_usize..9,
            values in prop::collection::vec(-1.0..1.0_f64, 64),
            others in prop::collection::vec(-1.0..1.0_f64, 64),
            b in prop::collection::vec(-1.0..1.0_f64, 27),
        ) {
            let sparse = |values: &[f64], change: &[f64]| -> Vec<(usize, usize, f64)> {
                (0..size * size)
                    .filter(|k| values[*k] > 0.2)
                    .map(|k| (k / size, k % size, values[k] + 0.1 * change[k]))
                    .collect()
            };
            let first = sparse(&values, &vec![0.0; 64]);
            let symbolic = Symbolic::new(size, &first);
            let regular = dense(size, &first).determinant().abs() > 1e-6;
            prop_assume!(regular);
            let symbolic = symbolic.expect("a regular matrix has pivots");
            let half: Vec<f64> = others.iter().map(|v| 0.5 * v).collect();
            let matrices = [
                first.clone(),
                sparse(&values, &others),
                first,
                sparse(&values, &half),
            ];
            let (lu, lanes) = factored(&symbolic, std::array::from_fn(|l| matrices[l].as_slice()));
            prop_assert!(lanes[0] && lanes[2]);
            for (lane, entries) in matrices.iter().enumerate().filter(|(lane, _)| lanes[*lane]) {
                let a = dense(size, entries);
                let factors = Factors { symbolic: &symbolic, lu: &lu, lane };
                let scale = 1.0 + a.clone().try_inverse().map_or(0.0, |i| i.amax());
                let (columns, _) = b[..3 * size].as_chunks::<3>();
                let mut x = vec![[0.0; 3]; size];
                factors.solve(columns, &mut x);
                let x = DMatrix::from_row_slice(size, 3, x.as_flattened());
                let right = DMatrix::from_row_slice(size, 3, &b[..3 * size]);
                prop_assert!((&a * x - right).amax() < 1e-9 * scale);
                let mut x = b[..size].to_vec();
                factors.solve_transposed(&mut x, &mut vec![0.0; size]);
                prop_assert!((a.transpose() * DVector::from_vec(x) - DVector::from_column_slice(&b[..size])).amax() < 1e-9 * scale);
            }
        }
    }

    #[test]
    fn a_singular_matrix_has_no_order_and_a_lost_pivot_is_told() {
        assert!(Symbolic::new(2, &[(0, 0, 1.0), (1, 0, 2.0)]).is_none());
        let entries = [(0, 0, 1.0), (0, 1, 1.0), (1, 0, 1.0), (1, 1, 3.0)];
        let symbolic = Symbolic::new(2, &entries).expect("regular");
        let singular = entries.map(|(i, j, _)| (i, j, 1.0));
        let unknown = entries.map(|(i, j, _)| (i, j, f64::NAN));
        let (_, regular) = factored(&symbolic, [&entries, &singular, &unknown, &entries]);
        assert_eq!(regular, [true, false, false, true]);
    }
}
