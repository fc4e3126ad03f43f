//! Diagnostics of θ, its poles, its residuals and the other starts.

use super::{Diagnostic, Fit, FitOptions};
use crate::closed_loop;
use crate::constraints::{RouthHurwitz, STABILITY_MARGIN};
use crate::result::{AGREE, RunFit, StartReport};
use crate::{InitialState, Objective};
use nalgebra::Complex;
use pilotage_inference::statistics::rms;
use pilotage_models::Pilot;
use pilotage_models::quadcopter::{N_STATES, STATE_NAMES};
use std::f64::consts::PI;

/// A stability condition within this many margins is on its bound.
const ON_BOUND: f64 = 10.0;
/// Relative distance of a pole from a zero that it cancels.
const CANCELLED: f64 = 0.01;
/// Maximum stick deflection of a pilot that does nothing.
const IDLE: f64 = 1e-6;
/// Variance accounted for below which the model is poor.
const POOR: f64 = 0.5;
/// An initial state above this multiple of its largest magnitude after [`SETTLED`] seconds is unphysical.
const WILD: f64 = 3.0;
const SETTLED: f64 = 1.0;
/// A pole that decays less than this during the longest run may as well be unstable.
const HARDLY: f64 = 0.1;
/// Phase that a pair must cover during the longest run to count as oscillating [rad].
const SWINGS: f64 = 1.0;
/// Relative cost of the bound on the closed loop from which no pilot within it may reproduce the human ...
const DEAR: f64 = 1.0;
/// ... provided that this part of the vehicle's motion remains unexplained.
const VISIBLE: f64 = 0.02;

/// The diagnostics of the solution; if the solve did not converge, only those of the last iterate that explain the
/// failure.
pub fn diagnostics(fit: &Fit, options: &FitOptions) -> Vec<Diagnostic> {
    let pilot = options.pilot;
    let poles = pilot.poles(&fit.theta);
    let wrong = [
        closed_loop(fit, options),
        is_idle(fit).then_some(Diagnostic::IdlePilot),
        lower(fit),
    ];
    let of_solution = [
        poor(fit, options),
        stopped_early(fit),
        one_start(fit),
        wild_start(fit, options),
        on_bound(fit, pilot, &poles),
        fast_pole(fit, &poles),
        cancelled(fit, pilot, &poles),
    ];
    let of_solution = of_solution.into_iter().filter(|_| fit.converged);
    wrong.into_iter().chain(of_solution).flatten().collect()
}

fn closed_loop(fit: &Fit, options: &FitOptions) -> Option<Diagnostic> {
    let closed_loop = fit.closed_loop.as_ref().filter(|_| fit.is_feasible())?;
    let pole = closed_loop.rightmost().map_or(f64::NAN, |pole| pole.re);
    if !closed_loop.is_stable() {
        let allowed = !options.stable_loop;
        return Some(Diagnostic::UnstableLoop { pole, allowed });
    }
    let duration = fit.runs.iter().map(RunFit::duration).fold(0.0, f64::max);
    if let Some(pole) = closed_loop::on_bound(closed_loop) {
        // Two equal real poles may be a slow pair by rounding.
        let swings = (pole.im * duration > SWINGS).then_some(pole.im);
        let cost = (fit.unbounded).map(|unbounded| fit.objective / unbounded - 1.0);
        let is_dear = cost.is_some_and(|cost| cost > DEAR);
        return Some(Diagnostic::LoopOnBound {
            pole: pole.re,
            swings,
            cost,
            contradicted: is_dear && swings.is_some() && unexplained(fit) > VISIBLE,
        });
    }
    (-pole * duration < HARDLY).then_some(Diagnostic::SlowLoop { pole, duration })
}

/// Rms of all residuals over the largest displacement of the vehicle in a run.
fn unexplained(fit: &Fit) -> f64 {
    let moved = fit.runs.iter().flat_map(|run| {
        let begin = run.position.first().copied().unwrap_or(0.0);
        run.position.iter().map(move |z| (z - begin).abs())
    });
    rms(fit.residuals()) / moved.fold(0.0, f64::max)
}

fn is_idle(fit: &Fit) -> bool {
    let sticks = fit.runs.iter().flat_map(|run| &run.stick);
    sticks.fold(0.0, |most: f64, u| most.max(u.abs())) <= IDLE
}

fn poor(fit: &Fit, options: &FitOptions) -> Option<Diagnostic> {
    let (mut left, mut total) = (0.0, 0.0);
    for run in &fit.runs {
        let model = match options.objective {
            Objective::Response => &run.position,
            Objective::Stick => &run.stick,
        };
        let recorded = model.iter().zip(&run.residual).map(|(m, r)| m + r);
        let recorded: Vec<f64> = recorded.filter(|y| y.is_finite()).collect();
        let mean = recorded.iter().sum::<f64>() / recorded.len().max(1) as f64;
        total += recorded.iter().map(|y| (y - mean).powi(2)).sum::<f64>();
        left += (run.residual.iter())
            .filter(|r| r.is_finite())
            .map(|r| r * r)
            .sum::<f64>();
    }
    let explained = 1.0 - left / total;
    (explained < POOR).then_some(Diagnostic::PoorFit { explained })
}

fn stopped_early(fit: &Fit) -> Option<Diagnostic> {
    let skipped = fit.skipped;
    let starts = fit.starts.len() + skipped;
    (skipped > 0).then_some(Diagnostic::StoppedEarly { skipped, starts })
}

fn one_start(fit: &Fit) -> Option<Diagnostic> {
    let starts = fit.tried;
    (starts > 0 && fit.agreeing() <= 1).then_some(Diagnostic::OneStart { starts })
}

/// The vehicle's state whose initial value exceeds its later values after [`SETTLED`] the most.
fn wild_start(fit: &Fit, options: &FitOptions) -> Option<Diagnostic> {
    if options.initial_state != InitialState::Free || options.objective != Objective::Response {
        return None;
    }
    let of_run = |run: &RunFit| {
        let settled = run.time.partition_point(|t| *t < run.time[0] + SETTLED);
        let later = |i: usize| {
            run.states[settled..]
                .iter()
                .fold(0.0, |m: f64, x| m.max(x[i].abs()))
        };
        // The position starts where it was recorded.
        let begin = |i: usize| (i, run.states[0][i], later(i));
        let worst = (1..N_STATES)
            .map(begin)
            .max_by(|a, b| ratio(a).total_cmp(&ratio(b)));
        worst.map(|worst| (run.name.clone(), worst))
    };
    let all = fit
        .runs
        .iter()
        .filter(|run| run.states.len() > 1)
        .filter_map(of_run);
    let (run, worst) = all.max_by(|a, b| ratio(&a.1).total_cmp(&ratio(&b.1)))?;
    (ratio(&worst) > WILD).then(|| Diagnostic::WildStart {
        run,
        state: STATE_NAMES[worst.0],
        value: worst.1,
        later: worst.2,
    })
}

fn ratio(&(_, begin, later): &(usize, f64, f64)) -> f64 {
    begin.abs() / later.max(1e-9)
}

fn lower(fit: &Fit) -> Option<Diagnostic> {
    let feasible = |s: &StartReport| s.feasible.map(|objective| (s.number, objective));
    let all = fit.starts.iter().filter_map(feasible);
    let (start, objective) = all.min_by(|(_, a), (_, b)| a.total_cmp(b))?;
    (objective < fit.objective * (1.0 - AGREE)).then_some(Diagnostic::Lower { start, objective })
}

fn on_bound(fit: &Fit, pilot: Pilot, poles: &[Complex<f64>]) -> Option<Diagnostic> {
    let conditions = RouthHurwitz { pilot };
    let mut values = vec![0.0; conditions.count()];
    conditions.values(&fit.theta, &mut values);
    let near = |value: &f64| *value <= (ON_BOUND - 1.0) * STABILITY_MARGIN;
    let rightmost = poles.iter().max_by(|a, b| a.re.total_cmp(&b.re))?;
    match values.iter().position(near)? {
        0 => Some(Diagnostic::Integrates),
        _ => Some(Diagnostic::PilotOnBound {
            frequency: rightmost.norm(),
        }),
    }
}

fn fast_pole(fit: &Fit, poles: &[Complex<f64>]) -> Option<Diagnostic> {
    let steps = fit.runs.iter().flat_map(|run| run.time.windows(2));
    let steps = steps.map(|pair| pair[1] - pair[0]);
    let limit = PI / steps.fold(f64::INFINITY, f64::min);
    let pole = poles.iter().map(|pole| pole.re).fold(0.0, f64::min);
    (pole < -limit).then_some(Diagnostic::FastPole { pole, limit })
}

fn cancelled(fit: &Fit, pilot: Pilot, poles: &[Complex<f64>]) -> Option<Diagnostic> {
    let zeros = zeros(&fit.theta[pilot.order..]);
    let nearest = |pole: &Complex<f64>| {
        let distances = zeros.iter().map(|zero| (zero - pole).norm());
        distances.fold(f64::INFINITY, f64::min)
    };
    let on_zero = |pole: &&Complex<f64>| nearest(pole) <= CANCELLED * pole.norm();
    let pole = poles.iter().find(on_zero)?.norm();
    Some(Diagnostic::Cancelled { pole })
}

/// Roots of the polynomial with these ascending coefficients.
fn zeros(numerator: &[f64]) -> Vec<Complex<f64>> {
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
    use crate::RunFit;
    use pilotage_flights::vehicle::ClosedLoop;

    /// A fit of `theta` to samples 0.05 s apart, with starts of these objectives.
    fn fit(theta: [f64; 6], starts: &[f64]) -> Fit {
        let run = RunFit {
            name: "run".into(),
            time: vec![0.0, 0.05, 0.1],
            target: vec![1.0; 3],
            position: vec![0.0; 3],
            stick: vec![0.1; 3],
            residual: vec![0.0; 3],
            states: vec![vec![0.0; 9]; 3],
        };
        let start = |objective: &f64| StartReport {
            number: 1,
            kkt: 0.0,
            curvature: Some(1.0),
            seconds: 0.0,
            descents: 1,
            status: pilotage_sqp::Status::Converged,
            objective: *objective,
            feasible: Some(*objective),
            iterations: 1,
        };
        Fit {
            theta: theta.to_vec(),
            objective: starts[0],
            converged: true,
            status: pilotage_sqp::Status::Converged,
            kkt: 0.0,
            curvature: Some(1.0),
            tried: starts.len(),
            skipped: 0,
            iterations: 1,
            unknowns: 33,
            seconds: 0.0,
            starts: starts.iter().map(start).collect(),
            violation: 0.0,
            runs: vec![run],
            closed_loop: None,
            unbounded: None,
            uncertainty: None,
            diagnostics: Vec::new(),
        }
    }

    fn of(theta: [f64; 6], starts: &[f64]) -> Vec<Diagnostic> {
        diagnostics(&fit(theta, starts), &FitOptions::default())
    }

    /// Poles at -1, -2 and -3, zeros at -5 and -6.
    const SOUND: [f64; 6] = [6.0, 11.0, 6.0, 30.0, 11.0, 1.0];

    #[test]
    fn a_sound_fit_raises_none() {
        assert_eq!(of(SOUND, &[7.0, 7.006]), []);
        let alone = Diagnostic::OneStart { starts: 1 };
        assert_eq!(
            of(SOUND, &[7.0]),
            [alone],
            "nothing agrees with a start of the user's"
        );
    }

    #[test]
    fn starts_that_end_elsewhere_are_told() {
        assert_eq!(
            of(SOUND, &[7.0, 7.008, 8.0]),
            [Diagnostic::OneStart { starts: 3 }]
        );
    }

    #[test]
    fn a_start_that_was_lower_is_told_and_agrees_with_none() {
        let mut fit = fit(SOUND, &[7.0, 7.0, 6.99]);
        assert_eq!(fit.agreeing(), 2);
        let lower = Diagnostic::Lower {
            start: 1,
            objective: 6.99,
        };
        assert_eq!(diagnostics(&fit, &FitOptions::default()), [lower]);
        fit.starts[2].feasible = None;
        assert_eq!(diagnostics(&fit, &FitOptions::default()), []);
    }

    #[test]
    fn an_integrating_pilot_is_told() {
        assert_eq!(
            of([1e-6, 2.0, 3.0, 30.0, 11.0, 1.0], &[7.0, 7.0]),
            [Diagnostic::Integrates]
        );
    }

    #[test]
    fn a_pole_beyond_the_samples_is_told() {
        // Poles at -1, -2 and -100.
        let found = of([200.0, 302.0, 103.0, 30.0, 11.0, 1.0], &[7.0, 7.0]);
        assert!(
            matches!(found[..], [Diagnostic::FastPole { pole, .. }] if (pole + 100.0).abs() < 1e-6),
            "{found:?}"
        );
    }

    #[test]
    fn a_pole_on_a_zero_is_told() {
        // Zeros at -2.01 and -6.
        let found = of([6.0, 11.0, 6.0, 12.06, 8.01, 1.0], &[7.0, 7.0]);
        assert!(
            matches!(found[..], [Diagnostic::Cancelled { pole }] if (pole - 2.0).abs() < 1e-6),
            "{found:?}"
        );
    }

    /// s³ + 2 s² + 3 s + 6 has the roots -2 and ±√3 i.
    #[test]
    fn an_undamped_pilot_is_told() {
        let found = of([6.0, 3.0, 2.0, 30.0, 11.0, 1.0], &[7.0, 7.0]);
        assert!(
            matches!(found[..], [Diagnostic::PilotOnBound { frequency }] if (frequency - 3.0_f64.sqrt()).abs() < 1e-6),
            "{found:?}"
        );
    }

    /// In 15 s, a double real root that is a pair by rounding does not oscillate. If an oscillating pair is on the
    /// bound too, it is reported instead of the slow pole.
    #[test]
    fn what_lies_on_the_bound_is_told_by_how_it_swings() {
        let with = |poles: &[(f64, f64)]| {
            let mut fit = fit(SOUND, &[7.0, 7.0]);
            fit.runs[0].time = vec![0.0, 0.05, 15.0];
            fit.unbounded = Some(5.0);
            let poles = poles.iter().map(|&(re, im)| Complex::new(re, im)).collect();
            fit.closed_loop = Some(ClosedLoop { poles });
            diagnostics(&fit, &FitOptions::default())
        };
        let bound = |swings| {
            let (pole, cost) = (-1e-3, Some(7.0 / 5.0 - 1.0));
            [Diagnostic::LoopOnBound {
                pole,
                swings,
                cost,
                contradicted: false,
            }]
        };
        assert_eq!(with(&[(-1e-3, -9e-7), (-1e-3, 9e-7)]), bound(None));
        let flutter = [(-1e-3, 0.0), (-1e-3, 1.8), (-1e-3, -1.8), (-2.0, 3.0)];
        assert_eq!(with(&flutter), bound(Some(1.8)));
    }

    #[test]
    fn the_closed_loop_is_told_where_it_is_unstable_or_on_its_bound() {
        let with = |re: f64, stable_loop: bool| {
            let mut fit = fit(SOUND, &[7.0, 7.0]);
            let poles = vec![Complex::new(-2.0, 0.0), Complex::new(re, 0.0)];
            fit.closed_loop = Some(ClosedLoop { poles });
            let options = FitOptions {
                stable_loop,
                ..FitOptions::default()
            };
            diagnostics(&fit, &options)
        };
        let unstable = |allowed| {
            vec![Diagnostic::UnstableLoop {
                pole: 1e-4,
                allowed,
            }]
        };
        assert_eq!(with(1e-4, true), unstable(false));
        assert_eq!(with(1e-4, false), unstable(true));
        assert!(unstable(false)[0].is_fatal() && !unstable(true)[0].is_fatal());
        let bound = Diagnostic::LoopOnBound {
            pole: -1e-3,
            swings: None,
            cost: None,
            contradicted: false,
        };
        assert_eq!(with(-1e-3, true), [bound]);
        let slow = Diagnostic::SlowLoop {
            pole: -0.01,
            duration: 0.1,
        };
        assert_eq!(with(-0.01, true), [slow]);
        assert_eq!(with(-1.5, true), []);
    }
}
