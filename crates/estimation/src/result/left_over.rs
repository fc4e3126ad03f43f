//! Structure left in the residuals of a fit: their autocorrelation, and their correlation with the inputs.

use crate::posed::Posed;
use crate::posed::data::filled;
use crate::problem::file::{Measured, Noise};
use crate::result::uncertainty::signal_of;
use crate::result::{Beside, Fit, RunFit};
use nalgebra::DMatrix;
use pilotage_inference::crossed::{Crossed, Pair};
use pilotage_inference::residuals::Explained;
use pilotage_inference::{Autoregression, Data, Run};
use rayon::prelude::*;

/// Residuals of a signal in a run at recorded samples, in standard deviations, and their times \[s\].
fn known(run: &RunFit, k: usize, noise: Noise) -> (Vec<f64>, Vec<f64>) {
    let residuals = run.residuals(k, noise).into_iter().zip(&run.time);
    residuals.filter(|(e, _)| e.is_finite()).unzip()
}

/// The autoregressive process of the residuals of each measured signal. None if nothing was recorded, if the states
/// found do not satisfy the equations, or if a filter predicts the next sample.
pub fn processes(posed: &Posed<'_>, fit: &Fit) -> Vec<Option<Autoregression>> {
    let measured = posed.file.measured.par_iter().enumerate();
    let process = |(k, own): (usize, &Measured)| {
        let series = fit.runs.iter().map(|run| known(run, k, own.noise));
        let series: Vec<_> = series.filter(|(values, _)| !values.is_empty()).collect();
        let is_defined = fit.is_met() && posed.filter.is_none() && !series.is_empty();
        is_defined.then(|| Autoregression::of_series(&series))
    };
    measured.map(process).collect()
}

impl RunFit {
    /// Variance of a measured signal explained one step ahead: by the model and the process's prediction from the
    /// residuals up to the previous sample. For a model with noise only on the recording this is its best prediction,
    /// and no better than the simulation if residuals are white.
    pub fn one_step(&self, k: usize, noise: Noise, process: &Autoregression) -> Option<Explained> {
        let (residuals, time) = known(self, k, noise);
        let mut expected = process.one_step(&residuals, &time).into_iter();
        let samples = self.residuals(k, noise).into_iter();
        let predicted = samples.enumerate().map(|(sample, residual)| {
            let (h, sd) = (self.predicted[k][sample], self.deviations[k][sample]);
            let next = if residual.is_finite() {
                expected.next()
            } else {
                None
            };
            match (next, noise) {
                (None, _) => h,
                (Some(e), Noise::LogNormal) => h * (sd * e).exp(),
                (Some(e), _) => h + sd * e,
            }
        });
        Explained::of(&self.recorded[k], &predicted.collect::<Vec<_>>())
    }
}

/// Correlation of the residuals of each measured signal with each column that drives an input, over all fitted runs.
/// Unevenly sampled residuals and inputs that do not vary within runs are left out. `data` holds the same residuals
/// with their derivatives, if known.
pub(crate) fn beside_inputs(
    posed: &Posed<'_>,
    runs: &[RunFit],
    data: Option<&Data>,
) -> Vec<Beside> {
    let mut columns: Vec<&str> = posed
        .file
        .inputs
        .iter()
        .map(|fed| &fed.column.value[..])
        .collect();
    columns.sort_unstable();
    columns.dedup();
    let beside = |(k, column): (usize, &str)| {
        let measured = &posed.file.measured[k];
        let all = posed.data.iter().zip(runs).enumerate();
        let pairs = all.map(|(j, (own, run))| {
            let series = &own.series;
            let input = series
                .column(column)
                .map(|own| filled(&series.time, &own.values));
            let own = data.and_then(|data| data.runs.get(j));
            let (left, gradients) = own
                .and_then(|own| linearised(own, signal_of(posed, k)?, posed.origins[j]))
                .unwrap_or_else(|| (known(run, k, measured.noise), Default::default()));
            Pair {
                gradients,
                ..pair(left, (&series.time, input.as_deref()))
            }
        });
        let pairs: Vec<Pair> = pairs.collect();
        Crossed::of(&pairs).map(|crossed| Beside {
            measured: measured.column.value.clone(),
            input: column.to_owned(),
            crossed,
        })
    };
    let measured = 0..posed.file.measured.len();
    let pairs = measured.flat_map(|k| columns.iter().map(move |column| (k, *column)));
    let pairs: Vec<(usize, &str)> = pairs.collect();
    pairs.into_par_iter().filter_map(beside).collect()
}

/// Values and their times \[s\].
type Timed = (Vec<f64>, Vec<f64>);

/// Residuals of a signal in a run whose times begin at this origin in its file, and their derivatives with respect to the shared
/// unknowns and the run's own.
fn linearised(run: &Run, signal: usize, origin: f64) -> Option<(Timed, [DMatrix<f64>; 2])> {
    let rows = run.signals.get(signal)?.clone();
    let left = run.residuals.rows(rows.start, rows.len());
    let gradients = [&run.shared, &run.own].map(|of| of.rows(rows.start, rows.len()).into_owned());
    let time = run.time[rows].iter().map(|time| time + origin).collect();
    let timed = (left.iter().copied().collect(), time);
    Some((timed, gradients))
}

/// Residuals with the input at their times.
fn pair((residuals, time): Timed, (times, input): (&[f64], Option<&[f64]>)) -> Pair {
    let at = |t: &f64| {
        let row = times.partition_point(|own| own < t);
        input
            .and_then(|input| input.get(row))
            .copied()
            .unwrap_or(0.0)
    };
    Pair {
        input: time.iter().map(at).collect(),
        residuals,
        time,
        gradients: Default::default(),
    }
}
