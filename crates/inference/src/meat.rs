//! Covariance of the score `Σ J_gᵀ e_g`, by a model of the noise or from the runs' own scores.

use crate::autoregression::{Autoregression, Segment};
use crate::inference::{Inference, Obstacle};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use std::ops::Range;

/// Autocorrelations are summed up to the run's length divided by this (Morelli & Klein, *Aircraft System
/// Identification*, 2nd ed., section 5.6).
const LAGS: usize = 5;
/// Part of a column that counts as rounding.
const ROUNDING: f64 = 1e-8;
/// Minimum eigenvalue of the information without one run, relative to that of all runs.
const LEAST_EIGENVALUE: f64 = 1e-8;

/// The noise of each signal.
pub type Processes = Vec<Autoregression>;

impl Inference<'_> {
    /// White noise of one variance.
    pub(crate) fn white(&self) -> Processes {
        let mut process = Autoregression::new(&[]);
        process.variance = self.noise();
        vec![process; self.signals()]
    }

    /// An autoregressive process for each signal, in standard deviations times the square root of the weight, as
    /// residuals are.
    pub fn coloured(&self) -> Processes {
        let all = self.all.runs.iter().enumerate();
        let all: Vec<_> = all.map(|(j, own)| (j, [&own.basis, &own.shared])).collect();
        self.coloured_beside(&all)
    }

    /// The same from these runs, beside other effects of each run's own unknowns and of shared ones.
    pub(crate) fn coloured_beside(&self, effects: &[(usize, [&DMatrix<f64>; 2])]) -> Processes {
        let of_signal = |k: usize| {
            let segments = effects.iter().filter_map(|(j, [own, shared])| {
                let run = &self.data.runs[*j];
                let range = run.signals[k].clone();
                let part = |matrix: &DMatrix<f64>| part_of(matrix, &range);
                let residuals =
                    DMatrix::from_columns(&[run.residuals.rows(range.start, range.len())]);
                let columns = [part(own), part(shared), residuals];
                let columns: Vec<DVector<f64>> = columns
                    .iter()
                    .flat_map(|all| all.column_iter().map(|own| own.into_owned()))
                    .collect();
                (!range.is_empty()).then(|| Segment {
                    own: own.ncols(),
                    time: run.time[range].to_vec(),
                    rows: DMatrix::from_columns(&columns),
                })
            });
            let segments: Vec<Segment> = segments.collect();
            match segments.is_empty() {
                true => Autoregression::new(&[]),
                false => Autoregression::estimated(&segments),
            }
        };
        let signals = (0..self.signals()).into_par_iter();
        signals.map(of_signal).collect()
    }

    fn signals(&self) -> usize {
        self.data.runs.first().map_or(0, |run| run.signals.len())
    }

    /// `C` with `CᵀC = JᵀΣJ`, for rows `J` of a run.
    pub(crate) fn coloured_rows(
        &self,
        run: usize,
        rows: &DMatrix<f64>,
        processes: &[Autoregression],
    ) -> DMatrix<f64> {
        let run = &self.data.runs[run];
        let mut out = rows.clone();
        for (process, range) in processes.iter().zip(&run.signals) {
            let own = rows.rows(range.start, range.len()).into_owned();
            out.rows_mut(range.start, range.len())
                .copy_from(&process.coloured(&own, &run.time[range.clone()]));
        }
        out
    }

    /// A run's contribution to the covariance of the score by these processes.
    pub(crate) fn run_meat(&self, run: usize, processes: &[Autoregression]) -> DMatrix<f64> {
        let coloured = self.coloured_rows(run, &self.all.runs[run].projected, processes);
        coloured.tr_mul(&coloured)
    }

    /// Covariance of the score by these processes.
    pub(crate) fn meat(&self, processes: &[Autoregression]) -> DMatrix<f64> {
        let runs = (0..self.all.runs.len()).map(|run| self.run_meat(run, processes));
        runs.fold(self.prior_meat(), |sum, own| sum + own)
    }

    /// Contribution of the prior on the shared parameters.
    fn prior_meat(&self) -> DMatrix<f64> {
        self.all.prior.tr_mul(&self.all.prior)
    }

    /// `Σ_g Σ_ij J_iᵀ R(i - j) J_j` with the residuals' autocorrelations R up to a fifth of each run; not always
    /// positive.
    pub(crate) fn sidpac_meat(&self) -> DMatrix<f64> {
        let mut sum = self.prior_meat();
        for k in 0..self.signals() {
            let correlations = self.correlations(k);
            for (run, own) in self.data.runs.iter().zip(&self.all.runs) {
                let range = run.signals[k].clone();
                sum += correlated(&own.projected, range, &correlations);
            }
        }
        for (run, own) in self.data.runs.iter().zip(&self.all.runs) {
            let prior = own.projected.rows(run.prior.start, run.prior.len());
            sum += prior.tr_mul(&prior);
        }
        sum
    }

    /// Autocorrelations of a signal's residuals over all runs, each sum divided by the number of values.
    fn correlations(&self, signal: usize) -> Vec<f64> {
        let ranges = || {
            self.data
                .runs
                .iter()
                .map(|run| (run, run.signals[signal].clone()))
        };
        let longest = ranges().map(|(_, range)| range.len()).max().unwrap_or(0);
        let count: usize = ranges().map(|(_, range)| range.len()).sum();
        let lag = |k: usize| {
            let products = ranges().flat_map(|(run, range)| {
                let range = range.start + k.min(range.len())..range.end;
                range.map(move |t| run.residuals[t] * run.residuals[t - k])
            });
            products.sum::<f64>() / count.max(1) as f64
        };
        (0..=longest / LAGS).map(lag).collect()
    }

    /// Jackknife covariance over the determined coordinates, leaving out one run at a time: `(G-1)/G Σ δ_g δ_gᵀ` with
    /// `δ_g = (H - H_g)⁻¹ J_gᵀ e_g` (CR3: Bell & McCaffrey, Surv. Methodol. 28, 2002; MacKinnon, Nielsen & Webb, J.
    /// Appl. Econom. 38, 2023).
    pub(crate) fn jackknife(&self) -> Result<DMatrix<f64>, Obstacle> {
        let runs = self.all.runs.len() as f64;
        if runs < 2.0 {
            return Err(Obstacle::FewRuns);
        }
        if self.hessian.is_empty() {
            return Ok(self.hessian.clone());
        }
        let mut sum = DMatrix::zeros(self.hessian.nrows(), self.hessian.nrows());
        for (run, own) in self.data.runs.iter().zip(&self.all.runs) {
            let rest = &self.hessian - own.information();
            let least = rest
                .symmetric_eigenvalues()
                .iter()
                .copied()
                .fold(1.0, f64::min);
            let factor = rest.cholesky().filter(|_| least > LEAST_EIGENVALUE);
            let factor = factor.ok_or(Obstacle::FewRuns)?;
            let moved = factor.solve(&own.projected.tr_mul(&run.residuals));
            sum += &moved * moved.transpose();
        }
        Ok(sum * ((runs - 1.0) / runs) + self.sandwiched(&self.prior_meat()))
    }

    /// `H⁻¹ M H⁻¹`.
    pub(crate) fn sandwiched(&self, meat: &DMatrix<f64>) -> DMatrix<f64> {
        &self.inverse * meat * &self.inverse
    }
}

/// The rows of a signal. A column that is only rounding there is set to zero: a noise level does not change a location,
/// and the rounding may be the residuals themselves, which the fit would then seem to have followed.
fn part_of(matrix: &DMatrix<f64>, range: &Range<usize>) -> DMatrix<f64> {
    let mut part = matrix.rows(range.start, range.len()).into_owned();
    for (k, mut column) in part.column_iter_mut().enumerate() {
        if column.norm() <= ROUNDING * matrix.column(k).norm() {
            column.fill(0.0);
        }
    }
    part
}

/// `Σ_ij J_iᵀ R(i - j) J_j` over a range of rows.
fn correlated(rows: &DMatrix<f64>, range: Range<usize>, correlations: &[f64]) -> DMatrix<f64> {
    let (n, own) = (range.len(), rows.rows(range.start, range.len()));
    let mut out = own.tr_mul(&own) * correlations[0];
    for (lag, r) in correlations.iter().enumerate().take(n / LAGS + 1).skip(1) {
        let product = own.rows(lag, n - lag).tr_mul(&own.rows(0, n - lag));
        out += *r * (&product + product.transpose());
    }
    out
}
