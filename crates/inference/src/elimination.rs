//! Elimination of active constraints and of the runs' own unknowns from a linearised least-squares problem.

use crate::data::{Data, Run};
use nalgebra::{DMatrix, DVector, SymmetricEigen};
use pilotage_linear::svd::svd;

/// A vector whose remainder is shorter than this part of its length is within the span of the others.
const DEPENDENT: f64 = 1e-8;

/// An unknown that changes all residuals by less than this, relative to the others, has no effect.
const NO_EFFECT: f64 = 1e-9;

/// Effect of a run's own unknowns on a constraint, relative to that of the shared parameters, below which they are
/// ignored. Unknowns are scaled so that they change the residuals by one.
const FADED: f64 = 1e-3;

/// A run with unknowns `θ = D Z φ` and `μ = N ν + M φ`, for which the constraints hold for all φ and ν.
#[derive(Debug, Clone)]
pub struct Eliminated {
    /// `∂r/∂φ`, n × d.
    pub shared: DMatrix<f64>,
    /// The same with the run's own unknowns projected out.
    pub projected: DMatrix<f64>,
    /// Orthonormal columns that span the effect of the run's own unknowns.
    pub basis: DMatrix<f64>,
    /// `N B⁺`: own unknowns as a function of the residuals, m × n.
    pub inverse: DMatrix<f64>,
    /// `M`: own unknowns as a function of φ through the constraints, m × d.
    pub follows: DMatrix<f64>,
    /// Own unknowns that the residuals do not determine.
    pub flat: Vec<bool>,
    /// Projector on what they leave open of the own unknowns in these units, m × m.
    pub open: DMatrix<f64>,
    /// Change of each own unknown that changes the residuals by one.
    pub units: DVector<f64>,
}

/// All runs over the same free coordinates φ.
#[derive(Debug, Clone)]
pub struct Elimination {
    /// The runs.
    pub runs: Vec<Eliminated>,
    /// Rows of the prior over φ.
    pub prior: DMatrix<f64>,
    /// `D Z`: θ as a function of φ, p × d.
    pub free: DMatrix<f64>,
}

impl Elimination {
    /// Eliminates with parameters in these units. With `holds_shared`, constraints on the shared parameters are held;
    /// otherwise φ is θ in its units.
    pub fn new(data: &Data, units: &DVector<f64>, holds_shared: bool) -> Self {
        let held: Vec<Held> = data.runs.iter().map(|run| Held::new(run, units)).collect();
        let mut rows: Vec<DVector<f64>> = held.iter().flat_map(|own| own.rest.clone()).collect();
        let of_parameters = data.active.row_iter();
        rows.extend(of_parameters.map(|row| row.transpose().component_mul(units)));
        if !holds_shared {
            rows.clear();
        }
        let z = null_space(&rows, units.len());
        let scaled = DMatrix::from_diagonal(units);
        let runs = data.runs.iter().zip(held);
        Self {
            runs: runs.map(|(run, held)| held.eliminated(run, &z)).collect(),
            prior: &data.prior * &scaled * &z,
            free: scaled * z,
        }
    }

    /// The same over coordinates ψ with φ = Eψ.
    pub fn within(mut self, e: &DMatrix<f64>) -> Self {
        for run in &mut self.runs {
            run.shared = &run.shared * e;
            run.projected = &run.projected * e;
            run.follows = &run.follows * e;
        }
        self.prior *= e;
        self.free *= e;
        self
    }

    /// `Σ J_gᵀ J_g`, without priors.
    pub fn information(&self) -> DMatrix<f64> {
        let d = self.free.ncols();
        let squares = self.runs.iter().map(Eliminated::information);
        squares.fold(DMatrix::zeros(d, d), |sum, own| sum + own)
    }
}

impl Eliminated {
    /// `J_gᵀ J_g`.
    pub fn information(&self) -> DMatrix<f64> {
        self.projected.tr_mul(&self.projected)
    }
}

/// A run in scaled parameters θ' with its active constraints held: `μ = N ν + M θ'`.
struct Held {
    shared: DMatrix<f64>,
    own: DMatrix<f64>,
    /// `N` in own unknowns that change the residuals by one.
    null: DMatrix<f64>,
    follows: DMatrix<f64>,
    /// These own unknowns in their units.
    own_units: DVector<f64>,
    /// Remaining constraints on θ' alone.
    rest: Vec<DVector<f64>>,
}

impl Held {
    fn new(run: &Run, units: &DVector<f64>) -> Self {
        let (p, m) = (units.len(), run.own.ncols());
        let scaled = DMatrix::from_diagonal(units);
        let effects: Vec<f64> = run.own.column_iter().map(|column| column.norm()).collect();
        let own_units = change_by_one(&effects, &run.own_scales);
        let own_scaled = DMatrix::from_diagonal(&own_units);
        let shared = &run.shared * &scaled;
        let by_shared = run.active.columns(0, p) * &scaled;
        let own = &run.own * &own_scaled;
        let mut by_own = run.active.columns(p, m) * &own_scaled;
        // An initial state that has decayed before the constraint holds cannot compensate anything: it would have to
        // change by more than the residuals allow.
        for (mut row, all) in by_own.row_iter_mut().zip(by_shared.row_iter()) {
            let effects = own.column_iter().zip(row.iter());
            let sizes = effects.map(|(column, own)| match column.norm() {
                size if size > 0.0 => own.abs() / size,
                _ => own.abs(),
            });
            if sizes.fold(0.0, f64::max) < FADED * all.norm() {
                row.fill(0.0);
            }
        }
        let rows: Vec<DVector<f64>> = by_own.row_iter().map(|row| row.transpose()).collect();
        let null = null_space(&rows, m);
        let inverse = pseudo_inverse(&by_own);
        let follows = -&inverse * &by_shared;
        // The part that no own unknown can compensate.
        let rest = &by_shared + &by_own * &follows;
        let is_left = |row: &DVector<f64>, all: &DVector<f64>| row.norm() > DEPENDENT * all.norm();
        let pairs = rest.row_iter().zip(by_shared.row_iter());
        let pairs = pairs.map(|(row, all)| (row.transpose(), all.transpose()));
        Self {
            shared: shared + &own * &follows,
            own: own * &null,
            null,
            follows: &own_scaled * follows,
            own_units,
            rest: pairs
                .filter(|(row, all)| is_left(row, all))
                .map(|(row, _)| row)
                .collect(),
        }
    }

    fn eliminated(self, run: &Run, z: &DMatrix<f64>) -> Eliminated {
        let shared = &self.shared * z;
        let basis = basis(&self.own);
        let inside = &basis * basis.tr_mul(&shared);
        let within = pseudo_inverse(&basis.tr_mul(&self.own));
        // A free direction of the own unknowns that changes no residual.
        let seen = &self.null * &within * basis.tr_mul(&self.own) * self.null.transpose();
        let free = &self.null * self.null.transpose();
        let open = free - seen;
        let is_flat = |i: usize| open[(i, i)] > 1e-6;
        Eliminated {
            projected: &shared - inside,
            inverse: DMatrix::from_diagonal(&self.own_units)
                * (&self.null * within * basis.transpose()),
            follows: &self.follows * z,
            flat: (0..run.own.ncols()).map(is_flat).collect(),
            open,
            units: self.own_units,
            basis,
            shared,
        }
    }
}

/// The change of each unknown that changes the residuals by one, given by how much they change with it; the scale of an unknown
/// without effect.
pub fn change_by_one(effects: &[f64], scales: &DVector<f64>) -> DVector<f64> {
    let of_scales = effects
        .iter()
        .zip(scales.iter())
        .map(|(by, scale)| by * scale);
    let least = NO_EFFECT * of_scales.fold(0.0, f64::max);
    DVector::from_fn(effects.len(), |i, _| match effects[i] * scales[i] > least {
        true => 1.0 / effects[i],
        false => scales[i],
    })
}

/// Orthonormal basis of a matrix's column space: Gram–Schmidt, applied twice (Giraud, Langou & Rozložník, *The loss of
/// orthogonality in the Gram–Schmidt orthogonalization process*, Comput. Math. Appl. 50, 2005).
pub fn basis(matrix: &DMatrix<f64>) -> DMatrix<f64> {
    let mut columns: Vec<DVector<f64>> = Vec::new();
    for column in matrix.column_iter() {
        let mut rest = column.into_owned();
        for _ in 0..2 {
            for known in &columns {
                let along = known.dot(&rest);
                rest.axpy(-along, known, 1.0);
            }
        }
        if rest.norm() > DEPENDENT * column.norm() {
            columns.push(rest.normalize());
        }
    }
    match columns.is_empty() {
        true => DMatrix::zeros(matrix.nrows(), 0),
        false => DMatrix::from_columns(&columns),
    }
}

/// Orthonormal columns that are orthogonal to all these rows of length n.
fn null_space(rows: &[DVector<f64>], n: usize) -> DMatrix<f64> {
    if rows.is_empty() || n == 0 {
        return DMatrix::identity(n, n);
    }
    let range = basis(&DMatrix::from_columns(rows));
    let eigen = SymmetricEigen::new(DMatrix::identity(n, n) - &range * range.transpose());
    let kept = (0..n).filter(|k| eigen.eigenvalues[*k] > 0.5);
    let kept: Vec<DVector<f64>> = kept
        .map(|k| eigen.eigenvectors.column(k).into_owned())
        .collect();
    match kept.is_empty() {
        true => DMatrix::zeros(n, 0),
        false => DMatrix::from_columns(&kept),
    }
}

fn pseudo_inverse(matrix: &DMatrix<f64>) -> DMatrix<f64> {
    let (rows, columns) = matrix.shape();
    if rows == 0 || columns == 0 {
        return DMatrix::zeros(columns, rows);
    }
    svd(matrix).map_or_else(
        || DMatrix::zeros(columns, rows),
        |found| found.pseudo_inverse(DEPENDENT * found.singular[0]),
    )
}
