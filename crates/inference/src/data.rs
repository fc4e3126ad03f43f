//! Residuals and their Jacobian, per run.

use crate::residuals::is_even;
use nalgebra::{DMatrix, DVector};
use std::ops::Range;

/// One run of a linearised least-squares problem at its solution.
#[derive(Debug, Clone)]
pub struct Run {
    /// Derivatives of the predictions with respect to the shared parameters, one row per residual.
    pub shared: DMatrix<f64>,
    /// The same with respect to the run's own unknowns.
    pub own: DMatrix<f64>,
    /// Typical magnitudes of the run's own unknowns, as [`Data::scales`].
    pub own_scales: DVector<f64>,
    /// Observed minus predicted, in standard deviations, times the square root of the weight.
    pub residuals: DVector<f64>,
    /// Time of each residual \[s\].
    pub time: Vec<f64>,
    /// Rows of each signal, in order of time; every run has the same signals.
    pub signals: Vec<Range<usize>>,
    /// Rows of the prior on the run's own unknowns, with unit variance.
    pub prior: Range<usize>,
    /// Gradients of active constraints over `[shared; own]`, one per row.
    pub active: DMatrix<f64>,
}

impl Run {
    /// A run without own unknowns, with one signal whose samples are one second apart.
    ///
    /// # Panics
    /// If there is not one residual for each row.
    pub fn of(shared: DMatrix<f64>, residuals: DVector<f64>) -> Self {
        let (n, p) = shared.shape();
        assert_eq!(residuals.len(), n, "a residual for each row");
        Self {
            own: DMatrix::zeros(n, 0),
            own_scales: DVector::zeros(0),
            time: (0..n).map(|t| t as f64).collect(),
            signals: std::iter::once(0..n).collect(),
            prior: n..n,
            active: DMatrix::zeros(0, p),
            shared,
            residuals,
        }
    }
}

/// A least-squares problem at its solution.
#[derive(Debug, Clone)]
pub struct Data {
    /// The runs; they share no noise.
    pub runs: Vec<Run>,
    /// Rows of the prior on the shared parameters, each a gradient over its standard deviation.
    pub prior: DMatrix<f64>,
    /// Their residuals, in standard deviations; empty if they are not known.
    pub prior_residuals: Vec<f64>,
    /// Gradients of active constraints on the shared parameters, one per row.
    pub active: DMatrix<f64>,
    /// Typical magnitudes of the shared parameters; a parameter that changes nothing by this much has no effect.
    pub scales: DVector<f64>,
    /// Whether the noise level is among the unknowns, so that residuals have unit variance.
    pub is_scaled: bool,
    /// The signals that are no residuals but terms of the noise level, in all runs.
    pub levels: Vec<usize>,
}

impl Data {
    /// Runs only: no prior, no active constraint, parameters of the order of one.
    ///
    /// # Panics
    /// If there are no runs.
    pub fn of(runs: Vec<Run>) -> Self {
        let p = runs[0].shared.ncols();
        Self {
            runs,
            prior: DMatrix::zeros(0, p),
            prior_residuals: Vec::new(),
            active: DMatrix::zeros(0, p),
            scales: DVector::from_element(p, 1.0),
            is_scaled: false,
            levels: Vec::new(),
        }
    }

    /// Whether the samples of each signal are evenly spaced, with the same distance in all runs.
    pub fn is_even(&self) -> bool {
        let signals = self.runs.first().map_or(0, |run| run.signals.len());
        let times = |k: usize| {
            self.runs
                .iter()
                .map(move |run| &run.time[run.signals[k].clone()])
        };
        (0..signals).all(|k| is_even(times(k)))
    }

    /// Number of shared parameters.
    pub fn parameters(&self) -> usize {
        self.scales.len()
    }

    /// Number of residuals of all runs, without priors.
    pub fn residuals(&self) -> usize {
        self.rows().map(|(_, rows)| rows.len()).sum()
    }

    /// Each run with the rows of each of its signals, without those of noise levels.
    pub(crate) fn rows(&self) -> impl Iterator<Item = (&Run, Range<usize>)> {
        let of = |run: &'_ Run| {
            let signals = run.signals.iter().enumerate();
            let own = signals.filter(|(k, _)| !self.levels.contains(k));
            own.map(|(_, rows)| rows.clone()).collect::<Vec<_>>()
        };
        let all = self.runs.iter();
        all.flat_map(move |run| of(run).into_iter().map(move |rows| (run, rows)))
    }
}
