//! The second-order condition at a KKT point: the Lagrangian has no negative curvature in any direction of the critical
//! cone (Nocedal & Wright, *Numerical Optimization*, 2nd ed., theorems 12.5 and 12.6).
//!
//! Strongly active inequalities (nonzero multiplier) restrict directions to their tangent plane, weakly active ones
//! (zero multiplier) to their inner side. A minimum of the curvature over the unit vectors of that cone lies in the
//! interior of one of its faces and is an eigenvector of the Hessian projected on the span of that face (W. Kaplan, *A
//! test for copositive matrices*, Linear Algebra Appl. 313, 2000), so all faces are examined. Without weakly active
//! inequalities there is one face: the null space of the active rows.
//!
//! The sign of the curvature does not depend on the scaling of the variables, but its size and rounding error do, and
//! reduced variables may differ by many orders of magnitude. The reduced Hessian is therefore first scaled to a unit
//! diagonal, which is nearly the best diagonal scaling (A. van der Sluis, *Condition numbers and equilibration of
//! matrices*, Numer. Math. 14, 1969).

use super::Problem;
use super::iterate::Iterate;
use nalgebra::{DMatrix, DVector, SymmetricEigen};

/// Scaled curvature above minus this value counts as nonnegative: the Hessian inherits the error that the KKT tolerance
/// allows in point and multipliers.
pub const TOLERANCE: f64 = 1e-8;
/// Distance from a limit, and multiplier, below which they count as zero: their product is within the KKT tolerance.
const ZERO: f64 = 1e-4;
/// Maximum number of weakly active rows whose faces are enumerated; further ones are treated as strongly active.
const MAX_WEAK: usize = 6;
/// Relative difference below which rows count as dependent.
const RANK: f64 = 1e-9;
/// Maximum number of steps of the eigenvalue iteration.
const MAX_ITERATIONS: usize = 10_000;
/// Largest matrix whose eigenvalues are computed.
pub const MAX_SIZE: usize = 500;

/// The smallest curvature of the Lagrangian over the critical cone.
#[derive(Debug, Clone, PartialEq)]
pub struct Curvature {
    /// Smallest eigenvalue of the reduced Hessian, scaled to a unit diagonal and projected on the cone, divided by the
    /// Frobenius norm of that matrix or by one, whichever is larger. At most one, which is also its value at a vertex,
    /// where no direction is left.
    pub smallest: f64,
    /// `dᵀWd` along the direction.
    pub along: f64,
    /// The direction `d` of the smallest curvature, of any length; empty at a vertex.
    pub direction: Vec<f64>,
}

impl Curvature {
    /// True if the curvature is negative beyond rounding.
    pub fn is_negative(&self) -> bool {
        self.smallest < -TOLERANCE
    }

    /// A vertex: the active rows leave no direction.
    fn vertex() -> Self {
        Self {
            smallest: 1.0,
            along: 0.0,
            direction: Vec::new(),
        }
    }
}

/// How an inequality restricts the directions at a KKT point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Activity {
    /// Away from its limits: no restriction.
    Free,
    /// At a limit, with a multiplier: its value must not change.
    Strong,
    /// At a limit without a multiplier: its value times this sign must not grow.
    Weak(f64),
}

/// The activity of every inequality at a KKT point.
pub fn activities<P: Problem + ?Sized>(problem: &P, at: &Iterate) -> Vec<Activity> {
    let (lower, upper) = problem.limits();
    let rows = at.g.iter().zip(&at.eta).zip(lower.iter().zip(upper));
    rows.map(|((&g, &eta), (&l, &u))| activity(g, eta, l, u))
        .collect()
}

fn activity(g: f64, eta: f64, lower: f64, upper: f64) -> Activity {
    let (above, below) = ((g - lower).abs(), (upper - g).abs());
    let holding = if eta > 0.0 { below } else { above };
    let both = above <= ZERO && below <= ZERO;
    if both || eta.abs() > holding.max(ZERO) {
        Activity::Strong
    } else if below <= ZERO {
        Activity::Weak(1.0)
    } else if above <= ZERO {
        Activity::Weak(-1.0)
    } else {
        Activity::Free
    }
}

/// The critical cone: `aᵀd = 0` for the held rows, `aᵀd ≤ 0` for the weak ones.
#[derive(Debug, Clone, Default)]
pub struct Cone {
    /// Gradients of strongly active inequalities.
    pub held: Vec<DVector<f64>>,
    /// Outward gradients of weakly active ones.
    pub weak: Vec<DVector<f64>>,
}

impl Cone {
    /// Adds an inequality with the gradient `row`.
    pub fn add(&mut self, activity: Activity, row: DVector<f64>) {
        match activity {
            Activity::Free => {}
            Activity::Strong => self.held.push(row),
            Activity::Weak(sign) => self.weak.push(row * sign),
        }
    }

    /// The smallest curvature of `h` over the cone. None if it cannot be computed: `h` is too large or not finite.
    pub fn smallest(mut self, h: &DMatrix<f64>) -> Option<Curvature> {
        if h.nrows() > MAX_SIZE || h.iter().any(|v| !v.is_finite()) {
            return None;
        }
        if self.weak.len() > MAX_WEAK {
            self.held.extend(self.weak.drain(MAX_WEAK..));
        }
        let unit = DVector::from_iterator(h.nrows(), h.diagonal().iter().map(|v| unit(*v)));
        let h = DMatrix::from_fn(h.nrows(), h.ncols(), |i, j| h[(i, j)] * unit[i] * unit[j]);
        let rows = self.held.iter_mut().chain(&mut self.weak);
        rows.for_each(|row| row.component_mul_assign(&unit));
        let span = null_space(&self.held, h.nrows());
        let projected = span.tr_mul(&(&h * &span));
        let scale = projected.norm().max(1.0);
        let weak: Vec<DVector<f64>> = (self.weak.iter())
            .map(|row| (span.tr_mul(row), RANK * row.norm()))
            .filter(|(row, rounding)| row.norm() > *rounding)
            .map(|(row, _)| row.normalize())
            .collect();
        let faces = 0..1_usize << weak.len();
        let found = faces.map(|face| least_inside(&projected, &weak, face));
        let found = found.collect::<Option<Vec<_>>>()?;
        let least = (found.into_iter().flatten()).min_by(|(a, _), (b, _)| a.total_cmp(b));
        Some(
            least.map_or_else(Curvature::vertex, |(along, direction)| Curvature {
                smallest: along / scale,
                along,
                direction: (span * direction).component_mul(&unit).as_slice().to_vec(),
            }),
        )
    }
}

/// The unit of a variable in which its diagonal entry of the Hessian becomes one. Entries below one are not scaled,
/// since a flat direction of a scaled problem is flat.
pub fn unit(diagonal: f64) -> f64 {
    1.0 / diagonal.abs().max(1.0).sqrt()
}

/// The smallest eigenvalue whose eigenvector lies in the cone `weak · d ≤ 0`, on the face where the rows in the bits of
/// `face` are zero, if there is one. None if the eigenvalues cannot be computed.
fn least_inside(
    h: &DMatrix<f64>,
    weak: &[DVector<f64>],
    face: usize,
) -> Option<Option<(f64, DVector<f64>)>> {
    let is_held = |i: &usize| face & (1 << i) != 0;
    let held: Vec<_> = (0..weak.len()).filter(is_held).collect();
    let rows: Vec<DVector<f64>> = held.iter().map(|&i| weak[i].clone()).collect();
    let span = null_space(&rows, h.nrows());
    if span.ncols() == 0 {
        return Some(None);
    }
    let inner = span.tr_mul(&(h * &span));
    // The iteration would not end if a value is not finite.
    if !inner.iter().all(|value| value.is_finite()) {
        return None;
    }
    let eigen = SymmetricEigen::try_new(inner, f64::EPSILON, MAX_ITERATIONS)?;
    let inside = |d: &DVector<f64>| weak.iter().all(|row| row.dot(d) <= RANK);
    let vectors = eigen
        .eigenvalues
        .iter()
        .zip(eigen.eigenvectors.column_iter());
    let least = vectors
        .filter_map(|(value, vector)| {
            let d = &span * vector;
            let signed = [-&d, d].into_iter().rev().find(inside)?;
            Some((*value, signed))
        })
        .min_by(|(a, _), (b, _)| a.total_cmp(b));
    Some(least)
}

/// An orthonormal basis of the directions with `rowᵀd = 0` for all rows, as columns. Rows may be dependent (QR with
/// column pivoting; Golub & Van Loan, *Matrix Computations*, 4th ed., section 5.4.2).
pub fn null_space(rows: &[DVector<f64>], n: usize) -> DMatrix<f64> {
    let units: Vec<DVector<f64>> = (rows.iter())
        .filter(|row| row.norm() > 0.0)
        .map(|row| row.normalize())
        .collect();
    let mut basis = DMatrix::identity(n, n);
    if units.is_empty() {
        return basis;
    }
    let qr = DMatrix::from_columns(&units).col_piv_qr();
    let r = qr.r();
    let rank = (0..r.nrows())
        .take_while(|&i| r[(i, i)].abs() > RANK)
        .count();
    qr.q_tr_mul(&mut basis);
    basis.rows(rank, n - rank).transpose()
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
        fn null_spaces_are_orthonormal_and_complete(
            n in 1_usize..9, m in 0_usize..9, copies in 0_usize..3,
            numbers in prop::collection::vec(-1.0..1.0_f64, 81),
        ) {
            let mut rows: Vec<DVector<f64>> = (0..m)
                .map(|i| DVector::from_column_slice(&numbers[i * n..(i + 1) * n]))
                .collect();
            rows.extend(rows.clone().into_iter().take(copies).map(|row| row * -3.0));
            let basis = null_space(&rows, n);
            prop_assert_eq!(basis.ncols(), n.saturating_sub(m));
            let gram = basis.tr_mul(&basis) - DMatrix::identity(basis.ncols(), basis.ncols());
            prop_assert!(gram.amax() < 1e-12);
            for row in &rows {
                prop_assert!(basis.tr_mul(row).amax() < 1e-12);
            }
        }

        /// Compared with many unit vectors of the cone.
        #[test]
        fn no_direction_of_the_cone_has_less(
            n in 1_usize..5, held in 0_usize..2, weak in 0_usize..4,
            numbers in prop::collection::vec(-1.0..1.0_f64, 40),
            directions in prop::collection::vec(-1.0..1.0_f64, 400),
        ) {
            let a = DMatrix::from_row_slice(n, n, &numbers[..n * n]);
            let h = &a + a.transpose();
            let row = |i: usize| DVector::from_column_slice(&numbers[16 + i * n..16 + (i + 1) * n]);
            let cone = Cone {
                held: (0..held).map(row).collect(),
                weak: (held..held + weak).map(row).collect(),
            };
            let found = cone.clone().smallest(&h).unwrap();
            prop_assert!(found.smallest <= 1.0);
            if !found.direction.is_empty() {
                let d = DVector::from_vec(found.direction.clone());
                prop_assert!((d.dot(&(&h * &d)) - found.along).abs() < 1e-9);
                prop_assert!(cone.held.iter().all(|row| row.dot(&d).abs() < 1e-9));
                prop_assert!(cone.weak.iter().all(|row| row.dot(&d) < 1e-8));
            }
            let span = null_space(&cone.held, n);
            for chunk in directions.chunks_exact(n) {
                let d = &span * span.tr_mul(&DVector::from_column_slice(chunk));
                let inside = d.norm() > 1e-3 && cone.weak.iter().all(|row| row.dot(&d) <= 0.0);
                if inside {
                    let unit = DVector::from_iterator(n, h.diagonal().iter().map(|v| unit(*v)));
                    let d = d.component_div(&unit).normalize().component_mul(&unit);
                    prop_assert!(!found.direction.is_empty());
                    prop_assert!(d.dot(&(&h * &d)) >= found.along - 1e-9);
                }
            }
        }
    }

    #[test]
    fn activities_follow_distance_and_multiplier() {
        let inf = f64::INFINITY;
        assert_eq!(activity(0.0, -0.3, 0.0, inf), Activity::Strong);
        assert_eq!(activity(1.0, 0.3, 0.0, 1.0), Activity::Strong);
        assert_eq!(activity(0.0, 0.0, 0.0, inf), Activity::Weak(-1.0));
        assert_eq!(activity(1.0, 1e-9, -inf, 1.0), Activity::Weak(1.0));
        assert_eq!(activity(0.5, 0.0, 0.0, 1.0), Activity::Free);
        assert_eq!(activity(1.0, 0.0, 1.0, 1.0), Activity::Strong);
    }
}
