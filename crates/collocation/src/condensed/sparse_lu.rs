//! LU factors of many small sparse matrices with the same pattern, four at a time. The pivot order is chosen once.
//!
//! It is Markowitz's order with threshold pivoting (Duff, Erisman & Reid, *Direct Methods for Sparse Matrices*, 2nd ed.
//! 2017, sections 7.2 and 7.8), based on the values of one of the matrices. Each refactorisation checks its pivots; if
//! one has become too small, the caller determines a new order for that matrix.

use crate::simd::{LANES, Lanes, less, times};
use std::cmp::Ordering;
use std::ops::Range;

/// Smallest pivot relative to the largest entry of its row when the order is chosen.
const THRESHOLD: f64 = 0.1;
/// Smallest pivot relative to the largest entry of its row in a refactorisation.
const SMALLEST: f64 = 1e-6;
/// Number of rows of lowest count among which the next pivot is searched.
const CANDIDATES: usize = 4;

/// Elimination order and pattern of the factors `L D U` of a square matrix, with unit diagonals of `L` and `U`.
///
/// The entries of the factors are stored in one list: those of `L` by ascending columns, those of `U` by descending
/// columns, then the inverse pivots `D⁻¹`. A solution thus reads them in storage order, and consecutive operations
/// change different rows.
#[derive(Debug, Clone, Default)]
pub struct Symbolic {
    /// Original row and column of each pivot.
    rows: Vec<usize>,
    columns: Vec<usize>,
    /// Original column of the pivot of each original row: the position of that row of a right-hand side.
    slots: Vec<u32>,
    lower: Triangle,
    upper: Triangle,
}

/// The entries of `L` or `U`.
#[derive(Debug, Clone, Default)]
struct Triangle {
    /// Range of `entries` that belongs to each row, in pivot order.
    rows: Vec<Range<usize>>,
    /// Column, in pivot order, and position of each entry, row by row.
    entries: Vec<(u32, u32)>,
    /// The entries in storage order, as operations on a solution in the original columns: row, column.
    operations: Vec<(u32, u32)>,
}

impl Symbolic {
    /// Chooses the order for a matrix given as `(row, column, value)`, each position once. The pattern of the factors
    /// contains every given position, including those with the value zero. None if the matrix is singular.
    pub fn new(size: usize, entries: &[(usize, usize, f64)]) -> Option<Self> {
        let mut active: Vec<Vec<(usize, f64)>> = vec![Vec::new(); size];
        let mut counts = vec![0_usize; size];
        for &(i, j, v) in entries {
            active[i].push((j, v));
            counts[j] += 1;
        }
        active.iter_mut().for_each(|row| row.sort_by_key(|e| e.0));
        // Entries of each original row left of its pivot: the pivots by which it was eliminated.
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
        let (size, place) = (rows.len(), inverse(&columns));
        let mut slots = vec![0; size];
        let pivots = rows.iter().zip(&columns);
        pivots.for_each(|(i, j)| slots[*i] = *j as u32);
        let of_row = |k: usize| {
            let mut own: Vec<usize> = upper[k].iter().map(|j| place[*j]).collect();
            own.retain(|c| *c != k);
            own.sort_unstable();
            own
        };
        let below: Vec<_> = (0..size).map(|k| lower[rows[k]].clone()).collect();
        let above: Vec<_> = (0..size).map(of_row).collect();
        Self {
            lower: Triangle::new(&columns, &below, 0..size),
            upper: Triangle::new(&columns, &above, (0..size).rev()),
            rows,
            columns,
            slots,
        }
    }

    /// Number of rows.
    pub fn size(&self) -> usize {
        self.rows.len()
    }

    /// Number of entries of the factors.
    #[inline]
    pub fn entries(&self) -> usize {
        self.lower.entries.len() + self.upper.entries.len() + self.size()
    }

    /// Positions in the factors of entries given as `(row, column)`.
    pub fn places(&self, entries: impl Iterator<Item = (usize, usize)>) -> Vec<u32> {
        let (row, column) = (inverse(&self.rows), inverse(&self.columns));
        let first = self.lower.entries.len();
        let place = |(i, j): (usize, usize)| {
            let (k, c) = (row[i], column[j]);
            match c.cmp(&k) {
                Ordering::Less => self.lower.place(k, c),
                Ordering::Equal => first + self.upper.entries.len() + k,
                Ordering::Greater => first + self.upper.place(k, c),
            }
        };
        entries.map(|at| place(at) as u32).collect()
    }

    /// Factors four matrices in place; `lu` holds them at their [`places`](Self::places) and zeros elsewhere. Returns
    /// false for matrices with a pivot that is too small; their factors are invalid. `work` has [`size`](Self::size)
    /// entries.
    #[inline(always)]
    pub fn factor(&self, lu: &mut [Lanes], work: &mut [Lanes]) -> [bool; LANES] {
        let (lower, rest) = lu.split_at_mut(self.lower.entries.len());
        let (upper, inverses) = rest.split_at_mut(self.upper.entries.len());
        let mut regular = [true; LANES];
        for k in 0..self.size() {
            let (below, above) = (self.lower.row(k), self.upper.row(k));
            for (c, at) in below {
                work[*c as usize] = lower[*at as usize];
            }
            for (c, at) in above {
                work[*c as usize] = upper[*at as usize];
            }
            work[k] = inverses[k];
            for (i, at) in below {
                let i = *i as usize;
                let value = work[i];
                lower[*at as usize] = times(value, inverses[i]);
                for (c, u) in self.upper.row(i) {
                    let c = *c as usize;
                    work[c] = less(work[c], value, upper[*u as usize]);
                }
            }
            let pivot = work[k];
            let mut largest = pivot.map(f64::abs);
            let inverse = pivot.map(|v| 1.0 / v);
            inverses[k] = inverse;
            for (c, at) in above {
                let value = work[*c as usize];
                largest = std::array::from_fn(|l| largest[l].max(value[l].abs()));
                upper[*at as usize] = times(value, inverse);
            }
            for ((pivot, largest), regular) in pivot.iter().zip(largest).zip(&mut regular) {
                // NaN fails too.
                *regular &=
                    pivot.abs() >= SMALLEST * largest && *pivot != 0.0 && largest.is_finite();
            }
        }
        regular
    }
}

impl Triangle {
    /// From the columns of each row, in pivot order, and the order of the columns in a solution.
    fn new(columns: &[usize], rows: &[Vec<usize>], order: impl Iterator<Item = usize>) -> Self {
        let mut out = Self::default();
        let mut places: Vec<Vec<(u32, u32)>> = vec![Vec::new(); rows.len()];
        for c in order {
            for k in (0..rows.len()).filter(|k| rows[*k].contains(&c)) {
                places[k].push((c as u32, out.operations.len() as u32));
                out.operations.push((columns[k] as u32, columns[c] as u32));
            }
        }
        for mut own in places {
            own.sort_unstable();
            let first = out.entries.len();
            out.entries.extend(own);
            out.rows.push(first..out.entries.len());
        }
        out
    }

    /// Columns and positions of the entries of a row.
    #[inline(always)]
    fn row(&self, k: usize) -> &[(u32, u32)] {
        &self.entries[self.rows[k].clone()]
    }

    /// Position of an entry.
    fn place(&self, row: usize, column: usize) -> usize {
        let own = self.row(row);
        own[own.partition_point(|(c, _)| (*c as usize) < column)].1 as usize
    }
}

fn inverse(order: &[usize]) -> Vec<usize> {
    let mut out = vec![0; order.len()];
    order.iter().enumerate().for_each(|(k, i)| out[*i] = k);
    out
}

/// The factors of one matrix of each of `B` groups, for solutions with several right-hand sides.
#[derive(Debug, Clone, Copy)]
pub struct Factors<'a, const B: usize> {
    symbolic: &'a Symbolic,
    lu: [&'a [Lanes]; B],
    lane: usize,
}

impl<'a, const B: usize> Factors<'a, B> {
    /// The factors of the matrix in this lane of each group.
    #[inline(always)]
    pub fn new(symbolic: &'a Symbolic, lu: [&'a [Lanes]; B], lane: usize) -> Self {
        Self { symbolic, lu, lane }
    }

    /// Position of each row of a right-hand side.
    #[inline(always)]
    pub fn slots(&self) -> &'a [u32] {
        &self.symbolic.slots
    }

    /// Solves `A X = Y` for `W` right-hand sides of each matrix in place; the rows of `Y` are at their
    /// [`slots`](Self::slots).
    #[inline(always)]
    pub fn solve<const W: usize>(&self, x: &mut [[[f64; W]; B]]) {
        let order = self.symbolic;
        let (lower, upper) = (order.lower.entries.len(), order.upper.entries.len());
        let places = order.lower.operations.iter().map(|&(to, from)| (to, from));
        subtract(places, self.lu.map(|lu| &lu[..lower]), self.lane, x);
        let inverses = self.lu.map(|lu| &lu[lower + upper..]);
        for (k, to) in order.columns.iter().enumerate() {
            for (x, inverses) in x[*to].iter_mut().zip(inverses) {
                let inverse = inverses[k][self.lane % LANES];
                x.iter_mut().for_each(|v| *v *= inverse);
            }
        }
        let places = order.upper.operations.iter().map(|&(to, from)| (to, from));
        let own = self.lu.map(|lu| &lu[lower..lower + upper]);
        subtract(places, own, self.lane, x);
    }
}

/// `x_to -= value x_from` for each position, with one lane of the values of each group.
#[inline(always)]
fn subtract<const B: usize, const W: usize>(
    places: impl ExactSizeIterator<Item = (u32, u32)>,
    values: [&[Lanes]; B],
    lane: usize,
    x: &mut [[[f64; W]; B]],
) {
    let values = values.map(|own| &own[..places.len()]);
    for (k, (to, from)) in places.enumerate() {
        let (from, to) = (from as usize, to as usize);
        for (member, values) in values.iter().enumerate() {
            let by = x[from][member];
            take(values[k][lane % LANES], &by, &mut x[to][member]);
        }
    }
}

/// The factors of one matrix of each of several groups.
#[derive(Debug, Clone, Copy)]
pub struct Together<'a> {
    symbolic: &'a Symbolic,
    lower: [&'a [Lanes]; LANES],
    upper: [&'a [Lanes]; LANES],
    inverses: [&'a [Lanes]; LANES],
    lane: usize,
}

impl<'a> Together<'a> {
    /// The factors of the matrix in this lane of each group.
    #[inline(always)]
    pub fn new(symbolic: &'a Symbolic, lu: [&'a [Lanes]; LANES], lane: usize) -> Self {
        let (lower, upper) = (symbolic.lower.entries.len(), symbolic.upper.entries.len());
        Self {
            symbolic,
            lower: lu.map(|lu| &lu[..lower]),
            upper: lu.map(|lu| &lu[lower..lower + upper]),
            inverses: lu.map(|lu| &lu[lower + upper..]),
            lane,
        }
    }

    /// Position of each row of a right-hand side.
    #[inline(always)]
    pub fn slots(&self) -> &'a [u32] {
        &self.symbolic.slots
    }

    /// Solves `A x = b` in place; the rows of `b` are at their [`slots`](Self::slots).
    #[inline(always)]
    pub fn solve(&self, x: &mut [Lanes]) {
        let (order, lane) = (self.symbolic, self.lane);
        let lower = order.lower.operations.iter();
        for (&(to, from), l) in lower.zip(gathered(self.lower, lane)) {
            x[to as usize] = less(x[to as usize], l, x[from as usize]);
        }
        for (to, inverse) in order.columns.iter().zip(gathered(self.inverses, lane)) {
            x[*to] = times(x[*to], inverse);
        }
        let upper = order.upper.operations.iter();
        for (&(to, from), u) in upper.zip(gathered(self.upper, lane)) {
            x[to as usize] = less(x[to as usize], u, x[from as usize]);
        }
    }

    /// Solves `Aᵀ x = b`; `b` is overwritten.
    #[inline(always)]
    pub fn solve_transposed(&self, b: &mut [Lanes], x: &mut [Lanes]) {
        let (order, lane) = (self.symbolic, self.lane);
        let upper = order.upper.operations.iter();
        for (&(from, to), u) in upper.zip(gathered(self.upper, lane)).rev() {
            b[to as usize] = less(b[to as usize], u, b[from as usize]);
        }
        for (to, inverse) in order.columns.iter().zip(gathered(self.inverses, lane)) {
            b[*to] = times(b[*to], inverse);
        }
        let lower = order.lower.operations.iter();
        for (&(from, to), l) in lower.zip(gathered(self.lower, lane)).rev() {
            b[to as usize] = less(b[to as usize], l, b[from as usize]);
        }
        for (x, slot) in x.iter_mut().zip(&order.slots) {
            *x = b[*slot as usize];
        }
    }
}

/// One lane of the values of each group.
#[inline(always)]
pub fn gathered(
    groups: [&[Lanes]; LANES],
    lane: usize,
) -> impl DoubleEndedIterator<Item = Lanes> + ExactSizeIterator {
    // The modulo lets the compiler omit bounds checks.
    let lane = lane % LANES;
    let [a, b, c, d] = groups;
    let all = a.iter().zip(b).zip(c).zip(d);
    all.map(move |(((a, b), c), d)| [a[lane], b[lane], c[lane], d[lane]])
}

/// `y -= a x`.
#[inline(always)]
pub fn take<const W: usize>(a: f64, x: &[f64; W], y: &mut [f64; W]) {
    for (y, x) in y.iter_mut().zip(x) {
        *y = (-a).mul_add(*x, *y);
    }
}

/// The pivot of lowest Markowitz cost among the rows of lowest count; removes its row from `open`.
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
    use nalgebra::DMatrix;
    use proptest::prelude::*;

    fn dense(size: usize, entries: &[(usize, usize, f64)]) -> DMatrix<f64> {
        let mut out = DMatrix::zeros(size, size);
        entries.iter().for_each(|&(i, j, v)| out[(i, j)] += v);
        out
    }

    /// Factors of four matrices with the same pattern in the order of `symbolic`, and which are regular.
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

        /// Solutions agree with nalgebra, for the matrix from which the order was chosen and for another with the same
        /// pattern.
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
                let factors = Factors::new(&symbolic, [&lu; 2], lane);
                let scale = 1.0 + a.clone().try_inverse().map_or(0.0, |i| i.amax());
                let (columns, _) = b[..3 * size].as_chunks::<3>();
                let mut x = vec![[[0.0; 3]; 2]; size];
                let slots = factors.slots().iter().zip(columns);
                slots.for_each(|(slot, row)| x[*slot as usize] = [[0.0; 3], *row]);
                factors.solve(&mut x);
                prop_assert!(x.iter().all(|[zero, _]| *zero == [0.0; 3]));
                let x = DMatrix::from_fn(size, 3, |i, j| x[i][1][j]);
                let right = DMatrix::from_row_slice(size, 3, &b[..3 * size]);
                prop_assert!((&a * x - right).amax() < 1e-9 * scale);
                // The same for all groups, with one right-hand side in each lane.
                let together = Together::new(&symbolic, [&lu; LANES], lane);
                let right = DMatrix::from_fn(size, LANES, |i, l| b[(i + 3 * l) % b.len()]);
                let of_row = |i: usize| -> Lanes { std::array::from_fn(|l| right[(i, l)]) };
                let matrix = |x: &[Lanes]| DMatrix::from_fn(size, LANES, |i, l| x[i][l]);
                let mut x = vec![[0.0; LANES]; size];
                let slots = together.slots().iter().enumerate();
                slots.for_each(|(i, slot)| x[*slot as usize] = of_row(i));
                together.solve(&mut x);
                prop_assert!((&a * matrix(&x) - &right).amax() < 1e-9 * scale);
                let mut rows: Vec<Lanes> = (0..size).map(of_row).collect();
                together.solve_transposed(&mut rows, &mut x);
                prop_assert!((a.transpose() * matrix(&x) - right).amax() < 1e-9 * scale);
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
