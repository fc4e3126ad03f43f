//! The optimality conditions of the QP at each step of a fit.

use crate::differences::SCHEMES;
use crate::program;
use pilotage_collocation::{Collocation, Condensed, Scheme};
use pilotage_flights::options::InitialState;
use pilotage_flights::{FlightOptions, Trial};
use pilotage_sqp::problem::Pattern;
use pilotage_sqp::{
    Curvature, Hessian, Iterate, QpFailure, QpSolver, SparseProblem, SqpOptions, Step, solve,
};
use std::ops::ControlFlow;
use std::path::Path;

/// Two shipped trials, as they are.
fn trials() -> Vec<Trial> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/trials");
    ["10m-run1.csv", "20m-run1.csv"]
        .map(|name| Trial::read(&folder.join(name)).unwrap())
        .into()
}

/// A pilot with a human's gain and lead, its poles those of a Butterworth filter at 1 rad/s.
const BUTTERWORTH: [f64; 6] = [1.0, 2.0, 2.0, -0.03, -0.1, 0.0];

/// `y += A x`, or `Aᵀ x`.
fn add(pattern: &Pattern, values: &[f64], transposed: bool, x: &[f64], y: &mut [f64]) {
    for (&(i, j), v) in pattern.iter().zip(values) {
        let (i, j) = if transposed { (j, i) } else { (i, j) };
        y[i] += v * x[j];
    }
}

/// Largest residuals of the QP's optimality conditions at a step: of stationarity, relative to the
/// largest of its terms, and of the linearised equalities, relative to their values.
fn optimality<P: SparseProblem>(
    problem: &P,
    at: &Iterate,
    kind: Hessian,
    damping: f64,
    step: &Step,
) -> (f64, f64) {
    let patterns = (
        problem.equality_pattern(),
        problem.inequality_pattern(),
        problem.hessian_pattern(),
    );
    let (mut j, mut g) = (vec![0.0; patterns.0.len()], vec![0.0; patterns.1.len()]);
    problem.jacobians(&at.z, &mut j, &mut g);
    let mut w = vec![0.0; patterns.2.len()];
    problem.hessian(&at.z, &at.lambda, &at.eta, kind, &mut w);
    let mut terms = vec![vec![0.0; at.z.len()]; 4];
    problem.gradient(&at.z, &mut terms[0]);
    add(&patterns.2, &w, false, &step.d, &mut terms[1]);
    let lower: (Pattern, Vec<f64>) = patterns
        .2
        .iter()
        .zip(&w)
        .filter(|((i, j), _)| i != j)
        .map(|(at, v)| (*at, *v))
        .unzip();
    add(&lower.0, &lower.1, true, &step.d, &mut terms[1]);
    let weighted = problem.damping_weights().iter().zip(&step.d);
    terms[1]
        .iter_mut()
        .zip(weighted)
        .for_each(|(t, (w, d))| *t += damping * w * d);
    add(&patterns.0, &j, true, &step.lambda, &mut terms[2]);
    add(&patterns.1, &g, true, &step.eta, &mut terms[3]);
    let largest = terms.iter().flatten().fold(1.0_f64, |m, v| m.max(v.abs()));
    let sum = (0..at.z.len()).map(|i| terms.iter().map(|t| t[i]).sum::<f64>());
    let stationarity = sum.fold(0.0_f64, |m, v| m.max(v.abs())) / largest;
    let mut c = at.c.clone();
    add(&patterns.0, &j, false, &step.d, &mut c);
    let size = |v: &[f64]| v.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
    (stationarity, size(&c) / size(&step.d).max(1.0))
}

/// The condensed QP, each of whose steps is checked as it is taken.
struct Checked {
    qp: Condensed,
    at: Option<Iterate>,
    worst: (f64, f64),
    steps: usize,
}

impl QpSolver<Collocation> for Checked {
    fn linearise(&mut self, problem: &Collocation, at: &Iterate, exact: bool) {
        self.at = Some(at.clone());
        self.qp.linearise(problem, at, exact);
    }

    fn lagrangian_gradient(&self) -> &[f64] {
        QpSolver::<Collocation>::lagrangian_gradient(&self.qp)
    }

    fn solve(
        &mut self,
        problem: &Collocation,
        hessian: Hessian,
        damping: f64,
        step: &mut Step,
    ) -> Result<(), QpFailure> {
        self.qp.solve(problem, hessian, damping, step)?;
        if step.violation == 0.0 {
            let at = self.at.as_ref().expect("linearised");
            let (dual, primal) = optimality(problem, at, hessian, damping, step);
            self.worst = (self.worst.0.max(dual), self.worst.1.max(primal));
            self.steps += 1;
        }
        Ok(())
    }

    fn correct(
        &mut self,
        problem: &Collocation,
        trial: &Iterate,
        d: &mut [f64],
    ) -> Result<(), QpFailure> {
        self.qp.correct(problem, trial, d)
    }

    fn curvature(&mut self, problem: &Collocation, at: &Iterate) -> Option<Curvature> {
        self.qp.curvature(problem, at)
    }
}

#[test]
fn every_step_of_a_fit_is_optimal() {
    for (scheme, initial_state) in SCHEMES
        .into_iter()
        .zip(InitialState::ALL.into_iter().cycle())
    {
        let mut options = FlightOptions {
            theta: Some(BUTTERWORTH.to_vec()),
            initial_state,
            ..FlightOptions::default()
        };
        options.fit.scheme = Some(scheme);
        let (problem, z) = program(&trials(), &options);
        let mut qp = Checked {
            qp: Condensed::default(),
            at: None,
            worst: (0.0, 0.0),
            steps: 0,
        };
        let limits = SqpOptions {
            max_iterations: 8,
            ..SqpOptions::default()
        };
        solve(&problem, &mut qp, z, &limits, &mut |_| {
            ControlFlow::Continue(())
        });
        assert!(qp.steps >= 4, "{}: {} steps", scheme.name(), qp.steps);
        let (dual, primal) = qp.worst;
        // One system for a whole run has larger multipliers of the elimination than small elements.
        let rounding = match scheme {
            Scheme::FiniteDifference(_) => 1e-8,
            _ => 1e-13,
        };
        // Free states of the pilot's observable form leave an unstable loop through larger multipliers.
        let stationary = match initial_state {
            InitialState::Free => 1e-5,
            _ => 1e-7,
        };
        assert!(
            dual < stationary && primal < rounding,
            "{}: {dual:e} {primal:e}",
            scheme.name()
        );
    }
}
