//! The fit of one-step predictions, starting from the fit of the response.

use super::check::free_run;
use super::cut;
use super::watch::Watch;
use crate::fit::apart;
use crate::innovations::{
    Begin, Likelihood, Optimum, Predicted, linearised, predicted as searched, timed,
};
use crate::posed::Posed;
use crate::result::changed::changed;
use crate::result::describing::describing;
use crate::result::diagnostic::Diagnostic;
use crate::result::diagnostics::diagnostics;
use crate::result::left_over::beside_inputs;
use crate::result::loops::Looped;
use crate::result::uncertainty::{method, uncertainty};
use crate::result::{Fit, RunFit, StartEnd};
use crate::search::active::beyond;
use crate::search::solved::Refinement;
use crate::search::solved::Solved;
use pilotage_inference::Inference;
use pilotage_sqp::{Iterate, Solution, Status};
use std::sync::Arc;
use std::time::Instant;

/// Fits from the best response and from others.
pub(super) fn predicted(
    posed: &Posed<'_>,
    (response, refinement): (Solved, Refinement),
    others: Vec<Begin>,
    watch: &Watch<'_, '_>,
) -> Fit {
    let see = |k: usize, own: &pilotage_sqp::Iteration| {
        // The observer divides by the factor of the response.
        let unscaled = pilotage_sqp::Iteration {
            objective: own.objective * posed.factor,
            ..*own
        };
        watch.see(k, 0, &unscaled)
    };
    let all = searched(posed, &response, others, &see);
    let best = all.first().expect("there is a begin");
    let clock = Instant::now();
    let (last, is_whole) = simulated(posed, best, response, &|| watch.is_late(clock));
    let mut found = Fit::of(posed, &last);
    let doubled = best.program.likelihood.doubled().value(&best.unknowns());
    found.status = best.solution.status;
    found.kkt = best.solution.kkt;
    found.curvature = best.solution.curvature;
    found.iterations = best.solution.work.iterations;
    found.objective = best.objective();
    found.simulated_objective = Some(doubled).filter(|_| is_whole);
    (found.chi2, found.nllh) = likelihoods(posed, &found.runs);
    found.starts = all
        .iter()
        .map(|own| StartEnd {
            status: own.solution.status,
            objective: own.objective(),
            iterations: own.solution.work.iterations,
            kkt: Some(own.solution.kkt.residual()),
            is_elsewhere: false,
            parameters: apart::named(posed, &own.unknowns()),
        })
        .collect();
    found.refinement = Refinement {
        iterations: refinement.iterations + best.iterations,
        // The response is only the initial guess, and the result does not depend on its mesh.
        error: f64::NAN,
        changes: Vec::new(),
        is_limited: false,
        ..refinement
    };
    let looped = Looped::of(posed, &last);
    found.cuts = looped.as_ref().map(Looped::cuts).unwrap_or_default();
    found.derived.extend(looped.iter().flat_map(Looped::found));
    found.cut = cut(&found, watch);
    if found.status == Status::Converged {
        let linear = linearised(posed, best);
        let data = timed(posed, best, &linear.data);
        let theta = &best.unknowns()[..posed.shared];
        let inference = Inference::new(&data).ok();
        found.change = inference.and_then(|own| changed(posed, &found, theta, &own));
        let thetas = all
            .iter()
            .map(|own| Some(own.unknowns()[..posed.shared].to_vec()));
        let thetas: Vec<Option<Vec<f64>>> = thetas.collect();
        found.take_others(apart::others(
            posed,
            (&found, 0),
            &thetas,
            &linear.data,
            &|_| None,
        ));
        found.uncertainty = uncertainty(
            posed,
            (&last, &found, &linear),
            None,
            looped.as_ref(),
            method(posed),
        );
        found.describing = describing(posed, &last);
    }
    if found.is_met() {
        found.beside = beside_inputs(posed, &found.runs, None);
    }
    found.diagnostics = diagnostics(posed, &last, &found);
    found.diagnostics.extend(on_stability_bound(posed, best));
    let exceeded = beyond(posed, &last).into_iter();
    let exceeded = exceeded.map(|(name, by)| Diagnostic::BeyondLimit { name, by });
    found.diagnostics.extend(exceeded.filter(|_| is_whole));
    found.solved = Some(Arc::new(last));
    found.optimum = Some(Arc::new(Optimum::of(best)));
    found
}

/// `Σ weight e²/s` and the negative log-likelihood.
fn likelihoods(posed: &Posed<'_>, runs: &[RunFit]) -> (f64, f64) {
    let ahead = runs.iter().zip(&posed.data);
    let ahead = ahead.filter_map(|(run, data)| Some((run.ahead.as_ref()?, data.line.weight)));
    ahead.fold((0.0, 0.0), |(chi2, nllh), (own, weight)| {
        (
            chi2 + weight * own.chi2(),
            nllh + 0.5 * weight * own.surprise(),
        )
    })
}

/// Simulation with the estimates without noise, and whether it was completed. Otherwise the states remain those of the
/// response.
fn simulated(
    posed: &Posed<'_>,
    best: &Predicted<'_>,
    response: Solved,
    stop: &pilotage_collocation::Stop<'_>,
) -> (Solved, bool) {
    let unknowns = best.unknowns();
    let theta = &unknowns[..posed.shared];
    let likelihood: &Likelihood<'_> = &best.program.likelihood;
    let runs = 0..posed.runs.len();
    let initial: Vec<Vec<f64>> = runs.map(|j| likelihood.initial(j, &unknowns)).collect();
    let (problem, z) = (&response.problem, &response.solution.iterate.z);
    let magnitudes = |j: usize| problem.magnitudes(z, j);
    let run = free_run(posed, theta, (&initial, &magnitudes), stop);
    let is_whole = run.is_some();
    let (problem, z) = run.unwrap_or_else(|| {
        let mut z = z.clone();
        let scales = &problem.model.scales.parameters;
        let scaled = theta.iter().zip(scales).map(|(v, s)| v / s);
        let first = problem.layout.theta;
        z[first..]
            .iter_mut()
            .zip(scaled)
            .for_each(|(own, v)| *own = v);
        (problem.clone(), z)
    });
    let solution = Solution {
        iterate: Iterate::new(&problem, z),
        ..best.solution.clone()
    };
    (Solved { problem, solution }, is_whole)
}

/// Stability conditions with a nonzero multiplier.
fn on_stability_bound(posed: &Posed<'_>, best: &Predicted<'_>) -> Vec<Diagnostic> {
    let (names, eta) = (&posed.names.parameters, &best.solution.iterate.eta);
    let held = (posed.names.stability..names.len()).filter(|k| eta[*k] != 0.0);
    let mut held: Vec<String> = held.map(|k| names[k].clone()).collect();
    held.dedup();
    held.into_iter().map(Diagnostic::OnStabilityBound).collect()
}
