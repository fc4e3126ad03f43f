//! Refits of a fit: profile likelihoods and bootstraps of `pilotage-refits`.

use super::constraints::STABILITY_MARGIN;
use super::solve::{again, sqp_options};
use super::uncertainty::data;
use super::{Fit, FitOptions, Trial, derived};
use pilotage_collocation::Run;
use pilotage_inference::{Autoregression, Inference, LEVEL, quantile};
use pilotage_refits::{Collocated, Coordinate, Solved, Study, Threshold, Unknown};
use pilotage_sqp::{Iterate, Status};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use std::ops::ControlFlow;

/// Names of the unknowns, in the order of [`Study::unknowns`].
pub fn sought(options: &FitOptions) -> Vec<String> {
    let count = options.pilot.n_parameters();
    (1..=count).map(|k| format!("theta{k}")).collect()
}

/// The refit problem of a fit. `None` if the fit has no uncertainty, or if its solution is not found again.
pub fn study(fit: &Fit, trials: &[Trial], options: &FitOptions) -> Option<Study<'static>> {
    let sure = fit.uncertainty.as_ref()?;
    let sqp = sqp_options(options);
    let (problem, z) = again(fit, trials, options);
    let found = pilotage_collocation::solve(&problem, z, &sqp, &mut |_| ControlFlow::Continue(()));
    let (problem, at) = (found.status == Status::Converged).then_some((problem, found.iterate))?;
    let data = data(&problem, &at)?;
    let inference = Inference::new(&data).ok()?;
    let unknown = |(k, name): (usize, String)| Unknown {
        name,
        label: None,
        at: Coordinate::Shared(k),
        is_log: false,
        half: quantile(LEVEL, f64::INFINITY) * sure.intervals[k].sd,
        // The coefficients of a stable polynomial are positive.
        range: [
            if k < options.pilot.order {
                STABILITY_MARGIN
            } else {
                f64::NEG_INFINITY
            },
            f64::INFINITY,
        ],
        informed_by: vec![true; trials.len()],
    };
    let degrees = inference.degrees();
    let conditions = problem.constraints.count();
    let names = (0..conditions).map(|k| format!("condition {} of stability", k + 1));
    let processes = inference.coloured();
    Some(Study {
        unknowns: sought(options)
            .into_iter()
            .enumerate()
            .map(unknown)
            .collect(),
        factor: 1.0,
        threshold: Threshold {
            noise: inference.noise(),
            root: quantile(LEVEL, degrees),
        },
        degrees: Some(degrees),
        constraints: names.collect(),
        bounds: vec!["the limit of the stick".to_owned()],
        is_predicted: false,
        derived: derived::names(fit, options),
        derive: derived::again(fit, options),
        solved: Box::new(Collocated {
            signals: 1,
            simulate: {
                let predicted = predicted(&problem, &at);
                let runs = problem.runs.clone();
                Box::new(move |random| drawn(&runs, &predicted, &processes[0], random))
            },
            solved: Solved {
                problem,
                at,
                options: sqp,
            },
        }),
    })
}

/// Predicted measurements of each run.
fn predicted(problem: &pilotage_collocation::Collocation, at: &Iterate) -> Vec<Vec<f64>> {
    let runs = 0..problem.runs.len();
    runs.map(|j| problem.outputs_at_samples(&at.z, j).swap_remove(0))
        .collect()
}

/// The runs with other residuals of the same process.
fn drawn(
    runs: &[Run],
    predicted: &[Vec<f64>],
    process: &Autoregression,
    random: &mut ChaCha8Rng,
) -> Vec<Run> {
    let mut runs = runs.to_vec();
    for (run, predicted) in runs.iter_mut().zip(predicted) {
        let own = &mut run.measured[0];
        let root = own.weight.sqrt();
        let pairs = own.values.iter_mut().zip(predicted).zip(&run.time);
        let there = pairs.filter(|((y, _), _)| y.is_finite());
        let (there, time): (Vec<_>, Vec<f64>) = there.unzip();
        let residuals = process.simulated(&time, || StandardNormal.sample(random));
        for ((y, h), residual) in there.into_iter().zip(residuals) {
            *y = h + residual / root;
        }
    }
    runs
}
