//! What the data tell of the parameters: information, and the directions that they leave open.

use crate::data::{Data, Run};
use crate::elimination::Elimination;
use nalgebra::{DMatrix, DVector, Dyn, SymmetricEigen};

/// Why there is no covariance.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum Obstacle {
    /// No more residuals than unknowns.
    #[error("{residuals} measured values do not tell {unknowns} unknowns and the noise")]
    TooFew {
        /// Residuals of all runs.
        residuals: usize,
        /// Unknowns that they determine.
        unknowns: usize,
    },
    /// A derivative or a residual that is no finite number.
    #[error("a derivative or a residual at the solution is no finite number")]
    NotFinite,
    /// A sandwich over runs of which there are too few, or one of which alone tells a parameter.
    #[error("cr3 asks for two runs or more that tell all parameters without any one of them")]
    FewRuns,
    /// A variance that is negative, as sums over a part of the lags may be.
    #[error("the variance of a parameter came out negative, as this estimate may; take another")]
    Negative,
}

/// Eigenvalue of the information, scaled to a unit diagonal, below which a direction is open.
const OPEN: f64 = 1e-11;
/// A parameter that changes all residuals by less than this part of what the others do has no effect.
const NO_EFFECT: f64 = 1e-9;
/// Component of an open direction from which on a parameter is open.
const TAKES_PART: f64 = 1e-3;

/// A direction in which the data do not change: by how much each parameter moves along it, that which moves most for
/// its effect by 1.
#[derive(Debug, Clone, PartialEq)]
pub struct Direction(pub Vec<f64>);

/// A linearised least-squares problem, with what stands in the way of its solution taken out.
#[derive(Debug)]
pub struct Inference<'d> {
    /// What was given.
    pub data: &'d Data,
    /// Constraints, own unknowns and open directions taken out.
    pub(crate) all: Elimination,
    /// `H`, with what is known beforehand, over the coordinates that are determined.
    pub(crate) hessian: DMatrix<f64>,
    /// Its inverse.
    pub(crate) inverse: DMatrix<f64>,
    /// Singular values of the sensitivities of the residuals, each parameter's scaled to a length of 1, the largest first;
    /// what constraints hold and what is known of runs alone is taken out.
    pub singular_values: Vec<f64>,
    /// Directions that the data leave open.
    pub directions: Vec<Direction>,
    /// For each parameter, whether it takes part in such a direction.
    pub flat: Vec<bool>,
    /// Unknowns of all kinds that the residuals determine.
    pub determined: usize,
    /// Diagonal of the information on each shared parameter, the others known.
    pub(crate) alone: DVector<f64>,
}

impl<'d> Inference<'d> {
    /// Of a problem.
    ///
    /// # Errors
    /// [`Obstacle::NotFinite`], and [`Obstacle::TooFew`] where nothing is left to tell the noise.
    pub fn new(data: &'d Data) -> Result<Self, Obstacle> {
        if !data.runs.iter().all(is_finite) {
            return Err(Obstacle::NotFinite);
        }
        let units = units(data);
        let all = Elimination::new(data, &units, true);
        let hessian = all.information() + all.prior.tr_mul(&all.prior);
        let d = hessian.nrows();
        let eigen = eigen(unit_diagonal(&hessian));
        let (open, known): (Vec<usize>, Vec<usize>) =
            (0..d).partition(|k| eigen.eigenvalues[*k] <= OPEN);
        let mut singular_values: Vec<f64> = eigen
            .eigenvalues
            .iter()
            .map(|own| own.max(0.0).sqrt())
            .collect();
        singular_values.sort_by(|a, b| b.total_cmp(a));
        let scale = DVector::from_iterator(d, hessian.diagonal().iter().map(|v| root(*v)));
        let of = |kept: &[usize]| {
            DMatrix::from_fn(d, kept.len(), |i, k| {
                scale[i] * eigen.eigenvectors[(i, kept[k])]
            })
        };
        let (open, known) = (of(&open), of(&known));
        let moved = &all.free * &open;
        let effects = DMatrix::from_fn(units.len(), moved.ncols(), |i, k| moved[(i, k)] / units[i]);
        let takes_part = |i: usize| effects.row(i).amax() > TAKES_PART * effects.amax();
        let all = all.within(&known);
        let own = all.runs.iter().map(|run| run.basis.ncols()).sum::<usize>();
        let determined = known.ncols() + own;
        let residuals = data.residuals() + data.prior.nrows();
        let residuals = residuals + data.runs.iter().map(|run| run.prior.len()).sum::<usize>();
        if residuals <= determined && !data.is_scaled {
            return Err(Obstacle::TooFew {
                residuals: data.residuals(),
                unknowns: determined,
            });
        }
        // In these coordinates the information is nearly the identity.
        let hessian = all.information() + all.prior.tr_mul(&all.prior);
        let inverse = (hessian.clone().cholesky())
            .ok_or(Obstacle::NotFinite)?
            .inverse();
        Ok(Self {
            data,
            singular_values,
            directions: directions(&effects, &units),
            flat: (0..units.len())
                .map(|i| moved.ncols() > 0 && takes_part(i))
                .collect(),
            alone: alone(data, &units),
            all,
            hessian,
            inverse,
            determined,
        })
    }

    /// `H⁻¹` over the shared parameters; zero where constraints hold them, without the open directions.
    pub fn inverse_information(&self) -> DMatrix<f64> {
        &self.all.free * &self.inverse * self.all.free.transpose()
    }

    /// `√(1/Hᵢᵢ)` of each shared parameter: by how much it may change, alone, before the residuals change by their
    /// standard deviation; infinite where it has no effect (the insensitivity of Tischler & Remple, *Aircraft and
    /// Rotorcraft System Identification*, 2nd ed., section 12.3).
    pub fn insensitivity(&self) -> Vec<f64> {
        self.alone
            .iter()
            .map(|h| self.noise().sqrt() / h.sqrt())
            .collect()
    }

    /// The Cramér–Rao bound `2 √(H⁻¹)ᵢᵢ` of each shared parameter; the factor is there for coloured residuals (Tischler
    /// & Remple, section 12.3). Infinite in open directions.
    pub fn cramer_rao(&self) -> Vec<f64> {
        let inverse = self.inverse_information();
        let bound = |i: usize| match self.flat[i] {
            true => f64::INFINITY,
            false => 2.0 * (self.noise() * inverse[(i, i)]).sqrt(),
        };
        (0..self.flat.len()).map(bound).collect()
    }

    /// Variance of the residuals, `Σ e²/(N - unknowns)`; 1 where the noise level is among the unknowns.
    pub fn noise(&self) -> f64 {
        if self.data.is_scaled {
            return 1.0;
        }
        let squares: f64 = self
            .data
            .runs
            .iter()
            .map(|run| run.residuals.norm_squared())
            .sum();
        squares / self.degrees()
    }

    /// Residuals beyond the unknowns, at least one.
    pub fn degrees(&self) -> f64 {
        (self.data.residuals() as f64 - self.determined as f64).max(1.0)
    }

    /// Where a step of Gauss and Newton takes the shared parameters when the residuals of each run change by these.
    ///
    /// # Panics
    /// Where these are not as many as the residuals.
    pub fn moved(&self, changes: &[DVector<f64>]) -> DVector<f64> {
        let runs = self.all.runs.iter().zip(changes);
        let score = runs.map(|(own, change)| own.projected.tr_mul(change));
        let zero = DVector::zeros(self.hessian.nrows());
        &self.all.free * (&self.inverse * score.fold(zero, |sum, own| sum + own))
    }

    /// Own unknowns of a run that its residuals do not tell.
    pub fn own_flat(&self, run: usize) -> &[bool] {
        &self.all.runs[run].flat
    }
}

fn is_finite(run: &Run) -> bool {
    let all = run
        .shared
        .iter()
        .chain(&run.own)
        .chain(&run.residuals)
        .chain(&run.active);
    all.copied().all(f64::is_finite)
}

/// Changes of each parameter that change the residuals by one, all together; the scale of one that has no effect.
fn units(data: &Data) -> DVector<f64> {
    let squares = sums(data, |run| &run.shared);
    let effects = squares.map(f64::sqrt).component_mul(&data.scales);
    let least = NO_EFFECT * effects.iter().copied().fold(0.0, f64::max);
    DVector::from_fn(squares.len(), |i, _| match effects[i] > least {
        true => 1.0 / squares[i].sqrt(),
        false => data.scales[i],
    })
}

/// Sums of squares of each column, with what is known beforehand.
fn sums(data: &Data, of: impl Fn(&Run) -> &DMatrix<f64>) -> DVector<f64> {
    let column = |i: usize| {
        let runs: f64 = data
            .runs
            .iter()
            .map(|run| of(run).column(i).norm_squared())
            .sum();
        runs + data.prior.column(i).norm_squared()
    };
    DVector::from_fn(data.parameters(), |i, _| column(i))
}

/// Information on each parameter where the other shared ones are known, and the runs' own unknowns are not.
fn alone(data: &Data, units: &DVector<f64>) -> DVector<f64> {
    let all = Elimination::new(data, units, false);
    let information = all.information() + all.prior.tr_mul(&all.prior);
    DVector::from_fn(units.len(), |i, _| information[(i, i)] / units[i].powi(2))
}

fn root(diagonal: f64) -> f64 {
    if diagonal > 0.0 {
        1.0 / diagonal.sqrt()
    } else {
        1.0
    }
}

fn unit_diagonal(matrix: &DMatrix<f64>) -> DMatrix<f64> {
    let root = matrix.diagonal().map(root);
    DMatrix::from_fn(matrix.nrows(), matrix.ncols(), |i, j| {
        root[i] * matrix[(i, j)] * root[j]
    })
}

/// Eigenvalues and eigenvectors, of a matrix without rows too.
fn eigen(matrix: DMatrix<f64>) -> SymmetricEigen<f64, Dyn> {
    match matrix.is_empty() {
        true => SymmetricEigen {
            eigenvalues: DVector::zeros(0),
            eigenvectors: matrix,
        },
        false => SymmetricEigen::new(matrix),
    }
}

/// Open directions from their effects on each parameter in its unit: reduced to few parameters each, as the rows of an
/// echelon form.
fn directions(effects: &DMatrix<f64>, units: &DVector<f64>) -> Vec<Direction> {
    let mut columns = effects.clone();
    let mut found = Vec::new();
    for k in 0..columns.ncols() {
        let mut best = (0, k);
        for j in k..columns.ncols() {
            let (row, _) = columns.column(j).argmax_abs();
            if columns[(row, j)].abs() > columns[best].abs() {
                best = (row, j);
            }
        }
        columns.swap_columns(k, best.1);
        let pivot = columns.column(k).into_owned() / columns[(best.0, k)];
        for j in (0..columns.ncols()).filter(|j| *j != k) {
            let along = columns[(best.0, j)];
            columns.column_mut(j).axpy(-along, &pivot, 1.0);
        }
        columns.set_column(k, &pivot);
        found.push(best.0);
    }
    let direction = |(k, first): (usize, usize)| {
        let column = columns.column(k);
        let largest = column.amax();
        let moved = |i: usize| match column[i].abs() > TAKES_PART * largest {
            true => column[i] * units[i] / units[first],
            false => 0.0,
        };
        Direction((0..units.len()).map(moved).collect())
    };
    found.into_iter().enumerate().map(direction).collect()
}

/// Which entry of a column has the largest magnitude.
trait LargestEntry {
    fn argmax_abs(&self) -> (usize, f64);
}

impl<S: nalgebra::Storage<f64, nalgebra::Dyn>> LargestEntry
    for nalgebra::Vector<f64, nalgebra::Dyn, S>
{
    fn argmax_abs(&self) -> (usize, f64) {
        let entries = self.iter().map(|v| v.abs()).enumerate();
        entries.fold(
            (0, 0.0),
            |best, own| if own.1 > best.1 { own } else { best },
        )
    }
}
