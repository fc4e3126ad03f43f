//! The fit of a problem: an SQP from several starts, and the best on successively finer meshes.
//!
//! | module | contents |
//! | --- | --- |
//! | `raised` | starts from the order below |
//! | `guided` | starts from the data |
//! | `search` | the search from all starts; without limits first, where outputs saturate |
//! | `race` | all starts, and selection of the best |
//! | `apart` | optima of the same objective with other parameters |
//! | `behind` | when a solve is given up for the best so far |
//! | `solve` | the SQP from one point |
//! | `settled` | times that are sought, and the boundaries of the mesh that stand for them |
//! | `tumbles` | other initial states of each run at the best parameters |
//! | `kinks` | optima at which an SQP stalls |
//! | `plateau` | parameters without effect at an optimum |
//! | `refine` | finer meshes |
//! | `delays` | orders of delays without one |
//! | `unfinished` | the best parameters if no start has converged |
//! | `check` | simulation with the same parameters |
//! | `predicted` | fit of one-step predictions, if noise drives the system |
//! | [`alone`](mod@alone) | simulation without the estimated initial states |
//! | [`evaluate`] | the problem at its start values, without a search |
//! | `watch` | the observer, who may end the fit |

pub mod alone;
mod apart;
mod behind;
mod check;
mod delays;
pub mod evaluate;
mod guided;
mod kinks;
mod plateau;
mod predicted;
mod race;
mod raised;
mod refine;
mod search;
mod settled;
mod solve;
mod tumbles;
mod unfinished;
mod watch;

pub use delays::fit_delays;
pub(crate) use solve::sqp_options;
pub use solve::{SeeIterates, nearer, solve};

use crate::innovations;
use crate::posed::Posed;
use crate::problem::file::Mesh;
use crate::result::changed::changed;
use crate::result::describing::describing;
use crate::result::diagnostics::diagnostics;
use crate::result::events::{Events, events};
use crate::result::left_over::beside_inputs;
use crate::result::loops::Looped;
use crate::result::recordings::hopeless;
use crate::result::uncertainty::{Unsure, linearised, method, uncertainty};
use crate::result::{Fit, MUCH, Seconds, StartEnd, lap};
use crate::search::solved::{Refinement, Solved};
use crate::search::trouble;
use pilotage_inference::Inference;
use pilotage_sqp::{Iteration, Status};
use race::{Raced, best_of, better, has_answer, has_converged};
use refine::finest;
use search::{Searched, saturated, search};
use std::ops::ControlFlow;
use std::sync::Arc;
use std::time::Instant;
use unfinished::{best_met, is_better, settled};
use watch::Watch;

/// Progress of a fit, as passed to the observer.
#[derive(Debug, Clone, Copy)]
pub struct Progress<'a> {
    /// Index of the start, from 0.
    pub start: usize,
    /// Number of starts.
    pub starts: usize,
    /// Number of refinements of the mesh.
    pub refinement: usize,
    /// The iterate. None if the observer is only asked whether to continue.
    pub iteration: Option<&'a Iteration>,
}

/// Called with each iterate, and between iterates. `Break` ends the fit with the best iterate so far and the given
/// status.
pub type Observer<'a> = dyn FnMut(&Progress<'_>) -> ControlFlow<Status> + Send + 'a;

/// Fits a problem. Delays without an order that are not exact have the order that the problem was posed with.
pub fn fit(posed: &Posed<'_>, observer: &mut Observer<'_>) -> Fit {
    fitted(posed, None, observer)
}

/// The same from a solution of the same problem with another order of its delays, without a search.
fn fitted(
    posed: &Posed<'_>,
    from: Option<(&Posed<'_>, &Solved)>,
    observer: &mut Observer<'_>,
) -> Fit {
    let (mut clock, mut seconds) = (Instant::now(), Seconds::default());
    let watch = Watch::new(observer, posed.file.options.starts());
    // What makes any fit meaningless is all that is said of it.
    let hopeless = hopeless(posed);
    let is_hopeless = !hopeless.is_empty();
    if is_hopeless {
        watch.end_at_start();
    }
    let Searched {
        raced: Raced { mut solved, same },
        starts,
        watch,
    } = match (from, &posed.free) {
        (Some(from), _) => delays::continued(posed, from, watch),
        (None, Some(free)) => saturated(posed, free, watch),
        (None, None) => search(posed, watch),
    };
    let (best, mut errors) = best_flown(posed, &mut solved, &watch);
    let first = solved[best].as_ref();
    if let Some(own) = first.and_then(|own| plateau::beyond(posed, own, best, &watch)) {
        (solved[best], errors) = (Some(own), None);
    }
    seconds.search = lap(&mut clock);
    let ends = same.iter().map(|k| end(posed, solved[*k].as_ref(), &watch));
    let ends: Vec<StartEnd> = ends.collect();
    let thetas: Vec<Option<Vec<f64>>> = (same.iter())
        .map(|k| solved[*k].as_ref().map(Solved::theta))
        .collect();
    let lower = better(&solved);
    let begins = innovations::begins(posed, &solved);
    let met = match has_answer(&solved) {
        true => None,
        false => best_met(posed, &starts[0], &solved, &watch),
    };
    let (best, (mut last, mut refinement)) = match met {
        Some((best, met)) => {
            let left = solved[best].as_ref().unwrap_or(&met);
            let refinement = Refinement::new(left);
            (best, (met, refinement))
        }
        None => finest(posed, &mut solved, (best, errors), &watch),
    };
    // A start that is better is the answer, though it has not converged.
    let lower = lower.and_then(|k| settled(posed, solved[k].as_ref()?, &|| watch.is_over()));
    let is_lower = |own: &Solved| is_better(own, &last) && is_flown(posed, own, &watch);
    if let Some(own) = lower.filter(is_lower) {
        (refinement, last) = (Refinement::new(&own), own);
    }
    seconds.solve = lap(&mut clock);
    if posed.filter.is_some() {
        let mut found = predicted::predicted(posed, (last, refinement), begins, &watch);
        if is_hopeless {
            (found.cut, found.diagnostics) = (None, hopeless);
        }
        seconds.solve += lap(&mut clock);
        found.seconds = seconds;
        return found;
    }
    let trouble = match last.solution.status {
        Status::UndefinedStart => trouble::at_start(posed, &starts[0]),
        _ => None,
    };
    let (simulated, of_states) = rayon::join(
        || check::simulated(posed, &last, &watch),
        || Fit::of(posed, &last),
    );
    let mut found = Fit {
        trouble,
        starts: ends,
        simulated_objective: simulated.as_ref().map(|own| own.objective),
        refinement,
        ..of_states
    };
    let looped = Looped::of(posed, &last);
    found.cuts = looped.as_ref().map(Looped::cuts).unwrap_or_default();
    let figures = looped.iter().flat_map(Looped::found);
    found.derived.extend(figures);
    found.events = seen_events(posed, &last, &found, &watch);
    found.cut = cut(&found, &watch).filter(|_| !is_hopeless);
    let mut linear = None;
    if found.status == Status::Converged {
        let simulated = simulated.as_ref().map(|own| &own.at);
        let at = (&last.problem, &last.solution.iterate);
        seconds.diagnostics += lap(&mut clock);
        linear = linearised(posed, at.0, at.1);
        if found.kkt.residual() > posed.file.options.tolerance && posed.may_have_kinks() {
            found.offset = linear.as_ref().and_then(|own| kinks::offset(&own.data));
        }
        let known = linear.as_ref().ok_or(Unsure::NoDerivatives);
        let theta = last.theta();
        let change = || {
            let inference = Inference::new(&known.as_ref().ok()?.data).ok()?;
            changed(posed, &found, &theta, &inference)
        };
        let unsure = || {
            let looped = looped.as_ref();
            let at = (&last, &found, *known.as_ref().map_err(|own| *own)?);
            uncertainty(posed, at, simulated, looped, method(posed))
        };
        (found.change, found.uncertainty) = rayon::join(change, unsure);
        if let Ok(own) = known {
            let other = |theta: &[f64]| check::with(posed, &last, theta, &watch);
            found.take_others(apart::others(
                posed,
                (&found, best),
                &thetas,
                &own.data,
                &other,
            ));
        }
        seconds.uncertainty = lap(&mut clock);
        found.describing = describing(posed, &last);
    }
    if found.is_met() {
        found.beside = beside_inputs(posed, &found.runs, linear.as_ref().map(|own| &own.data));
    }
    found.diagnostics = match is_hopeless {
        true => hopeless,
        false => diagnostics(posed, &last, &found),
    };
    seconds.diagnostics += lap(&mut clock);
    found.seconds = seconds;
    found.solved = Some(Arc::new(last));
    found
}

/// The best start, and the errors of its mesh if they are known. On a given mesh one whose states follow the equations comes before
/// a better one whose states follow another motion.
fn best_flown(
    posed: &Posed<'_>,
    solved: &mut [Option<Solved>],
    watch: &Watch<'_, '_>,
) -> (usize, Option<Vec<Vec<f64>>>) {
    let mut best = best_of(posed, solved, watch);
    let answers = solved.iter().flatten().filter(|own| has_converged(own));
    if answers.count() < 2 {
        return best;
    }
    let mut aside: Vec<(usize, Option<Solved>)> = Vec::new();
    let mut flies = false;
    while !flies && has_answer(solved) && !watch.is_over() {
        flies = (solved[best.0].as_ref()).is_some_and(|own| is_flown(posed, own, watch));
        if !flies {
            aside.push((best.0, solved[best.0].take()));
            best = best_of(posed, solved, watch);
        }
    }
    // Where none flies, it is the best after all.
    if !flies {
        best = aside.first().map_or(best, |(first, _)| (*first, None));
    }
    for (k, own) in aside {
        solved[k] = own;
    }
    best
}

/// Whether the states of a solution follow the equations, as they do on a mesh that is refined.
fn is_flown(posed: &Posed<'_>, own: &Solved, watch: &Watch<'_, '_>) -> bool {
    if matches!(posed.file.options.mesh, Mesh::Tolerance(_)) {
        return true;
    }
    let simulated = check::simulated(posed, own, watch);
    let most = MUCH * (own.solution.iterate.f / posed.factor).abs();
    simulated.is_some_and(|own| own.objective <= most)
}

/// The events of a solution whose states satisfy the equations.
fn seen_events(posed: &Posed<'_>, solved: &Solved, fit: &Fit, watch: &Watch<'_, '_>) -> Events {
    let clock = Instant::now();
    match fit.is_met() {
        true => events(posed, solved, &|| watch.is_late(clock)),
        false => Events {
            is_whole: true,
            ..Events::default()
        },
    }
}

/// How a start ended.
fn end(posed: &Posed<'_>, solved: Option<&Solved>, watch: &Watch<'_, '_>) -> StartEnd {
    match solved {
        Some(own) => {
            let nearly = Some(own.nearly()).filter(|own| own.is_finite());
            StartEnd {
                status: own.solution.status,
                objective: nearly.map_or(f64::NAN, |f| f / posed.factor),
                iterations: own.solution.work.iterations,
                kkt: Some(own.solution.kkt.residual()),
                is_elsewhere: false,
                parameters: apart::named(posed, &own.theta()),
            }
        }
        None => StartEnd {
            status: watch.over().unwrap_or(Status::Stopped),
            objective: f64::NAN,
            iterations: 0,
            kkt: None,
            is_elsewhere: false,
            parameters: Vec::new(),
        },
    }
}

/// What ended a fit before all starts and refinements were completed, if anything.
fn cut(fit: &Fit, watch: &Watch<'_, '_>) -> Option<Status> {
    let status = watch.over()?;
    let is_undone = |own: &StartEnd| own.status == status;
    let is_whole = fit.refinement.is_done && fit.events.is_whole;
    let is_cut = fit.starts.iter().any(is_undone) || !is_whole;
    is_cut.then_some(status)
}
