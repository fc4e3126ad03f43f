//! What a fit hands over to be solved again: its unknowns by their names, its data, its noise.

use crate::bootstrap::{Replicate, Sample, counts, random, resampled};
use crate::profile::{End, Profile, Sought, Threshold, profile};
use crate::solved::{Coordinate, Solved, Watch};
use pilotage_collocation::{Collocation, Run};
use rand_chacha::ChaCha8Rng;
use std::fmt;

/// Runs from which on whole runs are drawn.
pub const ENOUGH_RUNS: usize = 4;
/// Part of a step that is expected where nobody knows one, per scale.
const UNKNOWN_STEP: f64 = 0.1;
/// Distance from an end of a range, per size, that keeps a refit within the constraint that the range is.
const INSIDE: f64 = 1e-6;

/// A sought number.
#[derive(Debug, Clone)]
pub struct Unknown {
    /// Name of the parameter.
    pub name: String,
    /// Whose it is, where there are several.
    pub label: Option<String>,
    /// Where it stands.
    pub at: Coordinate,
    /// The search goes along its logarithm.
    pub is_log: bool,
    /// Half its interval as the search sees it; infinite or 0 where that is not known.
    pub half: f64,
    /// Its range.
    pub range: [f64; 2],
    /// For each run, whether it tells of it.
    pub told: Vec<bool>,
}

/// Makes runs of a replicate: other values recorded of the same runs.
pub type Simulate<'a> = dyn Fn(&mut ChaCha8Rng) -> Vec<Run> + Send + Sync + 'a;

/// What follows from the shared parameters, in their units.
pub type Derive<'a> = dyn Fn(&[f64]) -> Vec<f64> + Send + Sync + 'a;

/// A solved problem with what its refits need.
pub struct Study<'a> {
    /// The problem at its solution.
    pub solved: Solved,
    /// What is sought.
    pub unknowns: Vec<Unknown>,
    /// What the solver's objective is, per unit of the problem's.
    pub factor: f64,
    /// Where profiles end.
    pub threshold: Threshold,
    /// Degrees of freedom of the variance of the residuals; none where the noise level is sought.
    pub degrees: Option<f64>,
    /// Names of the constraints on parameters.
    pub constraints: Vec<String>,
    /// Names of the bounds.
    pub bounds: Vec<String>,
    /// Number of measured outputs that are recorded; those behind are what is known beforehand.
    pub signals: usize,
    /// Names of what follows from shared parameters.
    pub derived: Vec<String>,
    /// Its values; not numbers where there are none.
    pub derive: Box<Derive<'a>>,
    /// Draws residuals.
    pub simulate: Box<Simulate<'a>>,
}

/// What is drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// Whole runs, with replacement.
    Runs,
    /// Residuals, from a model of the noise, added to what the fit predicts.
    Parametric,
}

impl Kind {
    /// Both.
    pub const ALL: [Self; 2] = [Self::Runs, Self::Parametric];

    /// One word, as on the command line.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Runs => "runs",
            Self::Parametric => "parametric",
        }
    }

    /// What is taken of so many runs unless it is named.
    pub fn of(runs: usize) -> Self {
        match runs >= ENOUGH_RUNS {
            true => Self::Runs,
            false => Self::Parametric,
        }
    }
}

impl fmt::Display for Kind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.as_str())
    }
}

impl Unknown {
    /// Its name, with whose it is in brackets.
    pub fn full_name(&self) -> String {
        match &self.label {
            Some(label) => format!("{} ({label})", self.name),
            None => self.name.clone(),
        }
    }

    /// The value of what the search sees.
    pub fn found(&self, searched: f64) -> f64 {
        match self.is_log {
            true => searched.exp(),
            false => searched,
        }
    }

    /// What the search sees of a value; of the logarithm of what is not above 0, -∞.
    fn searched(&self, value: f64) -> f64 {
        match self.is_log {
            true => value.max(0.0).ln(),
            false => value,
        }
    }
}

impl Study<'_> {
    /// The value of an unknown.
    pub fn value(&self, k: usize) -> f64 {
        let own = &self.unknowns[k];
        own.found(own.at.value(&self.solved.problem, &self.solved.at.z))
    }

    /// The profiles of these unknowns, in their units.
    pub fn profiles(&self, of: &[usize], watch: &Watch<'_>) -> Vec<Profile> {
        let sought: Vec<Sought> = of.iter().map(|k| self.sought(&self.unknowns[*k])).collect();
        let mut found = profile(&self.solved, &sought, self.threshold, watch);
        for (profile, k) in found.iter_mut().zip(of) {
            let own = &self.unknowns[*k];
            let points = profile.points.iter_mut();
            points.for_each(|point| point.value = own.found(point.value));
            for (end, limit) in profile.ends.iter_mut().zip(own.range) {
                *end = match *end {
                    End::Crossed(at) => End::Crossed(own.found(at)),
                    End::Range(_) => End::Range(limit),
                    End::Open(at) => End::Open(own.found(at)),
                    End::Failed(at) => End::Failed(own.found(at)),
                    End::Stopped(at) => End::Stopped(own.found(at)),
                };
            }
        }
        found
    }

    fn sought(&self, own: &Unknown) -> Sought {
        let scales = &self.solved.problem.model.scales;
        let scale = match own.at {
            Coordinate::Shared(k) => scales.parameters[k],
            Coordinate::Initial { state, .. } => scales.states[state],
        };
        let is_step = own.half.is_finite() && own.half > 0.0;
        let end = |end: f64, inward: f64| match own.searched(end) {
            end if end.is_finite() => end + inward * INSIDE * (scale + end.abs()),
            end => end,
        };
        Sought {
            at: own.at,
            step: if is_step {
                own.half
            } else {
                UNKNOWN_STEP * scale
            },
            range: [end(own.range[0], 1.0), end(own.range[1], -1.0)],
        }
    }

    /// Replicates with these numbers: the values of the unknowns, and of what is derived behind them. What their runs do
    /// not tell of is not a number.
    pub fn bootstrap(
        &self,
        (kind, seed): (Kind, u64),
        numbers: &[u64],
        see: &(dyn Fn(&Replicate) + Sync),
        watch: &Watch<'_>,
    ) -> Vec<Replicate> {
        let draw = |number: u64| {
            let mut random = random(seed, number);
            match kind {
                Kind::Runs => self.drawn(&counts(self.solved.problem.runs.len(), &mut random)),
                Kind::Parametric => Sample {
                    runs: (self.simulate)(&mut random),
                    from: (0..self.solved.problem.runs.len()).collect(),
                },
            }
        };
        let values = |sample: &Sample, problem: &Collocation, z: &[f64]| {
            let value = |own: &Unknown| match sample.from.iter().any(|run| own.told[*run]) {
                true => own.found(sample.value(own.at, problem, z)),
                false => f64::NAN,
            };
            let initial = |own: &Unknown| kind == Kind::Runs && own.at.is_initial();
            let of = |own: &Unknown| if initial(own) { f64::NAN } else { value(own) };
            let mut all: Vec<f64> = self.unknowns.iter().map(of).collect();
            all.extend((self.derive)(&problem.physical_theta(z)));
            all
        };
        resampled(&self.solved, numbers, &draw, &values, (see, watch))
    }

    /// Runs that are drawn so often: one that is drawn twice has twice the weight. What is known of shared parameters
    /// beforehand stands in one run, and stays.
    fn drawn(&self, counts: &[usize]) -> Sample {
        let whole = &self.solved.problem.runs;
        let from: Vec<usize> = (0..whole.len()).filter(|j| counts[*j] > 0).collect();
        let mut runs: Vec<Run> = from.iter().map(|j| whole[*j].clone()).collect();
        for (run, j) in runs.iter_mut().zip(&from) {
            let recorded = run.measured[..self.signals].iter_mut();
            recorded.for_each(|own| own.weight *= counts[*j] as f64);
        }
        for prior in self.signals..self.solved.problem.measured {
            let is_there = |run: &Run| run.measured[prior].values.iter().any(|y| y.is_finite());
            let first = whole.iter().find(|run| is_there(run));
            if let (false, Some(first)) = (runs.iter().any(is_there), first) {
                runs[0].measured[prior].values[0] = first.measured[prior].values[0];
            }
        }
        Sample { runs, from }
    }
}
