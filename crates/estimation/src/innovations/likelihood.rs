//! The likelihood of the recordings from the predictions of the filter, and its derivatives.

use crate::posed::unknowns::Unknown;
use crate::posed::{Posed, Stands};
use nalgebra::{DMatrix, DVector};
use pilotage_filter::{Course, Filter, Innovation, Jet, Record, SLOPES};
use rayon::prelude::*;
use std::ops::Range;

/// Maximum number of parts of an interval.
pub(super) const MOST_PARTS: usize = 64;

/// Negligible change of −2 log-likelihood.
pub(super) const NEGLIGIBLE: f64 = 1e-3;

/// The innovations of a problem as functions of its unknowns: the shared parameters, followed by the free initial
/// states of each run, including its own parameters.
#[derive(Debug, Clone, Copy)]
pub struct Likelihood<'p> {
    posed: &'p Posed<'p>,
    filter: &'p Filter,
    /// Number of parts into which an interval between samples is divided.
    pub parts: usize,
    /// Recorded values for each signal and run, replacing those of the problem.
    pub recorded: Option<&'p [Vec<Vec<f64>>]>,
    /// For each unknown, a value added to the residual of its prior, if any.
    pub shifts: Option<&'p [f64]>,
    /// How often each run counts. Once if none.
    pub counts: Option<&'p [usize]>,
}

/// The innovations of a run and their derivatives with respect to its unknowns, shared ones first.
pub struct RunRows {
    /// Signal, sample, error and variance of each.
    pub innovations: Vec<Innovation<0>>,
    /// Derivatives of the errors, one row per innovation.
    pub errors: DMatrix<f64>,
    /// Derivatives of the variances, likewise.
    pub variances: DMatrix<f64>,
}

impl<'p> Likelihood<'p> {
    /// For a problem driven by noise.
    pub fn of(posed: &'p Posed<'p>) -> Option<Self> {
        Some(Self {
            posed,
            filter: posed.filter.as_ref()?,
            parts: 1,
            recorded: None,
            shifts: None,
            counts: None,
        })
    }

    /// The states of a run with sought initial values.
    pub fn free(&self, j: usize) -> Vec<usize> {
        let known = self.posed.runs[j].initial.iter().enumerate();
        known
            .filter_map(|(k, own)| own.is_none().then_some(k))
            .collect()
    }

    /// Index ranges of the unknowns of each run.
    pub fn own(&self) -> Vec<Range<usize>> {
        let mut first = self.posed.shared;
        let range = |j: usize| {
            let range = first..first + self.free(j).len();
            first = range.end;
            range
        };
        (0..self.posed.runs.len()).map(range).collect()
    }

    /// Initial states of a run for these unknowns.
    pub fn initial(&self, j: usize, unknowns: &[f64]) -> Vec<f64> {
        let mut own = unknowns[self.own()[j].clone()].iter();
        let known = self.posed.runs[j].initial.iter();
        known
            .map(|known| known.or_else(|| own.next().copied()).unwrap_or(f64::NAN))
            .collect()
    }

    /// Filters a run, with derivatives with respect to some of its unknowns, shared ones first.
    fn differentiated(&self, j: usize, unknowns: &[f64], first: usize) -> Course<SLOPES> {
        let jet = |value: f64, place: Option<usize>| Jet {
            value,
            slopes: std::array::from_fn(|k| f64::from(u8::from(place == Some(first + k)))),
        };
        let shared = self.posed.shared;
        let free = self.free(j);
        let place = |state: usize| free.iter().position(|own| *own == state);
        let states = self.initial(j, unknowns).into_iter().enumerate();
        let states = states.map(|(k, x)| jet(x, place(k).map(|own| shared + own)));
        let theta = unknowns[..shared].iter().enumerate();
        let theta = theta.map(|(k, value)| jet(*value, Some(k)));
        let (states, theta): (Vec<_>, Vec<_>) = (states.collect(), theta.collect());
        let measured = self.measured(j);
        let record = self.record(j, &measured);
        self.filter
            .differentiated(&record, &states, &theta, self.parts)
    }

    /// Filters a run from these initial states.
    pub fn from(&self, j: usize, initial: &[f64], theta: &[f64]) -> Course<0> {
        let measured = self.measured(j);
        let record = self.record(j, &measured);
        self.filter.run(&record, initial, theta, self.parts)
    }

    /// Recorded values of a run, by signals.
    fn measured(&self, j: usize) -> Vec<Vec<f64>> {
        let all = self.recorded.unwrap_or(&self.posed.quantities.recorded);
        all.iter().map(|own| own[j].clone()).collect()
    }

    fn record<'a>(&self, j: usize, measured: &'a [Vec<f64>]) -> Record<'a>
    where
        'p: 'a,
    {
        let run = &self.posed.runs[j];
        Record {
            time: &run.time,
            inputs: &run.inputs,
            measured,
        }
    }

    /// Simulated recordings of a run from these initial states, by signals, with random numbers of unit variance.
    pub fn simulated(
        &self,
        j: usize,
        initial: &[f64],
        theta: &[f64],
        gauss: &mut dyn FnMut() -> f64,
    ) -> Vec<Vec<f64>> {
        let measured = self.measured(j);
        let record = self.record(j, &measured);
        self.filter
            .simulated(&record, initial, theta, self.parts, gauss)
    }

    /// Filters a run.
    pub fn filtered(&self, j: usize, unknowns: &[f64]) -> Course<0> {
        let theta = &unknowns[..self.posed.shared];
        self.from(j, &self.initial(j, unknowns), theta)
    }

    /// `Σ weight (ln s + e²/s)` over all runs, plus the priors; NaN outside the domain.
    pub fn value(&self, unknowns: &[f64]) -> f64 {
        let runs: Vec<f64> = (0..self.posed.runs.len())
            .into_par_iter()
            .filter(|j| self.counts(*j))
            .map(|j| {
                let innovations = self.filtered(j, unknowns).innovations;
                let sum: f64 = innovations.iter().map(Innovation::surprise).sum();
                self.weight(j) * sum
            })
            .collect();
        runs.iter().sum::<f64>() + self.priors(unknowns).map(|own| own.value).sum::<f64>()
    }

    /// The weight of a run.
    pub fn weight(&self, j: usize) -> f64 {
        let often = self.counts.map_or(1, |counts| counts[j]);
        self.posed.data[j].line.weight * often as f64
    }

    /// Whether a run counts.
    pub fn counts(&self, j: usize) -> bool {
        self.counts.is_none_or(|counts| counts[j] > 0)
    }

    /// The innovations of all runs with their derivatives.
    pub fn rows(&self, unknowns: &[f64]) -> Vec<RunRows> {
        let width = |j: usize| self.posed.shared + self.free(j).len();
        let runs = 0..self.posed.runs.len();
        let passes = runs.clone().filter(|j| self.counts(*j)).flat_map(|j| {
            let firsts = (0..width(j).max(1)).step_by(SLOPES);
            firsts.map(move |first| (j, first))
        });
        let passes: Vec<(usize, usize)> = passes.collect();
        let courses: Vec<Course<SLOPES>> = passes
            .par_iter()
            .map(|(j, first)| self.differentiated(*j, unknowns, *first))
            .collect();
        let mut all: Vec<RunRows> = runs.map(|j| RunRows::empty(width(j))).collect();
        for ((j, first), course) in passes.iter().zip(&courses) {
            if *first == 0 {
                all[*j] = RunRows::new(course, width(*j));
            }
            all[*j].fill(course, *first);
        }
        all
    }

    /// The terms of the priors.
    pub fn priors<'a>(&'a self, unknowns: &'a [f64]) -> impl Iterator<Item = PriorTerm> + 'a {
        let all = self.posed.unknowns.iter();
        all.flat_map(move |(unknown, stands)| {
            let places = if unknown.prior.is_some() {
                self.places(stands)
            } else {
                Vec::new()
            };
            let term = move |place: usize| {
                let shift = self.shifts.map_or(0.0, |shifts| shifts[place]);
                PriorTerm::of(unknown, unknowns[place], place, shift)
            };
            places.into_iter().filter_map(term)
        })
    }

    /// Indices of an unknown among all unknowns.
    pub fn places(&self, stands: &Stands) -> Vec<usize> {
        match stands {
            Stands::Shared(k) => vec![*k],
            Stands::Subjects(all) => all.iter().map(|(_, k)| *k).collect(),
            Stands::State(state) => {
                let place = |(j, range): (usize, Range<usize>)| {
                    let own = self.free(j).iter().position(|own| own == state);
                    own.map(|own| range.start + own)
                };
                self.own()
                    .into_iter()
                    .enumerate()
                    .filter_map(place)
                    .collect()
            }
        }
    }

    /// The same with enough parts of each interval that twice as many make no significant difference.
    pub fn refined(self, unknowns: &[f64]) -> Self {
        let mut own = self;
        let mut value = own.value(unknowns);
        while own.parts < MOST_PARTS {
            let finer = own.doubled();
            let next = finer.value(unknowns);
            if (next - value).abs() <= NEGLIGIBLE || !next.is_finite() {
                break;
            }
            (own, value) = (finer, next);
        }
        own
    }

    /// The same with twice as many parts of each interval.
    pub fn doubled(self) -> Self {
        Self {
            parts: 2 * self.parts,
            ..self
        }
    }
}

impl RunRows {
    /// For a run that does not count.
    fn empty(unknowns: usize) -> Self {
        Self {
            innovations: Vec::new(),
            errors: DMatrix::zeros(0, unknowns),
            variances: DMatrix::zeros(0, unknowns),
        }
    }

    fn new(course: &Course<SLOPES>, unknowns: usize) -> Self {
        let plain = |own: &Innovation<SLOPES>| Innovation {
            signal: own.signal,
            sample: own.sample,
            error: Jet::constant(own.error.value),
            variance: Jet::constant(own.variance.value),
        };
        let innovations: Vec<Innovation<0>> = course.innovations.iter().map(plain).collect();
        let zeros = DMatrix::zeros(innovations.len(), unknowns);
        Self {
            innovations,
            errors: zeros.clone(),
            variances: zeros,
        }
    }

    /// Copies the derivatives of a pass.
    fn fill(&mut self, course: &Course<SLOPES>, first: usize) {
        let last = self.errors.ncols().min(first + SLOPES);
        for (i, own) in course.innovations.iter().enumerate() {
            for k in first..last {
                self.errors[(i, k)] = own.error.slopes[k - first];
                self.variances[(i, k)] = own.variance.slopes[k - first];
            }
        }
    }

    /// Rows of a least-squares problem with the same gradient, and with the Fisher information as its normal matrix
    /// ([`pilotage_inference::Row`]): `e'/√s` with the residual `e/√s`, and `s'/(√2 s)` with `(e²/s - 1)/√2`.
    pub fn scored(&self) -> [(DMatrix<f64>, DVector<f64>); 2] {
        let count = self.innovations.len();
        let (mut location, mut level) = (-&self.errors, self.variances.clone());
        let (mut errors, mut levels) = (DVector::zeros(count), DVector::zeros(count));
        let root = std::f64::consts::SQRT_2;
        for (i, own) in self.innovations.iter().enumerate() {
            let (s, z) = (own.variance.value, own.standardised());
            location.row_mut(i).scale_mut(1.0 / s.sqrt());
            level.row_mut(i).scale_mut(1.0 / (root * s));
            errors[i] = z;
            levels[i] = (z * z - 1.0) / root;
        }
        [(location, errors), (level, levels)]
    }
}

/// `((p - mean)/sd)²` of an unknown, where `p` is the quantity to which the prior applies.
#[derive(Debug, Clone, Copy)]
pub struct PriorTerm {
    /// Index of the unknown.
    pub place: usize,
    /// The term.
    pub value: f64,
    /// `(p - mean)/sd`.
    pub residual: f64,
    /// The derivative of the residual with respect to the unknown.
    pub slope: f64,
}

impl PriorTerm {
    fn of(unknown: &Unknown, searched: f64, place: usize, shift: f64) -> Option<Self> {
        let prior = unknown.prior?;
        let (p, slope) = match (unknown.log, prior.log) {
            (true, false) => (searched.exp(), searched.exp()),
            (false, true) => (searched.ln(), 1.0 / searched),
            _ => (searched, 1.0),
        };
        let residual = (p - prior.mean) / prior.sd + shift;
        Some(Self {
            place,
            value: residual * residual,
            residual,
            slope: slope / prior.sd,
        })
    }
}
