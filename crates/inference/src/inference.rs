//! Information of the data about the parameters, and the directions that they leave undetermined.

use crate::data::{Data, Run};
use crate::elimination::{Eliminated, Elimination, change_by_one};
use crate::open::Open;
use nalgebra::{DMatrix, DVector, Dyn, SymmetricEigen};
use std::ops::Range;

/// Reason why there is no covariance.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum Obstacle {
    /// There are no more residuals than unknowns.
    #[error("{residuals} measured values do not determine {unknowns} unknowns and the noise")]
    TooFew {
        /// Number of residuals of all runs.
        residuals: usize,
        /// Number of unknowns that they determine.
        unknowns: usize,
    },
    /// A derivative or a residual is not finite.
    #[error("a derivative or a residual at the solution is no finite number")]
    NotFinite,
    /// The jackknife has too few runs, or a parameter is determined by one run alone.
    #[error("cr3 asks for two runs or more that determine all parameters without any one of them")]
    FewRuns,
    /// A variance is negative, which is possible for sums over a part of the lags.
    #[error("the variance of a parameter came out negative, as this estimate may; take another")]
    Negative,
}

/// Eigenvalue of the information, scaled to a unit diagonal, below which a direction is undetermined.
const OPEN: f64 = 1e-11;
/// Part of its squared effect up to which what own unknowns leave of a parameter's is rounding.
const BALANCED: f64 = 1e-16;
/// Minimum component of an undetermined direction for a parameter to be undetermined.
const TAKES_PART: f64 = 1e-3;

/// A direction in which the predictions do not change: the change of each parameter along it, scaled so that the one
/// with the largest change relative to its effect changes by 1.
#[derive(Debug, Clone, PartialEq)]
pub struct Direction(pub Vec<f64>);

/// What the data leave open of a run.
#[derive(Debug)]
struct OwnOpen {
    open: Open,
    /// For each of its own unknowns, whether it takes part.
    flat: Vec<bool>,
}

/// A linearised least-squares problem in which constraints, own unknowns and undetermined directions are eliminated.
#[derive(Debug)]
pub struct Inference<'d> {
    /// The problem.
    pub data: &'d Data,
    /// The elimination of constraints, own unknowns and undetermined directions.
    pub(crate) all: Elimination,
    /// `H`, including priors, over the determined coordinates.
    pub(crate) hessian: DMatrix<f64>,
    /// Its inverse.
    pub(crate) inverse: DMatrix<f64>,
    /// Singular values of the residuals' sensitivities, each parameter's scaled to length 1, the largest first, with
    /// constraints and the runs' own unknowns eliminated.
    pub singular_values: Vec<f64>,
    /// Directions that the data leave undetermined.
    pub directions: Vec<Direction>,
    /// For each parameter, whether it takes part in such a direction.
    pub flat: Vec<bool>,
    /// The same directions over the shared parameters.
    pub open: Open,
    /// For each run, they and the run's own over shared parameters and own unknowns.
    own_open: Vec<OwnOpen>,
    /// Number of unknowns of all kinds that the residuals determine.
    pub determined: usize,
    /// Information on each shared parameter if the others are known.
    pub(crate) alone: DVector<f64>,
}

impl<'d> Inference<'d> {
    /// Analyses a problem.
    ///
    /// # Errors
    /// [`Obstacle::NotFinite`], and [`Obstacle::TooFew`] if no degrees of freedom are left to estimate the noise.
    pub fn new(data: &'d Data) -> Result<Self, Obstacle> {
        if !data.runs.iter().all(is_finite) {
            return Err(Obstacle::NotFinite);
        }
        let units = units(data);
        let all = Elimination::new(data, &units, true);
        let hessian = all.information() + all.prior.tr_mul(&all.prior);
        let d = hessian.nrows();
        let scale = unit_scales(&hessian, &all);
        let eigen = eigen(DMatrix::from_fn(d, d, |i, j| {
            scale[i] * hessian[(i, j)] * scale[j]
        }));
        let (open, known): (Vec<usize>, Vec<usize>) =
            (0..d).partition(|k| eigen.eigenvalues[*k] <= OPEN);
        let mut singular_values: Vec<f64> = eigen
            .eigenvalues
            .iter()
            .map(|own| own.max(0.0).sqrt())
            .collect();
        singular_values.sort_by(|a, b| b.total_cmp(a));
        let of = |kept: &[usize]| {
            DMatrix::from_fn(d, kept.len(), |i, k| {
                scale[i] * eigen.eigenvectors[(i, kept[k])]
            })
        };
        let (open, known) = (of(&open), of(&known));
        let moved = &all.free * &open;
        let effects = by_row(&moved, &units);
        let own_open = (data.runs.iter().zip(&all.runs))
            .map(|(run, own)| OwnOpen::new((&moved, &effects), (&open, own), (data, run)))
            .collect();
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
        // In these coordinates the information is close to the identity.
        let hessian = all.information() + all.prior.tr_mul(&all.prior);
        let inverse = (hessian.clone().cholesky())
            .ok_or(Obstacle::NotFinite)?
            .inverse();
        Ok(Self {
            data,
            singular_values,
            directions: directions(&effects, &units),
            flat: taking_part(&effects, effects.amax()),
            open: Open::new(&moved, &data.scales),
            own_open,
            alone: alone(data, &units),
            all,
            hessian,
            inverse,
            determined,
        })
    }

    /// `H⁻¹` over the shared parameters; zero for those fixed by constraints, without the undetermined directions.
    pub fn inverse_information(&self) -> DMatrix<f64> {
        &self.all.free * &self.inverse * self.all.free.transpose()
    }

    /// `√(1/Hᵢᵢ)` of each shared parameter: how much it alone may change before the residuals change by their standard
    /// deviation; infinite if it has no effect (the insensitivity of Tischler & Remple, *Aircraft and Rotorcraft System
    /// Identification*, 2nd ed., section 12.3).
    pub fn insensitivity(&self) -> Vec<f64> {
        self.alone
            .iter()
            .map(|h| self.noise().sqrt() / h.sqrt())
            .collect()
    }

    /// The Cramér–Rao bound `2 √(H⁻¹)ᵢᵢ` of each shared parameter; the factor accounts for coloured residuals (Tischler
    /// & Remple, section 12.3). Infinite in undetermined directions.
    pub fn cramer_rao(&self) -> Vec<f64> {
        let inverse = self.inverse_information();
        let bound = |i: usize| match self.flat[i] {
            true => f64::INFINITY,
            false => 2.0 * (self.noise() * inverse[(i, i)]).sqrt(),
        };
        (0..self.flat.len()).map(bound).collect()
    }

    /// Variance of the residuals, `Σ e²/(N - unknowns)`. If the noise level is among the unknowns, `Σ e²` is N, since its
    /// maximum likelihood estimate does not count them. 1 for the innovations of a filter.
    pub fn noise(&self) -> f64 {
        match (self.data.is_scaled, self.data.levels.is_empty()) {
            (true, true) => return 1.0,
            (true, false) => return self.data.residuals() as f64 / self.degrees(),
            (false, _) => {}
        }
        let squares =
            |(run, rows): (&Run, Range<usize>)| run.residuals.rows_range(rows).norm_squared();
        let priors = self.data.runs.iter().map(|run| (run, run.prior.clone()));
        let all = self.data.rows().chain(priors);
        all.map(squares).sum::<f64>() / self.degrees()
    }

    /// Residuals minus unknowns, at least one.
    pub fn degrees(&self) -> f64 {
        (self.data.residuals() as f64 - self.determined as f64).max(1.0)
    }

    /// Gauss–Newton step of the shared parameters for these changes of each run's residuals.
    ///
    /// # Panics
    /// If the number of changes differs from that of the residuals.
    pub fn moved(&self, changes: &[DVector<f64>]) -> DVector<f64> {
        let runs = self.all.runs.iter().zip(changes);
        let score = runs.map(|(own, change)| own.projected.tr_mul(change));
        let zero = DVector::zeros(self.hessian.nrows());
        &self.all.free * (&self.inverse * score.fold(zero, |sum, own| sum + own))
    }

    /// Relative offset of the residuals from those at an optimum: the length of the Gauss–Newton step of all unknowns, in
    /// standard deviations of white noise, over the square root of their number (Bates & Watts, Technometrics 23, 1981). NaN
    /// if residuals of priors are not known.
    pub fn offset(&self) -> f64 {
        if self.data.prior.nrows() != self.data.prior_residuals.len() {
            return f64::NAN;
        }
        let runs = || self.all.runs.iter().zip(&self.data.runs);
        let own = runs().map(|(own, run)| own.basis.tr_mul(&run.residuals).norm_squared());
        let scores = runs().map(|(own, run)| own.projected.tr_mul(&run.residuals));
        let priors = DVector::from_column_slice(&self.data.prior_residuals);
        let score = scores.fold(self.all.prior.tr_mul(&priors), |sum, own| sum + own);
        let shared = score.dot(&(&self.inverse * &score));
        ((own.sum::<f64>() + shared) / (self.determined as f64 * self.noise())).sqrt()
    }

    /// Own unknowns of a run that the residuals do not determine.
    pub fn own_flat(&self, run: usize) -> &[bool] {
        &self.own_open[run].flat
    }

    /// Directions that the data leave undetermined, over the shared parameters and a run's own unknowns.
    pub fn open_with(&self, run: usize) -> &Open {
        &self.own_open[run].open
    }
}

impl OwnOpen {
    /// From the open directions over the shared parameters (`moved`, in their units `effects`) and over the coordinates of an
    /// elimination. The run's own unknowns follow them such that its residuals stay.
    fn new(
        (moved, effects): (&DMatrix<f64>, &DMatrix<f64>),
        (open, own): (&DMatrix<f64>, &Eliminated),
        (data, run): (&Data, &Run),
    ) -> Self {
        let (p, m) = (moved.nrows(), own.flat.len());
        let follow = (&own.follows - &own.inverse * &own.shared) * open;
        let in_units = by_row(&follow, &own.units);
        let follows = taking_part(&in_units, effects.amax().max(in_units.amax()));
        let alone: Vec<usize> = (0..m).filter(|k| own.flat[*k]).collect();
        let (first, count) = (moved.ncols(), alone.len());
        let mut columns = DMatrix::zeros(p + m, first + count);
        columns.view_mut((0, 0), moved.shape()).copy_from(moved);
        columns.view_mut((p, 0), follow.shape()).copy_from(&follow);
        for (place, k) in alone.iter().enumerate() {
            let column = own.open.column(*k).component_mul(&own.units);
            columns
                .view_mut((p, first + place), (m, 1))
                .copy_from(&column);
        }
        let scales = data.scales.iter().chain(run.own_scales.iter()).copied();
        let scales = DVector::from_iterator(p + m, scales);
        Self {
            open: Open::new(&columns, &scales),
            flat: (own.flat.iter().zip(follows))
                .map(|(own, by)| *own || by)
                .collect(),
        }
    }
}

/// Each row over its unit.
fn by_row(matrix: &DMatrix<f64>, units: &DVector<f64>) -> DMatrix<f64> {
    DMatrix::from_fn(matrix.nrows(), matrix.ncols(), |i, k| {
        matrix[(i, k)] / units[i]
    })
}

/// The unknowns with a part in open directions, of which this is the largest one.
fn taking_part(effects: &DMatrix<f64>, largest: f64) -> Vec<bool> {
    let rows = effects.row_iter();
    rows.map(|row| row.iter().any(|own| own.abs() > TAKES_PART * largest))
        .collect()
}

/// Whether all numbers are finite, and their squares, which are summed.
fn is_finite(run: &Run) -> bool {
    let matrices = [&run.shared, &run.own, &run.active];
    let all = matrices.iter().map(|own| own.norm_squared());
    let mut all = all.chain([run.residuals.norm_squared()]);
    all.all(f64::is_finite)
}

/// Change of each parameter that changes all residuals together by one; the scale of a parameter without effect.
fn units(data: &Data) -> DVector<f64> {
    let squares = sums(data, |run| &run.shared);
    let effects: Vec<f64> = squares.iter().map(|own| own.sqrt()).collect();
    change_by_one(&effects, &data.scales)
}

/// Sum of squares of each column, including priors.
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

/// Information on each parameter if the other shared parameters are known but the runs' own unknowns are not.
fn alone(data: &Data, units: &DVector<f64>) -> DVector<f64> {
    let all = Elimination::new(data, units, false);
    let information = all.information() + all.prior.tr_mul(&all.prior);
    DVector::from_fn(units.len(), |i, _| information[(i, i)] / units[i].powi(2))
}

/// Scales with which the information has a unit diagonal; 1 for a coordinate whose whole effect own unknowns balance.
fn unit_scales(hessian: &DMatrix<f64>, all: &Elimination) -> DVector<f64> {
    let whole = |k: usize| {
        let runs = all
            .runs
            .iter()
            .map(|run| run.shared.column(k).norm_squared());
        runs.sum::<f64>() + all.prior.column(k).norm_squared()
    };
    let scale = |k: usize| match hessian[(k, k)] > BALANCED * whole(k) {
        true => 1.0 / hessian[(k, k)].sqrt(),
        false => 1.0,
    };
    DVector::from_fn(hessian.nrows(), |k, _| scale(k))
}

/// Eigenvalues and eigenvectors, also of an empty matrix.
fn eigen(matrix: DMatrix<f64>) -> SymmetricEigen<f64, Dyn> {
    match matrix.is_empty() {
        true => SymmetricEigen {
            eigenvalues: DVector::zeros(0),
            eigenvectors: matrix,
        },
        false => SymmetricEigen::new(matrix),
    }
}

/// Undetermined directions from their effects on each parameter in its unit, reduced to few parameters each like the
/// rows of an echelon form.
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

/// Index of the entry with the largest magnitude.
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
