//! Input of refits from a fit: unknowns by name, data, noise.

use crate::bootstrap::{Replicate, counts, random, resampled};
use crate::profile::{End, Profile, Sought, Threshold, profile};
use crate::refit::{Coordinate, Data, Found, Resample};
use crate::solved::Watch;
use std::fmt;

/// Number of runs from which on whole runs are drawn by default.
pub const ENOUGH_RUNS: usize = 4;
/// First step, relative to the scale, if no interval is known.
const UNKNOWN_STEP: f64 = 0.1;
/// Distance from an end of a range, relative to its size, that keeps refits within the constraint that defines the
/// range.
const INSIDE: f64 = 1e-6;

/// An unknown of the fit.
#[derive(Debug, Clone)]
pub struct Unknown {
    /// Name of the parameter.
    pub name: String,
    /// Run or group that it belongs to, if there are several.
    pub label: Option<String>,
    /// Its coordinate.
    pub at: Coordinate,
    /// Whether its logarithm is the optimisation variable.
    pub is_log: bool,
    /// Half width of its interval, on the logarithmic scale if [`Self::is_log`]; infinite or 0 if not known.
    pub half: f64,
    /// Its range.
    pub range: [f64; 2],
    /// For each run, whether it informs about the unknown.
    pub informed_by: Vec<bool>,
}

/// Derived quantities as a function of the shared parameters, in units.
pub type Derive<'a> = dyn Fn(&[f64]) -> Vec<f64> + Send + Sync + 'a;

/// A solved problem with what refits need.
pub struct Study<'a> {
    /// The problem at its solution.
    pub solved: Box<dyn Resample + Send + 'a>,
    /// The unknowns.
    pub unknowns: Vec<Unknown>,
    /// Factor from the problem's objective to the solver's.
    pub factor: f64,
    /// Threshold of the profiles.
    pub threshold: Threshold,
    /// Degrees of freedom of the variance of the residuals; `None` if the noise level is an unknown.
    pub degrees: Option<f64>,
    /// Names of the constraints on parameters.
    pub constraints: Vec<String>,
    /// Names of the bounds.
    pub bounds: Vec<String>,
    /// Names of the derived quantities.
    pub derived: Vec<String>,
    /// Values of the derived quantities; NaN if there are none.
    pub derive: Box<Derive<'a>>,
    /// Whether the objective is the likelihood of one-step predictions.
    pub is_predicted: bool,
}

/// Kind of bootstrap.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// Whole runs, with replacement.
    Runs,
    /// Residuals, simulated by a model of the noise and added to the predictions of the fit.
    Parametric,
}

impl Kind {
    /// Both kinds.
    pub const ALL: [Self; 2] = [Self::Runs, Self::Parametric];

    /// Name on the command line.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Runs => "runs",
            Self::Parametric => "parametric",
        }
    }

    /// The default for this number of runs.
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
    /// The name, followed by the label in brackets.
    pub fn full_name(&self) -> String {
        match &self.label {
            Some(label) => format!("{} ({label})", self.name),
            None => self.name.clone(),
        }
    }

    /// The value for a value of the optimisation variable.
    pub fn found(&self, searched: f64) -> f64 {
        match self.is_log {
            true => searched.exp(),
            false => searched,
        }
    }

    /// The optimisation variable for a value; -∞ for the logarithm of a value that is not positive.
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

    /// Replicates with these numbers: the values of the unknowns, followed by those of the derived quantities. Values
    /// that the drawn runs do not determine are NaN.
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
            let is_informed = |own: &Unknown| {
                (0..own.informed_by.len()).any(|j| own.informed_by[j] && is_drawn(j))
            };
            // Runs that are drawn do not spread what one of them alone determines.
            let is_alone = |own: &Unknown| {
                let informing = own.informed_by.iter().filter(|informs| **informs);
                kind == Kind::Runs && (own.at.is_initial() || informing.count() == 1)
            };
            let of = |own: &Unknown| match is_informed(own) && !is_alone(own) {
                // Clamped to the range, which the solver fulfils only within its tolerance.
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
