//! What a fit hands over to be solved again: its unknowns by their names, its data, its noise.

use crate::bootstrap::{Replicate, counts, random, resampled};
use crate::profile::{End, Profile, Sought, Threshold, profile};
use crate::refit::{Coordinate, Data, Found, Resample};
use crate::solved::Watch;
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

/// What follows from the shared parameters, in their units.
pub type Derive<'a> = dyn Fn(&[f64]) -> Vec<f64> + Send + Sync + 'a;

/// A solved problem with what its refits need.
pub struct Study<'a> {
    /// The problem at its solution.
    pub solved: Box<dyn Resample + Send + 'a>,
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
    /// Names of what follows from shared parameters.
    pub derived: Vec<String>,
    /// Its values; not numbers where there are none.
    pub derive: Box<Derive<'a>>,
    /// Whether it is the likelihood of predictions from sample to sample.
    pub is_predicted: bool,
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
        own.found(self.solved.value(own.at))
    }

    /// The profiles of these unknowns, in their units.
    pub fn profiles(&self, of: &[usize], watch: &Watch<'_>) -> Vec<Profile> {
        let sought: Vec<Sought> = of.iter().map(|k| self.sought(&self.unknowns[*k])).collect();
        let mut found = profile(&*self.solved, &sought, self.threshold, watch);
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
        let scale = self.solved.scale(own.at);
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
                Kind::Runs => Data::Counted(counts(self.solved.runs(), &mut random)),
                Kind::Parametric => Data::Simulated(Box::new(random)),
            }
        };
        let values = |found: &Found| {
            let is_drawn = |run: usize| found.initial[run].is_some();
            let is_told = |own: &Unknown| (0..own.told.len()).any(|j| own.told[j] && is_drawn(j));
            let initial = |own: &Unknown| kind == Kind::Runs && own.at.is_initial();
            let of = |own: &Unknown| match is_told(own) && !initial(own) {
                // On the end of a range within what the solver leaves.
                true => own
                    .found(found.value(own.at))
                    .max(own.range[0])
                    .min(own.range[1]),
                false => f64::NAN,
            };
            let mut all: Vec<f64> = self.unknowns.iter().map(of).collect();
            all.extend((self.derive)(&found.shared));
            all
        };
        resampled(&*self.solved, numbers, &draw, &values, (see, watch))
    }
}
