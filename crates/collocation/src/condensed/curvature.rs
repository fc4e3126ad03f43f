//! The second-order condition on the reduced variables: parameters and free initial states.
//!
//! With many reduced variables (hundreds of runs with free initial states), the arrowhead structure is kept. A large
//! multiple of `aaᵀ` is added for every active row `a`, which preserves the structure. The resulting matrix has a
//! Cholesky factor exactly if it is positive definite in the null space of the rows (Finsler), and inverse iteration
//! with that factor finds the smallest eigenvalue (Golub & Van Loan, *Matrix Computations*, 4th ed., section 8.2).
//! Weakly active rows are then treated as strongly active.

use super::Condensed;
use super::active::RowAt;
use super::arrow::Arrow;
use super::dense::dot;
use crate::Collocation;
use nalgebra::{DMatrix, DVector};
use pilotage_sqp::convex::ConvexSolution;
use pilotage_sqp::curvature::{Activity, Cone, Curvature, activities, unit};
use pilotage_sqp::{Iterate, Problem, Step};

/// Maximum number of reduced variables for which all eigenvalues are computed.
const FEW: usize = 200;

impl Condensed {
    /// See [`QpSolver::curvature`](pilotage_sqp::QpSolver::curvature).
    pub(super) fn smallest_curvature(
        &mut self,
        problem: &Collocation,
        at: &Iterate,
    ) -> Option<Curvature> {
        if self.singular {
            return None;
        }
        let arrow = self.exact.as_ref()?;
        let rows = self.active_rows(problem, at);
        let mut found = match arrow.size() <= FEW {
            true => among_few(arrow, &rows),
            false => among_many(arrow, &rows),
        }?;
        if !found.direction.is_empty() {
            found.direction = self.all_variables(problem, &found.direction);
        }
        Some(found)
    }

    /// The active inequalities over the reduced variables.
    pub(super) fn active_rows(&self, problem: &Collocation, at: &Iterate) -> Vec<ActiveRow> {
        let (lower, upper) = problem.limits();
        let bounded = (problem.layout.runs.iter().enumerate()).flat_map(|(run, data)| {
            (data.inequalities()).map(move |row| RowAt::Bounded {
                run,
                row: row - data.g,
            })
        });
        let places = bounded.chain((0..self.parameter_rows.len()).map(RowAt::Parameter));
        (places.zip(activities(problem, at)))
            .filter(|(_, activity)| *activity != Activity::Free)
            .map(|(place, activity)| ActiveRow {
                at: place,
                activity,
                entries: self.row(problem, place, lower, upper).entries,
            })
            .collect()
    }

    /// A direction in all variables that satisfies the linearised defects, from one in the reduced variables.
    fn all_variables(&mut self, problem: &Collocation, rho: &[f64]) -> Vec<f64> {
        self.expand(problem, rho, 0.0);
        let mut step = Step::default();
        let solution = ConvexSolution {
            x: rho.to_vec(),
            y: Vec::new(),
            violation: 0.0,
        };
        self.write_primal(problem, &[], &solution, &mut step);
        step.d
    }
}

/// An active inequality.
#[derive(Debug, Clone)]
pub(super) struct ActiveRow {
    /// The inequality that is active.
    pub at: RowAt,
    activity: Activity,
    /// Pairs of column and coefficient.
    pub entries: Vec<(usize, f64)>,
}

impl ActiveRow {
    /// True if its value must not change.
    pub fn is_held(&self) -> bool {
        self.activity == Activity::Strong
    }
}

/// Smallest curvature from the eigenvalues of the dense matrix.
fn among_few(arrow: &Arrow, rows: &[ActiveRow]) -> Option<Curvature> {
    let n = arrow.size();
    let mut hessian = DMatrix::zeros(n, n);
    for (i, j, v) in arrow.triplets() {
        hessian[(i, j)] = v;
        hessian[(j, i)] = v;
    }
    let mut cone = Cone::default();
    for row in rows {
        let mut gradient = DVector::zeros(n);
        row.entries.iter().for_each(|&(i, v)| gradient[i] += v);
        cone.add(row.activity, gradient);
    }
    cone.smallest(&hessian)
}

/// Multiple of `aaᵀ`, relative to the matrix.
const PENALTY: f64 = 1e6;
/// Initial shift of a matrix that is not positive definite, relative to the matrix: within rounding.
const FIRST_SHIFT: f64 = 1e-10;
/// Number of steps of inverse iteration.
const STEPS: usize = 60;

/// Smallest curvature from factors of the arrowhead.
fn among_many(arrow: &Arrow, rows: &[ActiveRow]) -> Option<Curvature> {
    let (mut held, units) = with_unit_diagonal(arrow);
    let square = |(i, j, v): (usize, usize, f64)| if i == j { v * v } else { 2.0 * v * v };
    let squares: f64 = held.triplets().into_iter().map(square).sum();
    let scale = squares.sqrt().max(1.0);
    for row in rows {
        let mut row = row.clone();
        row.entries
            .iter_mut()
            .for_each(|(column, v)| *v *= units[*column]);
        held.add_square(row.at.run(), &row.entries, PENALTY * scale);
    }
    let mut shift = 0.0;
    let factor = loop {
        let mut shifted = held.clone();
        shifted.add_diagonal(shift);
        if let Some(factor) = shifted.factor() {
            break factor;
        }
        if shift.is_nan() || shift > 2.0 * scale {
            return None;
        }
        shift = (2.0 * shift).max(FIRST_SHIFT * scale);
    };
    // Any vector that is not orthogonal to the eigenvector.
    let mut direction: Vec<f64> = (0..arrow.size()).map(|i| 1.0 + (i as f64).sin()).collect();
    let mut along = 0.0;
    for _ in 0..STEPS {
        let length = dot(&direction, &direction).sqrt();
        direction.iter_mut().for_each(|v| *v /= length);
        let before = direction.clone();
        factor.solve(&mut direction);
        along = 1.0 / dot(&before, &direction) - shift;
    }
    let length = dot(&direction, &direction).sqrt();
    let units = units.iter().map(|unit| unit / length);
    direction
        .iter_mut()
        .zip(units)
        .for_each(|(v, unit)| *v *= unit);
    Some(Curvature {
        smallest: (along / scale).min(1.0),
        along,
        direction,
    })
}

/// The matrix scaled to a unit diagonal, and the [`unit`] of each variable.
fn with_unit_diagonal(arrow: &Arrow) -> (Arrow, Vec<f64>) {
    let (p, mut scaled) = (arrow.p, arrow.clone());
    let of = |matrix: &[f64], n: usize| -> Vec<f64> {
        (0..n).map(|i| unit(matrix[i * n + i])).collect()
    };
    let shared = of(&arrow.theta, p);
    let mut units = shared.clone();
    let scale = |matrix: &mut [f64], rows: &[f64], columns: &[f64]| {
        for (row, r) in matrix.chunks_exact_mut(columns.len().max(1)).zip(rows) {
            row.iter_mut().zip(columns).for_each(|(v, c)| *v *= r * c);
        }
    };
    scale(&mut scaled.theta, &shared, &shared);
    for run in &mut scaled.runs {
        let own = of(&run.diagonal, run.n);
        scale(&mut run.cross, &own, &shared);
        scale(&mut run.diagonal, &own, &own);
        units.extend(own);
    }
    (scaled, units)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(ProptestConfig {
            rng_seed: proptest::test_runner::RngSeed::Fixed(1),
            ..ProptestConfig::default()
        })]

        #[test]
        fn few_and_many_agree(
            p in 1_usize..4, free in prop::collection::vec(0_usize..4, 0..4), parameter_row in any::<bool>(),
            numbers in prop::collection::vec(-1.0..1.0_f64, 200), lift in 0.0..3.0_f64,
        ) {
            let mut numbers = numbers.into_iter();
            let mut arrow = Arrow::zeros(p, &free);
            let mut rows = Vec::new();
            let mut first = p;
            for (j, n) in free.iter().enumerate() {
                let a = DMatrix::from_fn(p + n, p + n, |_, _| numbers.next().unwrap_or(0.3));
                arrow.set_run(j, (&a + a.transpose()).as_slice());
                if *n > 0 {
                    let columns = (0..p).chain(first..first + n);
                    let entries = columns.map(|i| (i, 0.3 + (i as f64).cos())).collect();
                    rows.push(ActiveRow { at: RowAt::Bounded { run: j, row: 0 }, activity: Activity::Strong, entries });
                }
                first += n;
            }
            if parameter_row {
                let entries = vec![(p - 1, 0.7)];
                rows.push(ActiveRow { at: RowAt::Parameter(0), activity: Activity::Strong, entries });
            }
            arrow.add_diagonal(lift);
            let few = among_few(&arrow, &rows).unwrap();
            prop_assume!(!few.direction.is_empty());
            let many = among_many(&arrow, &rows).unwrap();
            prop_assert_eq!(few.is_negative(), many.is_negative());
            // The eigenvalue is accurate if it is well separated from the next one; the error is always from above.
            prop_assert!(many.along >= few.along - 1e-4, "{:?} {:?}", few, many);
            prop_assert!(many.along <= few.along + 0.2 * (1.0 + lift), "{:?} {:?}", few, many);
        }
    }
}
