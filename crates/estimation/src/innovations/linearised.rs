//! A solution as a least-squares problem: innovations and their variances as rows.

use super::Predicted;
use super::likelihood::RunRows;
use crate::posed::Posed;
use crate::search::solved::Linearised;
use nalgebra::{DMatrix, DVector, RowDVector};
use pilotage_collocation::{Sensitivities, Sensitivity};
use pilotage_inference::{Data, Run};
use std::ops::Range;

/// The least-squares problem of a solution. Its rows are those of Fisher scoring, with unit variance if the model is
/// correct.
pub(crate) fn linearised(posed: &Posed<'_>, at: &Predicted<'_>) -> Linearised {
    let likelihood = &at.program.likelihood;
    let unknowns = at.unknowns();
    let (parameters, active) = active(posed, at, &unknowns);
    let own = likelihood.own();
    let (mut runs, mut shared_priors) = (Vec::new(), Vec::new());
    for (j, rows) in likelihood.rows(&unknowns).into_iter().enumerate() {
        let width = posed.shared + own[j].len();
        let mut all = Rows::new(width);
        let weight = likelihood.weight(j).sqrt();
        let signals = all.add_signals(&rows, posed.quantities.predicted.len(), weight);
        let first = all.residuals.len();
        for term in likelihood.priors(&unknowns) {
            let mut row = RowDVector::zeros(width);
            if own[j].contains(&term.place) {
                row[posed.shared + term.place - own[j].start] = term.slope;
                all.add(row, -term.residual);
            } else if j == 0 && term.place < posed.shared {
                row[term.place] = term.slope;
                shared_priors.push(row.columns(0, posed.shared).into_owned());
            }
        }
        let prior = first..all.residuals.len();
        runs.push(all.run(posed.shared, signals, prior, &active.runs[j]));
    }
    let prior = match shared_priors.is_empty() {
        true => DMatrix::zeros(0, posed.shared),
        false => DMatrix::from_rows(&shared_priors),
    };
    let data = Data {
        runs,
        prior,
        prior_residuals: Vec::new(),
        active: parameters,
        scales: DVector::from_column_slice(&at.program.scales[..posed.shared]),
        is_scaled: true,
        levels: Vec::new(),
    };
    Linearised {
        data,
        sensitivities: active,
        signals: 0,
    }
}

/// The same with the times of the samples \[s\], for what may change along the runs.
pub(crate) fn timed(posed: &Posed<'_>, at: &Predicted<'_>, data: &Data) -> Data {
    let all = at.program.likelihood.rows(&at.unknowns());
    let runs = data.runs.iter().zip(&all).zip(&posed.runs);
    let run = |((own, rows), of): ((&Run, &RunRows), &pilotage_collocation::Run)| {
        let mut time = vec![of.time[0]; own.time.len()];
        // Errors and variances of each signal, as they were added.
        for (k, range) in own.signals.iter().enumerate() {
            let signal = k * posed.quantities.predicted.len() / own.signals.len();
            let innovations = rows.innovations.iter().filter(|own| own.signal == signal);
            let pairs = time[range.clone()].iter_mut().zip(innovations);
            pairs.for_each(|(time, innovation)| *time = of.time[innovation.sample]);
        }
        Run {
            time,
            ..own.clone()
        }
    };
    Data {
        runs: runs.map(run).collect(),
        ..data.clone()
    }
}

/// Gradients of the constraints with nonzero multipliers, over the shared parameters and those of each run.
fn active(
    posed: &Posed<'_>,
    at: &Predicted<'_>,
    unknowns: &[f64],
) -> (DMatrix<f64>, Sensitivities) {
    let (likelihood, eta) = (&at.program.likelihood, &at.solution.iterate.eta);
    let slopes = at.program.limits.slopes(unknowns);
    let count = posed.constraints.count();
    let of_run = (eta.len() - count) / posed.runs.len().max(1);
    let rows = |places: &[usize], held: &mut dyn Iterator<Item = usize>| {
        // A multiplier is negative at a lower limit, where the constraint may only increase.
        let row = |i: usize| {
            RowDVector::from_iterator(
                places.len(),
                places.iter().map(|k| -eta[i].signum() * slopes[*k][i]),
            )
        };
        let all: Vec<RowDVector<f64>> = held.filter(|i| eta[*i] != 0.0).map(row).collect();
        match all.is_empty() {
            true => DMatrix::zeros(0, places.len()),
            false => DMatrix::from_rows(&all),
        }
    };
    let shared: Vec<usize> = (0..posed.shared).collect();
    let run = |(j, range): (usize, Range<usize>)| {
        let places: Vec<usize> = shared.iter().copied().chain(range.clone()).collect();
        let first = count + j * of_run;
        Sensitivity {
            free: likelihood.free(j),
            scales: at.program.scales[range].to_vec(),
            outputs: Vec::new(),
            active: rows(&places, &mut (first..first + of_run)),
        }
    };
    let parameters = rows(&shared, &mut (0..count));
    let sensitivities = Sensitivities {
        runs: likelihood.own().into_iter().enumerate().map(run).collect(),
        parameters: parameters.clone(),
        active: (0..count).filter(|i| eta[*i] != 0.0).collect(),
    };
    (parameters, sensitivities)
}

/// Derivatives and residuals of a run.
struct Rows {
    width: usize,
    derivatives: Vec<RowDVector<f64>>,
    residuals: Vec<f64>,
}

impl Rows {
    fn new(width: usize) -> Self {
        Self {
            width,
            derivatives: Vec::new(),
            residuals: Vec::new(),
        }
    }

    fn add(&mut self, derivatives: RowDVector<f64>, residual: f64) {
        self.derivatives.push(derivatives);
        self.residuals.push(residual);
    }

    /// Adds, for each signal, its innovations and then their variances.
    fn add_signals(&mut self, rows: &RunRows, signals: usize, weight: f64) -> Vec<Range<usize>> {
        let mut ranges = Vec::new();
        let scored = rows.scored();
        for signal in 0..signals {
            for (derivatives, residuals) in &scored {
                let first = self.residuals.len();
                for (i, own) in rows.innovations.iter().enumerate() {
                    if own.signal == signal {
                        self.add(derivatives.row(i) * weight, residuals[i] * weight);
                    }
                }
                ranges.push(first..self.residuals.len());
            }
        }
        ranges
    }

    fn run(
        self,
        shared: usize,
        signals: Vec<Range<usize>>,
        prior: Range<usize>,
        of: &Sensitivity,
    ) -> Run {
        let all = match self.derivatives.is_empty() {
            true => DMatrix::zeros(0, self.width),
            false => DMatrix::from_rows(&self.derivatives),
        };
        Run {
            shared: all.columns(0, shared).into_owned(),
            own: all.columns(shared, self.width - shared).into_owned(),
            own_scales: of.scales.clone().into(),
            // Successive innovations are white for any spacing.
            time: (0..self.residuals.len()).map(|k| k as f64).collect(),
            residuals: DVector::from_vec(self.residuals),
            signals,
            prior,
            active: of.active.clone(),
        }
    }
}
