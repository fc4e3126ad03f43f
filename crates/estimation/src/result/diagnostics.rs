//! Finds the diagnostics of a result.

use crate::posed::Posed;
use crate::posed::data::RunData;
use crate::problem::file::Mesh;
use crate::result::Beside;
use crate::result::diagnostic::Diagnostic;
use crate::result::explained::little_explained;
use crate::result::other::Other;
use crate::result::outliers::{
    of_ends, of_frozen, of_repeats, of_runs, of_samples, of_times, still,
};
use crate::result::recordings::{PILOT, of_recordings};
use crate::result::{Fit, Found};
use crate::search::active::{held, on_stability_bound, violated};
use crate::search::begin::{early_end, is_resting};
use crate::search::solved::{Refinement, Solved};
use crate::search::starts::given;
use crate::system::part::FmuPart;
use pilotage_expression::Node;
use pilotage_inference::residuals::LjungBox;
use pilotage_inference::{Class, is_stepped};
use pilotage_series::flown;
use pilotage_sqp::Status;

/// A pole with a larger growth rate is unstable \[1/s\].
const GROWTH: f64 = 1e-6;
/// Significant error of the states.
const MOVES: f64 = 1e-3;
/// Distance of a solution from an optimum, in standard deviations, that is not told.
const SMALL_OFFSET: f64 = 0.05;
/// Smallest scaled curvature that is not considered flat.
const FLAT: f64 = 1e-9;
/// What is undefined if all terms of the problem are finite at its samples.
const SUM: &str = "the objective: its terms are finite at all samples, and their sum, a derivative or a value between \
                   samples is not";

/// All diagnostics of a result, the most severe first.
pub(crate) fn diagnostics(posed: &Posed<'_>, solved: &Solved, fit: &Fit) -> Vec<Diagnostic> {
    let mut all = Vec::new();
    let dead = failed(posed, |fmu| fmu.calls.fatal());
    if let Some(status) = fit.cut {
        all.push(Diagnostic::Cut {
            status,
            starts: fit.starts.iter().filter(|own| own.status == status).count(),
            refinement: !fit.refinement.is_done,
            events: !fit.events.is_whole,
        });
    } else if fit.status != Status::Converged && !dead.is_empty() {
        all.push(not_converged(posed, fit));
    } else if fit.status != Status::Converged {
        all.push(not_converged(posed, fit));
        all.extend(fit.trouble.clone().map(Diagnostic::Undefined));
        if fit.trouble.is_none() {
            let failed = failed(posed, |fmu| fmu.function.trouble());
            let is_unknown = failed.is_empty() && fit.status == Status::UndefinedStart;
            all.extend(is_unknown.then(|| Diagnostic::Undefined(SUM.to_owned())));
            all.extend(failed);
            all.extend(early(posed, fit));
        }
    }
    all.extend(dead);
    all.extend(
        fit.offset
            .filter(|own| *own > SMALL_OFFSET)
            .map(Diagnostic::AtKinks),
    );
    if fit.status == Status::Infeasible {
        let violated = violated(posed, solved).into_iter();
        all.extend(violated.map(|(name, by)| Diagnostic::Violated { name, by }));
    }
    let growth = fit
        .poles
        .iter()
        .map(|pole| pole[0])
        .fold(f64::NEG_INFINITY, f64::max);
    let is_loop = !posed.file.system.connections.is_empty();
    if growth > GROWTH && (is_loop || is_linear(posed)) {
        let is_kept = posed.file.stability.closed_loop.is_some();
        all.push(Diagnostic::UnstableLoop { growth, is_kept });
    }
    if fit.is_answer() {
        let kept = on_stability_bound(posed, solved).into_iter();
        all.extend(kept.map(Diagnostic::OnStabilityBound));
    }
    if fit.is_answer() && posed.filter.is_none() {
        let held = held(posed, solved).into_iter();
        all.extend(held.map(|(name, samples)| Diagnostic::OnLimit { name, samples }));
    }
    all.extend(fit.events.found.iter().cloned().map(Diagnostic::Event));
    let at_bound = |found: &Found| {
        found.bound.map(|bound| Diagnostic::AtBound {
            name: found.name.clone(),
            bound,
            is_tied: found.is_tied,
        })
    };
    all.extend(fit.parameters.iter().filter_map(at_bound));
    all.extend(undetermined(solved, fit));
    // A stick at its stops is not linear, and its describing function differs.
    // Nor is a pilot with kinks: a dead zone, a rate limit.
    // Neither is one that changes.
    if fit.saturated.is_empty() && !posed.has_kinks_in(PILOT) && !is_varying(posed) {
        all.extend(fit.describing.contradicted().map(Diagnostic::Contradicted));
    }
    all.extend(of_inputs(fit));
    all.extend(
        fit.change
            .clone()
            .filter(|_| has_residuals(fit))
            .map(Diagnostic::Changes),
    );
    let measured = 0..posed.file.measured.len();
    all.extend(measured.filter_map(|k| unbounded(posed, fit, k)));
    if has_residuals(fit) {
        all.extend(little_explained(posed, fit));
        for k in 0..posed.file.measured.len() {
            all.extend(coloured(posed, fit, k));
            let still = still(fit, k);
            all.extend(of_samples(posed, fit, k, &still));
            all.extend(of_frozen(posed, fit, k, &still));
            all.extend(of_runs(posed, fit, k));
            all.extend(of_times(posed, fit, k));
            all.extend(of_repeats(posed, fit, k));
            all.extend(of_ends(posed, fit, k));
        }
    }
    all.extend(stepped(posed));
    all.extend(of_recordings(
        posed,
        Some(fit).filter(|own| own.is_answer()),
    ));
    let heads =
        (posed.data.iter()).map(|run| (run.line.name.as_str(), run.series.comments.as_slice()));
    all.extend(flown::mixed(heads).into_iter().map(Diagnostic::Mixed));
    all.extend(of_starts(fit));
    all.extend(Other::of(fit).map(Diagnostic::OtherOptimum));
    for (instance, part) in &posed.joint.parts {
        let notes = part.fmu.iter().flat_map(|fmu| fmu.notes.iter().cloned());
        let instance = instance.clone();
        all.extend(notes.map(|note| Diagnostic::Description {
            instance: instance.clone(),
            note,
        }));
    }
    all.extend(of_mesh(posed, fit));
    let simulated = Diagnostic::Simulated {
        objective: fit.objective,
        simulated: fit.simulated_objective,
    };
    let is_known = fit.is_met() && fit.cut.is_none();
    all.extend((is_known && !fit.agrees()).then_some(simulated));
    all
}

/// The parameters whose intervals are as wide as their ranges and whose deviations exceed their values, so that what is
/// linear near the estimate says little; or no curvature in some direction.
fn undetermined(solved: &Solved, fit: &Fit) -> Option<Diagnostic> {
    let curvature = solved.solution.curvature;
    let curvature = curvature.filter(|own| fit.status == Status::Converged && *own < FLAT);
    let known = fit.uncertainty.as_ref().ok().filter(|_| fit.is_answer());
    let intervals = known.map_or(&[][..], |own| &own.intervals);
    let pairs = fit.parameters.iter().zip(intervals);
    let names = pairs.filter(|(own, all)| {
        let mut each = all.iter().zip(&own.values);
        each.any(|(interval, value)| interval.class == Class::Flat && interval.sd > value.1.abs())
    });
    let names: Vec<String> = names.map(|(own, _)| format!("`{}`", own.name)).collect();
    (curvature.is_some() || !names.is_empty())
        .then_some(Diagnostic::Undetermined { names, curvature })
}

/// Whether a parameter is tied to the time, or changes in a run.
fn is_varying(posed: &Posed<'_>) -> bool {
    let depends = posed
        .model
        .system
        .graph
        .dependants(|variable| variable == 0);
    let mut tied = posed.quantities.tied.iter();
    tied.any(|(_, node)| depends[node.index()])
        || posed.data.iter().any(|run| run.changes().next().is_some())
}

/// Inputs that are driven along lines by columns that jump.
fn stepped(posed: &Posed<'_>) -> impl Iterator<Item = Diagnostic> {
    let jumps = |column: &str| {
        let own = |run: &RunData<'_>| {
            let column = run.series.column(column);
            column.is_some_and(|own| is_stepped(&run.series.time, &own.values))
        };
        posed.data.iter().any(own)
    };
    let unsaid = posed.file.inputs.iter().filter(|own| own.hold.is_none());
    let stepped = unsaid.filter(move |own| jumps(&own.column.value));
    stepped.map(|own| Diagnostic::Stepped {
        input: own.signal.value.clone(),
        column: own.column.value.clone(),
    })
}

/// A simulation with the start values that ends early.
fn early(posed: &Posed<'_>, fit: &Fit) -> Option<Diagnostic> {
    if fit.status == Status::UndefinedStart {
        return None;
    }
    let (run, time) = early_end(posed, &given(posed), &|| false)?;
    let run = &posed.data[run];
    Some(Diagnostic::EarlyEnd {
        run: run.name().to_owned(),
        time: run.shown(time),
    })
}

fn not_converged(posed: &Posed<'_>, fit: &Fit) -> Diagnostic {
    Diagnostic::NotConverged {
        status: fit.status,
        has_kinks: posed.has_kinks(),
        is_resting: is_resting(posed),
        violation: Some(fit.kkt.primal)
            .filter(|_| !fit.is_met() && fit.status != Status::UndefinedStart),
    }
}

/// FMUs with failed calls to report.
fn failed(posed: &Posed<'_>, trouble: impl Fn(&FmuPart) -> Option<String>) -> Vec<Diagnostic> {
    let failed = posed.joint.parts.iter().filter_map(|(instance, part)| {
        Some(Diagnostic::FmuFailed {
            instance: instance.clone(),
            trouble: trouble(part.fmu.as_ref()?)?,
        })
    });
    failed.collect()
}

/// Whether the states' derivatives are linear in the states. Otherwise growth at one point may be part of an
/// oscillation.
fn is_linear(posed: &Posed<'_>) -> bool {
    let system = &posed.model.system;
    let mut graph = system.graph.clone();
    let states: Vec<usize> = (0..posed.joint.model.states.len())
        .map(|k| system.state(k))
        .collect();
    let slopes: Vec<Node> = (states.iter())
        .flat_map(|state| graph.derivatives(&system.derivatives, *state))
        .collect();
    let varies = graph.dependants(|variable| states.contains(&variable));
    slopes.iter().all(|node| !varies[node.index()])
}

/// A sample that is predicted exactly, as is the first one if an initial state is free: the likelihood then grows
/// without bound as the sensor's noise tends to 0.
fn unbounded(posed: &Posed<'_>, fit: &Fit, k: usize) -> Option<Diagnostic> {
    const PART: f64 = 1e-3;
    posed.filter.as_ref()?;
    let ahead = fit.runs.iter().filter_map(|run| run.ahead.as_ref());
    let known = ahead.flat_map(|own| own.deviations[k].iter().copied());
    let mut all: Vec<f64> = known.filter(|sd| sd.is_finite()).collect();
    all.sort_by(f64::total_cmp);
    let (least, middle) = (all.first()?, all[all.len() / 2]);
    (*least < PART * middle).then(|| Diagnostic::Unbounded {
        measured: posed.file.measured[k].column.value.clone(),
        sd: *least,
    })
}

/// Innovations that are not white. With a correct model this occurs in one of a thousand fits.
fn coloured(posed: &Posed<'_>, fit: &Fit, k: usize) -> Option<Diagnostic> {
    const LEVEL: f64 = 1e-3;
    posed.filter.as_ref()?;
    let ahead = fit.runs.iter().filter_map(|run| run.ahead.as_ref());
    let white = ahead.filter_map(|own| LjungBox::of(&own.innovations[k]));
    let p = white.map(|own| own.p).fold(1.0, f64::min);
    let tests = fit.runs.len() * posed.file.measured.len();
    (p * (tests as f64) < LEVEL).then(|| Diagnostic::Coloured {
        measured: posed.file.measured[k].column.value.clone(),
        p,
    })
}

/// Residuals correlated with inputs. With a correct model, one in a hundred fits has such a diagnostic, over all pairs
/// together.
fn of_inputs(fit: &Fit) -> Vec<Diagnostic> {
    let doubt = |own: &Beside| {
        let lag = own.crossed.left(fit.beside.len())?;
        Some(Diagnostic::InputLeft {
            measured: own.measured.clone(),
            input: own.input.clone(),
            lag: own.crossed.lags[lag],
            correlation: own.crossed.correlations[lag],
        })
    };
    let pairs = fit.beside.iter().filter(|_| has_residuals(fit));
    pairs.filter_map(doubt).collect()
}

/// Whether residuals belong to a solution and exceed the accuracy of the solver.
fn has_residuals(fit: &Fit) -> bool {
    fit.is_answer() && fit.chi2 > fit.resolution
}

fn of_starts(fit: &Fit) -> Option<Diagnostic> {
    let starts = fit.starts.len();
    (fit.agreeing() == 1 && starts > 2 && fit.others.is_empty())
        .then_some(Diagnostic::Alone(starts))
}

fn of_mesh(posed: &Posed<'_>, fit: &Fit) -> Option<Diagnostic> {
    let (refinement, error) = (&fit.refinement, fit.refinement.error);
    let Mesh::Tolerance(tolerance) = posed.file.options.mesh else {
        // A local error that a simulation does not show does not change a parameter either.
        let is_seen = error > MOVES && !fit.agrees();
        return is_seen.then_some(Diagnostic::CoarseMesh(error));
    };
    let change = refinement.changes.iter().copied().fold(0.0, f64::max);
    if error > tolerance {
        return Some(Diagnostic::MeshError {
            error,
            tolerance,
            is_limited: refinement.is_limited,
            rounds: (refinement.rounds == Refinement::MOST).then_some(refinement.rounds),
        });
    }
    (refinement.left() > Refinement::MOVES).then_some(Diagnostic::MeshMoves(change))
}
