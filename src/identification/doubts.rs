//! Why an optimum may say less than it seems to: other starts ended elsewhere, or some of the pilot's
//! parameters are such that the data cannot tell them.

use super::Fit;
use super::constraints::STABILITY_MARGIN;
use super::result::{AGREE, StartReport};
use pilotage_models::Pilot;
use std::f64::consts::PI;

/// θ1 within this many margins is on its bound.
const ON_BOUND: f64 = 10.0;
/// Relative distance of a pole from a zero that it cancels.
const CANCELLED: f64 = 0.01;

/// One reason to look twice at a fit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Doubt {
    /// Of several starts, one alone led to this objective: there are other optima, and perhaps a better
    /// one.
    OneStart {
        /// Number of starts.
        starts: usize,
    },
    /// A start passed a pilot with a lower objective, and did not converge: there is a better optimum.
    Lower {
        /// Which start, from 1.
        start: usize,
        /// That objective, in units of [`Fit::objective`].
        objective: f64,
    },
    /// θ1 lies on its bound: the pilot integrates the error for ever.
    Integrates,
    /// A pole is faster than any that samples so far apart can tell.
    FastPole {
        /// Its real part [1/s].
        pole: f64,
        /// π over the time between samples [1/s].
        limit: f64,
    },
    /// A pole lies on a zero: a pilot of lower order does the same.
    Cancelled {
        /// Magnitude of the pole [1/s].
        pole: f64,
    },
}

impl std::fmt::Display for Doubt {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::OneStart { starts } => write!(
                f,
                "only one of {starts} starts ended here; there may be a better optimum, \
                 try --random-starts 20"
            ),
            Self::Lower { start, objective } => write!(
                f,
                "start {start} came to a sum of squares of {objective:.6} and did not converge: there is a \
                 better optimum, try --max-iterations or --random-starts 20"
            ),
            Self::Integrates => write!(
                f,
                "θ1 lies on its bound: this pilot integrates, which runs this short cannot tell"
            ),
            Self::FastPole { pole, limit } => write!(
                f,
                "the pole at {pole:.3e} 1/s is faster than the samples can tell ({limit:.0} 1/s): \
                 its size means nothing"
            ),
            Self::Cancelled { pole } => write!(
                f,
                "a pole of {pole:.3} 1/s lies on a zero: a lower --order says the same"
            ),
        }
    }
}

/// What speaks against taking `fit` of `pilot` at its word.
pub fn doubts(fit: &Fit, pilot: Pilot) -> Vec<Doubt> {
    let mut doubts = Vec::new();
    if fit.starts.len() > 1 && fit.agreeing() == 1 {
        doubts.push(Doubt::OneStart {
            starts: fit.starts.len(),
        });
    }
    let feasible = |s: &StartReport| s.feasible.map(|objective| (s.number, objective));
    let least = (fit.starts.iter().filter_map(feasible)).min_by(|(_, a), (_, b)| a.total_cmp(b));
    if let Some((start, objective)) = least
        && objective < fit.objective * (1.0 - AGREE)
    {
        doubts.push(Doubt::Lower { start, objective });
    }
    if fit.theta[0] <= ON_BOUND * STABILITY_MARGIN {
        doubts.push(Doubt::Integrates);
    }
    let poles = pilot.poles(&fit.theta);
    let steps = fit.runs.iter().flat_map(|run| run.time.windows(2));
    let step = steps
        .map(|pair| pair[1] - pair[0])
        .fold(f64::INFINITY, f64::min);
    let limit = PI / step;
    let fast = poles.iter().map(|pole| pole.re).fold(0.0, f64::min);
    if fast < -limit {
        doubts.push(Doubt::FastPole { pole: fast, limit });
    }
    let zeros = zeros(&fit.theta[pilot.order..]);
    let on_zero = |pole: f64, distance: f64| distance <= CANCELLED * pole;
    let nearest = |pole: &nalgebra::Complex<f64>| {
        let distances = zeros.iter().map(|zero| (zero - pole).norm());
        distances.fold(f64::INFINITY, f64::min)
    };
    if let Some(pole) = poles.iter().find(|p| on_zero(p.norm(), nearest(p))) {
        doubts.push(Doubt::Cancelled { pole: pole.norm() });
    }
    doubts
}

/// Roots of the polynomial with these ascending coefficients.
fn zeros(numerator: &[f64]) -> Vec<nalgebra::Complex<f64>> {
    let degree = numerator.iter().rposition(|c| *c != 0.0).unwrap_or(0);
    if degree == 0 {
        return Vec::new();
    }
    let monic: Vec<f64> = (numerator[..degree].iter())
        .map(|c| c / numerator[degree])
        .collect();
    Pilot { order: degree }.poles(&monic)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::identification::RunFit;

    /// A fit of `theta` to samples 0.05 s apart, with these objectives of its starts.
    fn fit(theta: [f64; 6], starts: &[f64]) -> Fit {
        let run = RunFit {
            name: "run".into(),
            time: vec![0.0, 0.05, 0.1],
            target: vec![1.0; 3],
            position: vec![0.0; 3],
            stick: vec![0.0; 3],
            residual: vec![0.0; 3],
            states: vec![vec![0.0; 9]; 3],
        };
        let start = |objective: &f64| StartReport {
            number: 1,
            kkt: 0.0,
            curvature: Some(1.0),
            seconds: 0.0,
            status: "converged".into(),
            objective: *objective,
            feasible: Some(*objective),
            iterations: 1,
        };
        Fit {
            theta: theta.to_vec(),
            objective: starts[0],
            converged: true,
            status: "converged".into(),
            kkt: 0.0,
            curvature: Some(1.0),
            skipped: 0,
            iterations: 1,
            unknowns: 33,
            seconds: 0.0,
            starts: starts.iter().map(start).collect(),
            runs: vec![run],
        }
    }

    fn of(theta: [f64; 6], starts: &[f64]) -> Vec<Doubt> {
        doubts(&fit(theta, starts), Pilot { order: 3 })
    }

    /// Poles at -1, -2 and -3, zeros at -5 and -6.
    const SOUND: [f64; 6] = [6.0, 11.0, 6.0, 30.0, 11.0, 1.0];

    #[test]
    fn a_sound_fit_raises_none() {
        assert_eq!(of(SOUND, &[7.0, 7.006]), []);
        assert_eq!(of(SOUND, &[7.0]), [], "a start of the user's is alone");
    }

    #[test]
    fn starts_that_end_elsewhere_are_told() {
        assert_eq!(
            of(SOUND, &[7.0, 7.008, 8.0]),
            [Doubt::OneStart { starts: 3 }]
        );
    }

    #[test]
    fn a_start_that_was_lower_is_told_and_agrees_with_none() {
        let mut fit = fit(SOUND, &[7.0, 7.0, 6.99]);
        assert_eq!(fit.agreeing(), 2);
        let lower = Doubt::Lower {
            start: 1,
            objective: 6.99,
        };
        assert_eq!(doubts(&fit, Pilot { order: 3 }), [lower]);
        fit.starts[2].feasible = None;
        assert_eq!(doubts(&fit, Pilot { order: 3 }), []);
    }

    #[test]
    fn an_integrating_pilot_is_told() {
        assert_eq!(
            of([1e-6, 2.0, 3.0, 30.0, 11.0, 1.0], &[7.0]),
            [Doubt::Integrates]
        );
    }

    #[test]
    fn a_pole_beyond_the_samples_is_told() {
        // Poles at -1, -2 and -100.
        let found = of([200.0, 302.0, 103.0, 30.0, 11.0, 1.0], &[7.0]);
        assert!(
            matches!(found[..], [Doubt::FastPole { pole, .. }] if (pole + 100.0).abs() < 1e-6),
            "{found:?}"
        );
    }

    #[test]
    fn a_pole_on_a_zero_is_told() {
        // Zeros at -2.01 and -6.
        let found = of([6.0, 11.0, 6.0, 12.06, 8.01, 1.0], &[7.0]);
        assert!(
            matches!(found[..], [Doubt::Cancelled { pole }] if (pole - 2.0).abs() < 1e-6),
            "{found:?}"
        );
    }
}
