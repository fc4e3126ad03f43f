//! Linearisation of a solution: each measured value is a row of a least-squares problem.

use crate::posed::Posed;
use crate::problem::file::Deviation;
use crate::search::solved::Linearised;
use nalgebra::{DMatrix, DVector, RowDVector};
use pilotage_collocation::{Collocation, Loss, Recording, Sensitivities, Sensitivity};
use pilotage_inference::{Data, Noise, Row, Run};
use pilotage_sqp::Iterate;
use rayon::prelude::*;
use std::ops::Range;

/// The terms of a measured signal in the objective: its residual, and its noise level if that is sought.
#[derive(Debug, Clone, Copy)]
struct Terms {
    residual: usize,
    level: Option<usize>,
}

/// The least-squares problem of a solution, with the samples of its runs, which on a coarse mesh are means. None if its derivatives are not available: see [`Sensitivities::new`].
pub(crate) fn linearised(
    posed: &Posed<'_>,
    problem: &Collocation,
    at: &Iterate,
) -> Option<Linearised> {
    let found = Sensitivities::new(problem, at)?;
    let terms = terms(posed);
    let signals = terms.iter().map(Terms::end).max().unwrap_or(0);
    let outputs = outputs(problem, &at.z);
    let noises = noises(posed, &problem.runs, &outputs);
    let priors = signals..problem.measured;
    let of_run = |(j, own): (usize, &Sensitivity)| {
        let place = Place {
            recordings: &problem.runs[j].measured,
            noises: &noises,
            time: &problem.runs[j].time,
            outputs: &outputs[j],
            sensitivity: own,
            factor: posed.factor,
        };
        let mut rows = Rows::new(posed.shared + own.free.len());
        let mut shared_priors = Vec::new();
        let of_signals = terms.iter().flat_map(|terms| place.add(*terms, &mut rows));
        let of_signals = of_signals.collect();
        let prior = place.add_priors(priors.clone(), posed.shared, &mut rows, &mut shared_priors);
        (
            rows.run(own, posed.shared, of_signals, prior),
            shared_priors,
        )
    };
    let runs = found.runs.par_iter().enumerate().map(of_run);
    let (runs, shared_priors): (Vec<Run>, Vec<Vec<_>>) = runs.unzip();
    let shared_priors = shared_priors.into_iter().flatten();
    let (prior, prior_residuals): (Vec<RowDVector<f64>>, Vec<f64>) = shared_priors.unzip();
    let prior = match prior.is_empty() {
        true => DMatrix::zeros(0, posed.shared),
        false => DMatrix::from_rows(&prior),
    };
    let scales = DVector::from_column_slice(&problem.model.scales.parameters);
    let data = Data {
        runs,
        prior,
        prior_residuals,
        active: found.parameters.clone(),
        scales,
        is_scaled: (0..terms.len()).any(|k| seeks_level(posed, k)),
        levels: terms.iter().filter_map(|own| own.level).collect(),
    };
    Some(Linearised {
        data,
        sensitivities: found,
        signals,
    })
}

/// For each run, the residuals of the measured signals at other variables of a problem with the same runs.
pub(super) fn residuals(posed: &Posed<'_>, problem: &Collocation, z: &[f64]) -> Vec<DVector<f64>> {
    let terms = terms(posed);
    let outputs = outputs(problem, z);
    let noises = noises(posed, &problem.runs, &outputs);
    let of_run = |j: usize| {
        let mut all = Vec::new();
        for own in &terms {
            let term = own.residual;
            let rows = values(
                &problem.runs[j].measured[term],
                &outputs[j][term],
                (noises[term], posed.factor),
            );
            let rows: Vec<Row> = rows.map(|(_, row)| row).collect();
            all.extend(rows.iter().map(|row| row.location));
            all.extend(
                rows.iter()
                    .filter(|_| own.level.is_some())
                    .map(|row| row.level),
            );
        }
        DVector::from_vec(all)
    };
    (0..problem.runs.len()).map(of_run).collect()
}

impl Terms {
    /// The index after the last term.
    fn end(&self) -> usize {
        self.level.unwrap_or(self.residual) + 1
    }
}

/// Whether the standard deviation of a measured signal contains a sought parameter. One of signals alone has terms of its
/// level too, and may be as wrong as a number.
fn seeks_level(posed: &Posed<'_>, measured: usize) -> bool {
    let is_sought = |name: &str| {
        let mut lines = posed.file.parameters.iter();
        lines.any(|line| !line.fixed && line.name.value == name)
    };
    match &posed.file.measured[measured].sd {
        Deviation::Formula(formula) => formula.names().any(is_sought),
        _ => false,
    }
}

/// Index of the signal of a least-squares problem's [`Run`]s that holds the residuals of a measured signal.
pub(crate) fn signal_of(posed: &Posed<'_>, measured: usize) -> Option<usize> {
    terms(posed).get(measured).map(|own| own.residual)
}

/// The terms of each measured signal. A noise level follows its residual, and priors come last.
fn terms(posed: &Posed<'_>) -> Vec<Terms> {
    let Some(run) = posed.runs.first() else {
        return Vec::new();
    };
    let is_level = |k: usize| {
        run.measured
            .get(k)
            .is_some_and(|own| own.loss == Loss::Linear)
    };
    let mut next = 0;
    let signals = (0..posed.quantities.predicted.len()).map(|_| {
        let own = Terms {
            residual: next,
            level: is_level(next + 1).then_some(next + 1),
        };
        next = own.end();
        own
    });
    signals.collect()
}

/// The samples at which a term has a value, and its row there. Weights of a nonlinear program contain the factor of its
/// objective.
fn values<'a>(
    own: &'a Recording,
    outputs: &'a [f64],
    (noise, factor): (Noise, f64),
) -> impl Iterator<Item = (usize, Row)> + 'a {
    let weight = own.weight / factor;
    there(own, outputs).map(move |(k, z)| (k, Row::new(noise, z, weight)))
}

/// The samples at which a term has a value, and its residual.
fn there<'a>(own: &'a Recording, outputs: &'a [f64]) -> impl Iterator<Item = (usize, f64)> + 'a {
    let pairs = own.values.iter().zip(outputs).enumerate();
    let there = pairs.filter(|(_, (y, _))| y.is_finite());
    there.map(|(k, (y, h))| (k, y - h))
}

/// For each run, the outputs of all terms at the samples.
fn outputs(problem: &Collocation, z: &[f64]) -> Vec<Vec<Vec<f64>>> {
    let runs = 0..problem.runs.len();
    runs.map(|j| problem.outputs_at_samples(z, j)).collect()
}

/// The noise of each term, given the residuals of all runs.
fn noises(
    posed: &Posed<'_>,
    runs: &[pilotage_collocation::Run],
    outputs: &[Vec<Vec<f64>>],
) -> Vec<Noise> {
    let terms = posed.runs.first().map_or(0, |run| run.measured.len());
    let noise = |term: usize| {
        let runs = runs.iter().zip(outputs);
        let residuals = runs.flat_map(|(run, outputs)| {
            let own = &run.measured[term];
            there(own, &outputs[term]).map(|(_, z)| (z, own.weight / posed.factor))
        });
        match posed.runs[0].measured[term].loss {
            Loss::Square | Loss::Linear => Noise::Normal,
            Loss::Student { dof } => Noise::student(dof, residuals),
            Loss::Absolute { smoothing } => {
                Noise::laplace(smoothing, unknowns_per_value(posed), residuals)
            }
            Loss::Huber { threshold } => Noise::huber(threshold, residuals),
        }
    };
    (0..terms).map(noise).collect()
}

/// Number of unknowns, without as many as there are priors, over that of measured values.
fn unknowns_per_value(posed: &Posed<'_>) -> f64 {
    let own = terms(posed);
    let count = |terms: &[usize]| -> usize {
        let runs = posed.runs.iter();
        let recordings = runs.flat_map(|run| terms.iter().map(|k| &run.measured[*k]));
        recordings
            .map(|own| own.values.iter().filter(|y| y.is_finite()).count())
            .sum()
    };
    let signals: Vec<usize> = own.iter().map(|own| own.residual).collect();
    let all = posed.runs.first().map_or(0, |run| run.measured.len());
    let priors: Vec<usize> = (own.iter().map(Terms::end).max().unwrap_or(0)..all).collect();
    let unknowns = posed.count().saturating_sub(count(&priors));
    unknowns as f64 / count(&signals).max(1) as f64
}

/// A run at a solution.
struct Place<'a> {
    recordings: &'a [Recording],
    noises: &'a [Noise],
    time: &'a [f64],
    outputs: &'a [Vec<f64>],
    sensitivity: &'a Sensitivity,
    factor: f64,
}

/// Derivatives with respect to `[θ; own unknowns]`, row after row, and residuals.
struct Rows {
    width: usize,
    derivatives: Vec<f64>,
    residuals: Vec<f64>,
    time: Vec<f64>,
}

impl Place<'_> {
    fn values(&self, term: usize) -> Vec<(usize, Row)> {
        values(
            &self.recordings[term],
            &self.outputs[term],
            (self.noises[term], self.factor),
        )
        .collect()
    }

    fn gradient(&self, term: usize, sample: usize) -> RowDVector<f64> {
        self.sensitivity.outputs[term].row(sample).into_owned()
    }

    /// Adds `scale` times the gradient of a term to entries of a row.
    fn write(&self, (term, sample): (usize, usize), scale: f64, row: &mut [f64]) {
        let own = self.sensitivity.outputs[term].row(sample);
        let pairs = row.iter_mut().zip(own.iter());
        pairs.for_each(|(row, own)| *row += scale * own);
    }

    /// Adds the rows of a signal: those of its location, and those of its level if that is sought.
    fn add(&self, terms: Terms, rows: &mut Rows) -> Vec<Range<usize>> {
        let values = self.values(terms.residual);
        let first = rows.residuals.len();
        for (sample, row) in &values {
            let gradient = rows.add(row.location, self.time[*sample]);
            let scale = row.location_scale;
            self.write((terms.residual, *sample), scale, gradient);
            if let Some(level) = terms.level {
                // The part of the derivative of (h - y)/sd that comes from sd does not belong to the location.
                let z = self.outputs[terms.residual][*sample];
                self.write((level, *sample), 0.5 * z * scale, gradient);
            }
        }
        let middle = rows.residuals.len();
        let levels = terms.level.map(|level| {
            for (sample, row) in &values {
                // The term is 2 ln sd.
                let gradient = rows.add(row.level, self.time[*sample]);
                self.write((level, *sample), 0.5 * row.level_scale, gradient);
            }
            middle..rows.residuals.len()
        });
        std::iter::once(first..middle).chain(levels).collect()
    }

    /// Adds the priors on the run's own unknowns. Those on shared parameters go to `others`.
    fn add_priors(
        &self,
        terms: Range<usize>,
        shared: usize,
        rows: &mut Rows,
        others: &mut Vec<(RowDVector<f64>, f64)>,
    ) -> Range<usize> {
        let first = rows.residuals.len();
        for (term, (sample, row)) in
            terms.flat_map(|term| self.values(term).into_iter().map(move |own| (term, own)))
        {
            let gradient = row.location_scale * self.gradient(term, sample);
            match gradient.columns_range(shared..).amax() > 0.0 {
                true => rows
                    .add(row.location, self.time[sample])
                    .copy_from_slice(gradient.as_slice()),
                false => {
                    others.push((gradient.columns(0, shared).into_owned(), row.location));
                }
            }
        }
        first..rows.residuals.len()
    }
}

impl Rows {
    fn new(width: usize) -> Self {
        Self {
            width,
            derivatives: Vec::new(),
            residuals: Vec::new(),
            time: Vec::new(),
        }
    }

    /// Adds a row without derivatives, and returns these.
    fn add(&mut self, residual: f64, time: f64) -> &mut [f64] {
        self.time.push(time);
        self.residuals.push(residual);
        let first = self.derivatives.len();
        self.derivatives.resize(first + self.width, 0.0);
        &mut self.derivatives[first..]
    }

    fn run(
        self,
        of: &Sensitivity,
        shared: usize,
        signals: Vec<Range<usize>>,
        prior: Range<usize>,
    ) -> Run {
        let all = DMatrix::from_row_slice(self.residuals.len(), self.width, &self.derivatives);
        Run {
            shared: all.columns(0, shared).into_owned(),
            own: all.columns(shared, self.width - shared).into_owned(),
            own_scales: of.scales.clone().into(),
            residuals: DVector::from_vec(self.residuals),
            time: self.time,
            signals,
            prior,
            active: of.active.clone(),
        }
    }
}
