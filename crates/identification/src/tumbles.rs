//! Other initial states of each run at a known θ.
//!
//! If the vehicle's initial states are free, it may tumble in the first tenths of a second, and each tumble is a local
//! optimum of its run, independently of the other runs. No start therefore leads to good optima of all runs at once. At
//! a known θ, however, each run is a small separate problem, and the best of several tumbles is found quickly.

use super::FitOptions;
use super::race::Race;
use super::random_starts::between;
use super::solve::{ROUGH_TOLERANCE, SHORT_STEP};
use pilotage_collocation::{
    Bound, Collocation, Differentiated, ParameterConstraints, Scales, rk4, solve,
};
use pilotage_models::quadcopter;
use pilotage_sqp::{Problem, Status};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, Uniform};
use rayon::prelude::*;
use std::ops::ControlFlow;
use std::sync::Arc;

/// Number of tumbles per run and round.
const KICKS: usize = 8;
/// Vehicle states that cause a tumble, and the change of each by a kick of size 1, with either sign: pitch [rad], its
/// rate [rad/s], speeds of the rotors [krad/s].
const KICKED: [(usize, f64); 4] = [(1, 1.0), (3, 10.0), (4, 0.3), (5, 0.3)];
/// Sizes of the kicks, drawn for each state.
const SIZES: [f64; 2] = [0.1, 3.0];
/// Maximum number of iterations for the problem of one run.
const ITERATIONS: usize = 40;
/// Number of Runge–Kutta steps between two nodes.
const SUBSTEPS: usize = 8;

/// Changes of the states in [`KICKED`].
type Kick = [f64; KICKED.len()];

fn kicks(seed: u64, count: usize) -> Vec<Kick> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let unit = Uniform::new(0.0, 1.0).expect("0 is less than 1");
    let mut unit = || unit.sample(&mut random);
    let mut along = |(_, each): (usize, f64)| {
        let sign = if unit() < 0.5 { -1.0 } else { 1.0 };
        sign * each * between(SIZES, unit())
    };
    (0..count).map(|_| KICKED.map(&mut along)).collect()
}

/// The variables of an optimum with the best of several tumbles of each run at the same θ; `None` if no run gains, or
/// if `watch`, which receives the completed share of the work, stops it.
pub(super) fn better(
    problem: &Collocation,
    z: &[f64],
    options: &FitOptions,
    seed: u64,
    watch: &mut dyn FnMut(f64) -> bool,
) -> Option<Vec<f64>> {
    let model = Arc::new(problem.model.tapes.at(&problem.physical_theta(z)));
    let runs = problem.runs.len();
    let kicks = kicks(seed, KICKS * runs);
    let mut moved = z.to_vec();
    let mut gains = false;
    for (j, kicks) in kicks.chunks(KICKS).enumerate() {
        if watch(j as f64 / runs as f64) {
            return None;
        }
        let run = OneRun::of(problem, model.clone(), z, j, options);
        if let Some(states) = run.best(kicks, options) {
            moved[problem.layout.runs[j].variables()].copy_from_slice(&states);
            gains = true;
        }
    }
    gains.then_some(moved)
}

/// One run of a problem at a known θ.
struct OneRun {
    problem: Collocation,
    /// Its variables at the optimum of the whole problem.
    z: Vec<f64>,
    objective: f64,
}

impl OneRun {
    /// Extracts run `j`; `model` is that of the whole problem at its θ.
    fn of(
        whole: &Collocation,
        model: Arc<Differentiated>,
        z: &[f64],
        j: usize,
        options: &FitOptions,
    ) -> Self {
        let problem = Collocation::new(
            model,
            ParameterConstraints::default(),
            whole.scheme,
            vec![whole.runs[j].clone()],
            Scales {
                states: whole.model.scales.states.clone(),
                parameters: Vec::new(),
            },
            &[Bound::at_samples(-options.stick_limit, options.stick_limit)],
        );
        let z = whole.coefficients(z, j).to_vec();
        let mut c = vec![0.0; problem.n_equalities()];
        let mut g = vec![0.0; problem.limits().0.len()];
        Self {
            objective: problem.evaluate(&z, &mut c, &mut g),
            problem,
            z,
        }
    }

    /// The scaled states of the best of these tumbles, if it is better than the initial solution.
    fn best(&self, kicks: &[Kick], options: &FitOptions) -> Option<Vec<f64>> {
        let solved: Vec<_> = (kicks.par_iter())
            .map(|kick| self.solved(self.kicked(kick, options)))
            .collect();
        let better = solved.into_iter().flatten();
        let (_, z) = better.min_by(|(a, _), (b, _)| a.total_cmp(b))?;
        Some(z)
    }

    /// The variables with the vehicle's pitch simulated from its kicked initial states under the same stick.
    fn kicked(&self, kick: &Kick, options: &FitOptions) -> Vec<f64> {
        let (n, times) = (self.problem.n_states(), &self.problem.grids[0].times);
        let scales = &self.problem.model.scales.states;
        let states = |k: usize| -> Vec<f64> {
            let scaled = self.z[k * n..(k + 1) * n].iter().zip(scales);
            scaled.map(|(x, s)| x * s).collect()
        };
        let no_inputs = vec![0.0; self.problem.model.n_inputs()];
        // The stick follows the derivatives and the measured output.
        let stick = |k: usize| {
            let model = &self.problem.model.tapes;
            model.evaluate(times[k], &states(k), &no_inputs, &[])[n + 1]
        };
        let mut x = states(0)[..quadcopter::N_STATES].to_vec();
        for ((i, _), kick) in KICKED.into_iter().zip(kick) {
            x[i] += kick;
        }
        let mut z = self.z.clone();
        for k in 0..times.len() {
            for (i, _) in KICKED {
                z[k * n + i] = x[i] / scales[i];
            }
            if k + 1 < times.len() {
                let (u0, u1) = (stick(k), stick(k + 1));
                rk4(&mut x, times[k + 1] - times[k], SUBSTEPS, |x, c| {
                    let mut dx = vec![0.0; quadcopter::N_STATES];
                    options.vehicle.derivative(x, u0 + c * (u1 - u0), &mut dx);
                    dx
                });
            }
        }
        z
    }

    /// Objective and variables of the optimum reached from these variables, if it is below the initial objective.
    fn solved(&self, z: Vec<f64>) -> Option<(f64, Vec<f64>)> {
        let options = pilotage_sqp::SqpOptions {
            tolerance: ROUGH_TOLERANCE,
            max_iterations: ITERATIONS,
            short_step: SHORT_STEP,
            ..pilotage_sqp::SqpOptions::default()
        };
        let mut race = Race::against(self.objective);
        let mut watch = |iteration: &_| match race.is_lost(iteration) {
            true => ControlFlow::Break(Status::Stopped),
            false => ControlFlow::Continue(()),
        };
        let solution = solve(&self.problem, z, &options, &mut watch);
        let gains = solution.iterate.f < self.objective && solution.kkt.primal < ROUGH_TOLERANCE;
        gains.then_some((solution.iterate.f, solution.iterate.z))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{InitialState, Trial, problem, start};
    use pilotage_flights::synthetic::{Flights, Human};
    use pilotage_models::Quadcopter;

    /// Two flights with free initial states, and a pilot that flies similarly; the variables are derived from the data
    /// only.
    fn with_flights(check: impl Fn(&Collocation, &[f64], &FitOptions)) {
        let flown = Flights {
            runs: 1,
            duration: 6.0,
            ..Flights::default()
        }
        .fly(&Human::default(), &Quadcopter::default());
        let trials: Vec<Trial> = (flown.unwrap().iter())
            .map(|f| Trial::parse(f.series.to_csv().as_bytes(), &f.name).unwrap())
            .collect();
        let options = FitOptions {
            initial_state: InitialState::Free,
            ..FitOptions::default()
        };
        let theta = [12.0, 17.0, 8.0, -0.04, -1.1, -0.1];
        let states: Vec<_> = (trials.iter())
            .map(|trial| start::joint_states(trial, &options, &theta))
            .collect();
        let problem = problem::response(&trials, &options, Scales::of(&states, &theta));
        let z = problem.variables(&states, &theta);
        check(&problem, &z, &options);
    }

    fn evaluated(problem: &impl Problem, z: &[f64]) -> (f64, f64) {
        let mut c = vec![0.0; problem.n_equalities()];
        let mut g = vec![0.0; problem.limits().0.len()];
        let objective = problem.evaluate(z, &mut c, &mut g);
        (objective, c.iter().fold(0.0, |most, c| most.max(c.abs())))
    }

    /// Each solved run is a run of the same pilot in the whole problem, with the objective that it reports.
    #[test]
    fn one_run_is_the_whole_problem_at_its_theta() {
        with_flights(|problem, z, options| {
            let model = Arc::new(problem.model.tapes.at(&problem.physical_theta(z)));
            let (whole, _) = evaluated(problem, z);
            let mut all = z.to_vec();
            let (mut before, mut after) = (0.0, 0.0);
            for j in 0..problem.runs.len() {
                let mut run = OneRun::of(problem, model.clone(), z, j, options);
                before += run.objective;
                run.objective = f64::INFINITY;
                let (objective, states) = run.solved(run.z.clone()).unwrap();
                after += objective;
                let range = problem.layout.runs[j].variables();
                all[range].copy_from_slice(&states);
            }
            assert!((before / whole - 1.0).abs() < 1e-12, "{before} {whole}");
            let (objective, violation) = evaluated(problem, &all);
            assert!(
                (objective / after - 1.0).abs() < 1e-12,
                "{objective} {after}"
            );
            assert!(violation < ROUGH_TOLERANCE, "{violation}");
            assert_eq!(problem.theta(&all), problem.theta(z));
        });
    }

    /// A kick changes only the pitch states, from the first node on, and decays before the run ends.
    #[test]
    fn a_kick_turns_the_vehicle_and_dies_away() {
        with_flights(|problem, z, options| {
            let model = Arc::new(problem.model.tapes.at(&problem.physical_theta(z)));
            let run = OneRun::of(problem, model, z, 0, options);
            let (n, scales) = (problem.n_states(), &problem.model.scales.states);
            let still = run.kicked(&[0.0; KICKED.len()], options);
            let kicked = run.kicked(&[1.0, -20.0, 0.1, -0.1], options);
            let change = |k: usize, i: usize| (kicked[k * n + i] - still[k * n + i]) * scales[i];
            for (i, expected) in [0.0, 1.0, 0.0, -20.0, 0.1, -0.1].into_iter().enumerate() {
                assert!((change(0, i) - expected).abs() < 1e-9, "state {i}");
            }
            let last = problem.grids[0].nodes() - 1;
            for i in 0..n {
                assert!(
                    change(last, i).abs() < 1e-3,
                    "state {i}: {}",
                    change(last, i)
                );
            }
        });
    }

    #[test]
    fn kicks_are_of_either_sign_and_within_their_sizes() {
        let all = kicks(1, 100);
        assert_ne!(all, kicks(2, 100));
        for (i, (_, each)) in KICKED.into_iter().enumerate() {
            let sizes = all.iter().map(|kick| kick[i].abs() / each);
            assert!(
                sizes
                    .into_iter()
                    .all(|s| (SIZES[0]..=SIZES[1]).contains(&s))
            );
            let negative = all.iter().filter(|kick| kick[i] < 0.0).count();
            assert!((30..=70).contains(&negative), "{negative}");
        }
    }
}
