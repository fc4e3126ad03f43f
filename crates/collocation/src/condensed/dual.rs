//! The active set of the reduced QP by a dual method, which starts without rows and adds the most violated row in each
//! step (Goldfarb & Idnani, *A numerically stable dual method for solving strictly convex quadratic programs*, Math.
//! Program. 27, 1983).

use super::active::{Row, free};
use super::arrow::ArrowFactor;
use super::dense::{RANK, axpy, cholesky_solve, independent_cholesky};
use pilotage_sqp::QpFailure;

/// Maximum number of steps per row.
const MAX_STEPS: usize = 10;
/// A row counts as dependent on the active ones if its independent part, squared and relative, is smaller than this.
const DEPENDENT: f64 = 1e-12;

/// The sides at which rows are active: +1 upper, -1 lower, 0 neither.
///
/// # Errors
/// [`QpFailure::Infeasible`] if the rows are inconsistent, [`QpFailure::NoSolution`] if the method does not finish.
pub fn active_set(factor: &ArrowFactor, q: &[f64], rows: &[Row]) -> Result<Vec<f64>, QpFailure> {
    let mut state = State {
        factor,
        rows,
        x: free(factor, q).x,
        columns: vec![Vec::new(); rows.len()],
        active: Vec::new(),
    };
    let mut entering = None;
    for _ in 0..=MAX_STEPS * rows.len() {
        let Some(new) = entering.or_else(|| state.most_violated()) else {
            let mut sides = vec![0.0; rows.len()];
            (state.active.iter()).for_each(|own| sides[own.row] = own.side);
            return Ok(sides);
        };
        entering = state.step(new)?;
    }
    Err(QpFailure::NoSolution)
}

/// A row that is active or being added.
#[derive(Debug, Clone, Copy)]
struct Active {
    row: usize,
    side: f64,
    /// Nonnegative.
    multiplier: f64,
}

/// The minimum with the active rows as equations, except for the row being added.
struct State<'a> {
    factor: &'a ArrowFactor,
    rows: &'a [Row],
    x: Vec<f64>,
    /// `H⁻¹ a` of the rows used so far.
    columns: Vec<Vec<f64>>,
    active: Vec<Active>,
}

impl State<'_> {
    /// Raises the multiplier of the new row until the row holds, or until another row must leave first. In the latter
    /// case, the new row is returned, to be continued.
    ///
    /// # Errors
    /// [`QpFailure::Infeasible`] if neither happens; otherwise as [`Self::directions`].
    fn step(&mut self, new: Active) -> Result<Option<Active>, QpFailure> {
        let (fall, back) = self.directions(new)?;
        let may_leave = |own: &Active| !self.rows[own.row].is_equation();
        let falling = (self.active.iter().zip(&fall).enumerate())
            .filter(|(_, (own, f))| **f > 0.0 && may_leave(own));
        let blocking = falling
            .map(|(at, (own, fall))| (own.multiplier / fall, at))
            .min_by(|a, b| a.0.total_cmp(&b.0));
        let full = self.full_length(new, &back);
        let length = blocking.map_or(full, |(length, _)| length.min(full));
        if !length.is_finite() {
            return Err(QpFailure::Infeasible);
        }
        if full.is_finite() {
            axpy(-length, &back, &mut self.x);
        }
        for (own, fall) in self.active.iter_mut().zip(&fall) {
            own.multiplier = (own.multiplier - length * fall).max(0.0);
        }
        let multiplier = new.multiplier + length;
        let grown = Active { multiplier, ..new };
        match blocking.filter(|(length, _)| *length < full) {
            Some((_, at)) => {
                self.active.remove(at);
                Ok(Some(grown))
            }
            None => {
                self.active.push(grown);
                Ok(None)
            }
        }
    }

    /// Rates at which the multipliers of the active rows decrease as the new one grows, and at which the variables move
    /// back from its limit.
    ///
    /// # Errors
    /// [`QpFailure::NoSolution`] if the active rows are linearly dependent.
    fn directions(&mut self, new: Active) -> Result<(Vec<f64>, Vec<f64>), QpFailure> {
        let Self {
            factor,
            rows,
            x,
            columns,
            active,
        } = self;
        if columns[new.row].is_empty() {
            columns[new.row] = factor.solved(&rows[new.row].entries, x.len());
        }
        let product = |i: usize, j: usize| rows[i].value(&columns[j]);
        let entry = |i: usize, j: usize| product(active[i].row, active[j].row);
        let (kept, schur) = independent_cholesky(active.len(), RANK, entry);
        if kept.len() < active.len() {
            return Err(QpFailure::NoSolution);
        }
        let mut fall: Vec<f64> = (active.iter())
            .map(|own| new.side * product(own.row, new.row))
            .collect();
        cholesky_solve(&schur, fall.len(), &mut fall);
        let mut back: Vec<f64> = columns[new.row].iter().map(|v| new.side * v).collect();
        for (own, fall) in active.iter().zip(&mut fall) {
            axpy(-*fall, &columns[own.row], &mut back);
            // So far this was the decrease of the multiplier in the direction of the row itself.
            *fall *= own.side;
        }
        Ok((fall, back))
    }

    /// Step length at which the new row holds; infinite if it depends on the active ones.
    fn full_length(&self, new: Active, back: &[f64]) -> f64 {
        let row = &self.rows[new.row];
        let slope = new.side * row.value(back);
        let square = row.value(&self.columns[new.row]);
        match self.active.len() < self.x.len() && slope > DEPENDENT * square {
            true => new.side * (row.value(&self.x) - row.limit(new.side)) / slope,
            false => f64::INFINITY,
        }
    }

    /// The inactive row with the largest violation beyond rounding.
    fn most_violated(&self) -> Option<Active> {
        let outside = self.rows.iter().enumerate().filter_map(|(k, row)| {
            let excess = row.excess(row.value(&self.x));
            let is_known = self.active.iter().any(|own| own.row == k);
            (excess != 0.0 && !is_known).then_some((k, excess))
        });
        let worst = outside.max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()));
        worst.map(|(row, excess)| Active {
            row,
            side: excess.signum(),
            multiplier: 0.0,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::super::active::exchanged;
    use super::super::active::tests::{INF, matrix, row};
    use super::*;
    use pilotage_sqp::convex::ConvexQp;
    use proptest::prelude::*;
    use proptest::test_runner::RngSeed;

    /// Mutually exclusive rows.
    #[test]
    fn inconsistent_rows_have_no_active_set() {
        let factor = matrix(&[2.0, 4.0]).factor().unwrap();
        let rows = [
            row(&[1.0, 1.0], 1.0, INF),
            row(&[1.0, 0.0], -INF, 0.25),
            row(&[0.0, 1.0], -INF, 0.5),
        ];
        let found = active_set(&factor, &[0.0, 0.0], &rows);
        assert_eq!(found, Err(QpFailure::Infeasible));
        assert!(active_set(&factor, &[0.0, 0.0], &rows[..2]).is_ok());
    }

    proptest! {
        #![proptest_config(ProptestConfig {
            rng_seed: RngSeed::Fixed(11),
            failure_persistence: None,
            ..ProptestConfig::default()
        })]

        /// The active set of the dual method gives the solution of clarabel; one row in five is an equation.
        #[test]
        fn the_dual_method_agrees_with_clarabel(
            n in 1_usize..7,
            diagonal in prop::collection::vec(0.1..10.0_f64, 7),
            q in prop::collection::vec(-10.0..10.0_f64, 7),
            values in prop::collection::vec(-1.0..1.0_f64, 84),
            limits in prop::collection::vec((-1.5..0.5_f64, -0.5..2.0_f64), 12),
        ) {
            let arrow = matrix(&diagonal[..n]);
            let factor = arrow.factor().unwrap();
            let bounds = values.chunks(7).zip(&limits);
            let rows: Vec<Row> = bounds.map(|(a, (l, w))| row(&a[..n], *l, l + w.max(0.0))).collect();
            let entries = rows.iter().enumerate();
            let qp = ConvexQp {
                p: arrow.triplets(),
                q: q[..n].to_vec(),
                a: entries
                    .flat_map(|(i, row)| row.entries.iter().map(move |&(c, v)| (i, c, v)))
                    .collect(),
                lower: rows.iter().map(|row| row.lower).collect(),
                upper: rows.iter().map(|row| row.upper).collect(),
            };
            let found = active_set(&factor, &q[..n], &rows);
            match (qp.solve(None), found) {
                (Ok(rough), Ok(sides)) => {
                    let exact = exchanged(&factor, &q[..n], &rows, &sides);
                    let exact = exact.expect("an active set that needs no exchange");
                    for (x, y) in exact.x.iter().zip(&rough.x) {
                        prop_assert!((x - y).abs() < 1e-6, "{:?} {:?}", exact.x, rough.x);
                    }
                }
                (Err(QpFailure::Infeasible), Err(QpFailure::Infeasible)) => {}
                (clarabel, own) => prop_assert!(false, "{clarabel:?} {own:?}"),
            }
        }
    }
}
